"""The output filter: an alarm only after t_c of continuous True."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Bools

#: Default t_c [s] (Park et al. 2021; the dissertation's value).
CONFIRMATION = 3e-3


def confirmation_samples(confirmation: float, dt: float) -> int:
    """How many successive True samples stand for ``confirmation`` seconds at interval ``dt`` [s].

    Sample k stands for the interval that ends with it, so n samples are n dt; at least one.
    """
    if not (np.isfinite(confirmation) and confirmation >= 0 and dt > 0):
        raise ValueError(f"confirmation {confirmation} s and dt {dt} s: expected >= 0 and > 0")
    return max(1, round(confirmation / dt))


def confirmed(raw: ArrayLike, samples: int) -> Bools:
    """True where the last ``samples`` entries of ``raw`` are all True, shape (T,)."""
    if samples < 1:
        raise ValueError(f"samples: {samples}, expected 1 or more")
    truth = np.asarray(raw, dtype=np.bool_)
    if truth.ndim != 1:
        raise ValueError(f"raw: shape {truth.shape}, expected (T,)")
    index = np.arange(len(truth))
    last_false = np.maximum.accumulate(np.where(truth, -1, index))
    return np.asarray(index - last_false >= samples)
