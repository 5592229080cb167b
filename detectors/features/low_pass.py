"""A first-order low-pass that starts at its first sample, in batch and sample by sample."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from tauguard.arrays import Array


def smoothed(x: Array, rate: float, dt: float) -> Array:
    """The low-pass of rate ``rate`` [1/s] along the rows of x, from the first row's value."""
    keep = float(np.exp(-rate * dt))
    filtered: Array = lfilter([1 - keep], [1, -keep], x - x[:1], axis=0) + x[:1]
    return filtered


class LowPass:
    """:func:`smoothed`, sample by sample, with equal results."""

    def __init__(self, rate: float, dt: float) -> None:
        """Take rate [1/s] and sample interval [s]."""
        self._keep = float(np.exp(-rate * dt))
        self._first: Array | None = None
        self._state: Array | float = 0.0

    def step(self, x: Array) -> Array:
        """The filtered value at this sample, shape as x."""
        if self._first is None:
            self._first = x.copy()
        self._state = self._keep * self._state + (1 - self._keep) * (x - self._first)
        return self._state + self._first
