"""Checks sample by sample whether the motor currents fit the arm and its motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors import _observer
from tauguard.detectors.estimation.estimator import MOTION, ArmModel, Estimator, Unknowns
from tauguard.traces.trace import Trace

#: Rate of the observer whose residual is used [1/s].
RATE = 20.0
#: Least noise of a joint, as a fraction of the largest of all joints. Without it a load, which can
#: reverse the small torque of a wrist joint, would be a fault.
FRACTION = 0.5
#: A fast ratio below the first works against the motion; slow ones outside of the other two say
#: another size. With loads and contacts in training, what those show beyond, and the margin.
OPPOSED, LEAST, MOST, MARGIN = -0.4, 0.4, 1.7, 0.4
#: By the number that the native check answers.
TEXTS = {
    14: "torque: {joint} is driven against its motion ({value:.2f} of the torque that the model "
    "needs): another sign, exchanged joints, another arm, or a push of half a second or more",
    15: "torque: {joint} is driven with {value:.2f} of the torque that the model needs: "
    "another load, gain or arm, or a saturated or biased current",
}


def torque_fault(names: Sequence[str], number: int, joint: int, value: float) -> str:
    """The text of a fault that the native check returns; ``names`` are those of the joints."""
    return TEXTS[number].format(joint=names[joint], value=value)


class TorqueCheck:
    """Compares each joint's drive torque with the torque that the model needs, over 0.5 and 4 s.

    A contact changes their ratio while it lasts. A contact that pushes a joint against its drive
    torque for half a second looks the same as a wrong sign.
    """

    def __init__(self, arm: ArmModel, dt: float, ratios: Array | None = None) -> None:
        """Begin before the first sample.

        Args:
            arm: calibrated.
            dt: sample interval of steps [s].
            ratios: of the training traces, see :func:`torque_ratios` (default: all 1).
        """
        seen = np.ones((3, arm.robot.joints)) if ratios is None else ratios
        bounds = (
            np.minimum(OPPOSED, seen[0] - MARGIN),
            np.minimum(LEAST, seen[1] - MARGIN),
            np.maximum(MOST, seen[2] + MARGIN),
        )
        noise = np.asarray(arm.noise, dtype=np.float64)
        floor = np.maximum(noise, FRACTION * noise.max())
        self._names, self._dt = arm.robot.joint_names, dt
        self.observer = Estimator(arm, RATE, dt, Unknowns.none())
        gain = np.ascontiguousarray(arm.drive_gain, dtype=np.float64)
        self.native = _observer.TorqueCheck(gain, floor, RATE, *bounds)
        self._out = np.zeros((2 + MOTION, len(noise)))

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> str:
        """The fault of the torques at this sample as text, "" without a fault.

        Args:
            q: [rad], float64, shape (n,).
            qd: [rad/s], shape (n,).
            current: [A], shape (n,).
            dt: time since the last sample [s] (default: the constructor's).

        Raises:
            ValueError: wrong shapes or numbers that are not finite.
        """
        self.observer.step(q, qd, current, self._out, dt)
        number, joint, value = self.native.step(self._out[0], current, dt or self._dt)
        return torque_fault(self._names, number, joint, value) if number else ""

    def reset(self) -> None:
        """Forget all samples, for example after a contact, which changes the ratios."""
        self.native.reset()

    @property
    def extremes(self) -> Array:
        """Least ratio over 0.5 s, least and largest ratio over 4 s until now, shape (3, n)."""
        return np.array(self.native.extremes()).reshape(3, -1)


def torque_ratios(traces: Sequence[Trace], arm: ArmModel) -> Array:
    """Extreme ratios of drive torque to the model's torque along traces, shape (3, n).

    Rows: least over 0.5 s, least over 4 s, largest over 4 s. They are 1 for a joint whose torque
    is always too small to be judged.
    """
    found = np.ones((3, arm.robot.joints))
    for trace in traces:
        dt = trace.dt  # a median over the trace: computed once
        check = TorqueCheck(arm, dt)
        residuals = check.observer.run(trace.t, trace.q, trace.qd, trace.current).residual
        for residual, current in zip(residuals, trace.current, strict=True):
            check.native.step(residual, current, dt)
        own = check.extremes
        found = np.vstack([np.minimum(found[:2], own[:2]), np.maximum(found[2:], own[2:])])
    return found
