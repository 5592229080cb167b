"""From an arm's samples to each joint's ratio of signal to bound."""

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
