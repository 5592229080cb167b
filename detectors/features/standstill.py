"""When a joint stands still: static friction is indeterminate there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Bools
from tauguard.detectors.thresholds.confirmation import confirmed

#: A joint slower than this [rad/s] for this long [s] stands still.
STILL_SPEED, STILL_TIME = 0.01, 0.15


def still(qd: NDArray[np.float64], dt: float) -> Bools:
    """Which joints stand still at each sample, shape (T, n)."""
    samples = max(1, round(STILL_TIME / dt))
    return np.column_stack([confirmed(np.abs(v) < STILL_SPEED, samples) for v in qd.T])
