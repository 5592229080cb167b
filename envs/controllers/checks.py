"""Gains and states as the controllers take them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array


def per_joint(value: ArrayLike, joints: int, name: str) -> Array:
    """A gain for each joint, shape (n,), from one number or n of them, none negative.

    Raises:
        ValueError: another shape, or a gain that is negative or not finite.
    """
    gain = np.asarray(value, dtype=float)
    if gain.shape not in ((), (joints,)):
        raise ValueError(f"{name}: shape {gain.shape}; expected a number or ({joints},)")
    if not (np.isfinite(gain) & (gain >= 0)).all():
        raise ValueError(f"{name} {value!r}: expected finite gains of 0 or more")
    return np.array(np.broadcast_to(gain, (joints,)))
