"""Whether the currents can be those of this arm in this motion, as the samples come."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors._faults import Torques
from tauguard.detectors.estimation.estimator import ArmModel, Estimator, Unknowns

Array = NDArray[np.float64]

#: Rate of the observer whose residual is looked at [1/s].
RATE = 20.0
#: A joint's noise counts as this share of the largest one's at least: a wrist is seldom known well.
SHARE = 0.1
#: By the number that the native check answers.
TEXTS = {
    14: "torque: the current of {joint} works against the motion ({value:.2f} of the torque that "
    "the model needs): another sign, exchanged joints, or another arm",
    15: "torque: the current of {joint} gives {value:.2f} of the torque that the model needs: "
    "another load, gain or arm, or a saturated or biased current",
}


class TorqueCheck:
    """Holds each joint's torque against what the arm's model needs, over 0.5 and 4 s.

    A contact changes the ratio of the two for as long as it lasts; one that drives a joint against
    its own torque for half a second looks the same as a wrong sign.
    """

    def __init__(self, arm: ArmModel, dt: float) -> None:
        """Begin before the first sample.

        Args:
            arm: calibrated.
            dt: sample interval of steps [s].
        """
        noise = np.asarray(arm.noise, dtype=np.float64)
        floor = np.maximum(noise, SHARE * noise.max())
        self._names, self._dt = arm.robot.joint_names, dt
        self._observer = Estimator(arm, RATE, dt, Unknowns.none())
        self._check = Torques(np.ascontiguousarray(arm.drive_gain, dtype=np.float64), floor, RATE)
        self._out = tuple(np.zeros((3, len(noise))))

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
        self._observer.step(q, qd, current, self._out, dt)  # type: ignore[arg-type]
        number, joint, value = self._check.step(self._out[0], current, dt or self._dt)
        return TEXTS[number].format(joint=self._names[joint], value=value) if number else ""
