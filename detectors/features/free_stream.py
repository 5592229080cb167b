"""From an arm's samples to each joint's ratio of signal to bound, one sample at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors import _observer
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.estimation.slow_errors import LoadDeviation
from tauguard.detectors.features.free_bound import Bound

Array = NDArray[np.float64]

#: A joint slower than this [rad/s] for a while is at rest.
SLOW = _observer.REGIME_SLOW


def native(arm: ArmModel, bound: Bound, load: LoadDeviation) -> _observer.FreeMotion:
    """The native detector of one recording.

    Args:
        arm: calibrated, with friction.
        bound: of its joints.
        load: how uncertain the carried load is.
    """
    assert arm.friction is not None
    return _observer.FreeMotion(
        arm.robot.chain,
        arm.friction.basis(arm.robot.joints),
        arm.drive_gain.tolist(),
        arm.friction.weights.ravel().tolist(),
        bound.friction.tolist(),
        load.mass,
        load.moment,
        bound.rest.tolist(),
        bound.stop.tolist(),
        bound.least.tolist(),
        bound.moving.ravel().tolist(),
        bound.start.tolist(),
    )


class FreeStream:
    """The scores of one recording as its samples come in."""

    def __init__(self, arm: ArmModel, bound: Bound, load: LoadDeviation, dt: float) -> None:
        """Begin anew.

        Args:
            arm: calibrated.
            bound: of its joints.
            load: how uncertain the carried load is.
            dt: sample interval for steps that do not say theirs [s].
        """
        self._native, self._dt = native(arm, bound, load), dt
        self._joints = arm.robot.joints

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> float:
        """The score of this sample: the largest ratio of a joint's signal to its bound.

        Args:
            q: [rad], float64, shape (n,).
            qd: [rad/s], shape (n,).
            current: [A], shape (n,).
            dt: time since the last sample [s] (default: the constructor's).

        Raises:
            ValueError: wrong shapes or numbers that are not finite; the state is as before.
        """
        try:
            return self._native.step(q, qd, current, self._dt if dt is None else dt)
        except TypeError:
            raise ValueError(
                f"q, qd, current: expected float64 arrays of shape ({self._joints},)"
            ) from None
