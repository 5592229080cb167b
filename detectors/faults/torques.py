"""Whether the currents can be those of this arm in this motion, as the samples come."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors import _observer
from tauguard.detectors.estimation.estimator import MOTION, ArmModel, Estimator, Unknowns
from tauguard.traces.trace import Trace

#: Rate of the observer whose residual is looked at [1/s].
RATE = 20.0
#: A joint counts as noisy as this fraction of the noisiest at least: a load can turn the torque of
#: a wrist around, but not that of a shoulder.
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
    """What the native check says of torques, in words; ``names`` are the joints'."""
    return TEXTS[number].format(joint=names[joint], value=value)


class TorqueCheck:
    """Holds each joint's torque against what the arm's model needs, over 0.5 and 4 s.

    A contact changes the ratio of the two for as long as it lasts; one that drives a joint against
    its own torque for half a second looks the same as a wrong sign.
    """

    def __init__(self, arm: ArmModel, dt: float, ratios: Array | None = None) -> None:
        """Begin before the first sample.

        Args:
            arm: calibrated.
            dt: sample interval of steps [s].
            ratios: what training showed, see :func:`torque_ratios` (default: nothing unusual).
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
        """What is wrong with the torques at this sample, "" for nothing.

        Args:
            q: [rad], float64, shape (n,).
            qd: [rad/s], shape (n,).
            current: [A], shape (n,).
            dt: since the last sample [s] (default: the constructor's).

        Raises:
            ValueError: wrong shapes or numbers that are not finite.
        """
        self.observer.step(q, qd, current, self._out, dt)
        number, joint, value = self.native.step(self._out[0], current, dt or self._dt)
        return torque_fault(self._names, number, joint, value) if number else ""

    def reset(self) -> None:
        """Forget the ratios so far: a contact has ended, which changed them."""
        self.native.reset()

    @property
    def extremes(self) -> Array:
        """Least fast, least slow and largest slow ratio so far, shape (3, n)."""
        return np.array(self.native.extremes()).reshape(3, -1)


def torque_ratios(traces: Sequence[Trace], arm: ArmModel) -> Array:
    """What traces show of the ratios of torque given to torque needed, shape (3, n).

    The least over 0.5 s, the least and the largest over 4 s; 1 where nothing counted.
    """
    found = np.ones((3, arm.robot.joints))
    for trace in traces:
        dt = trace.dt  # a median over the trace: asked once
        check = TorqueCheck(arm, dt)
        residuals = check.observer.run(trace.t, trace.q, trace.qd, trace.current).residual
        for residual, current in zip(residuals, trace.current, strict=True):
            check.native.step(residual, current, dt)
        own = check.extremes
        found = np.vstack([np.minimum(found[:2], own[:2]), np.maximum(found[2:], own[2:])])
    return found
