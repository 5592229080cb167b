"""A weighted sum of SRQ kernels: what support vector machines of this kernel compute."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors import _kernel
from tauguard.detectors.frozen import Frozen


@dataclass(frozen=True, eq=False)
class KernelMachine(Frozen):
    """``intercept + sum_i weight_i / (1 + |x - vector_i|^2 / sigma^2)^2``."""

    vectors: Array  #: shape (S, d)
    weights: Array  #: shape (S,)
    intercept: float
    sigma: float

    def __post_init__(self) -> None:
        """Check: ``ValueError`` names what does not fit."""
        if self.vectors.ndim != 2 or self.weights.shape != self.vectors.shape[:1]:
            raise ValueError(f"vectors {self.vectors.shape}, weights {self.weights.shape}: differ")
        if not (np.isfinite(self.sigma) and self.sigma > 0):
            raise ValueError(f"sigma: {self.sigma}, expected above 0")

    @cached_property
    def native(self) -> _kernel.KernelSum:
        """The native form."""
        vectors, weights = map(np.ascontiguousarray, (self.vectors, self.weights))
        return _kernel.KernelSum(vectors, weights, self.intercept, self.sigma)

    def __call__(self, x: Array) -> Array:
        """Values at the rows of x, shape (N, d) -> (N,)."""
        out = np.empty(len(x))
        self.native.rows(x, out, 0)
        return out

    def reduced(self, count: int) -> KernelMachine:
        """Nearly the same function with at most ``count`` vectors.

        See :func:`tauguard.detectors.methods.reduced_set.reduced_set`.

        Raises:
            ValueError: a count outside 1 to the number of vectors.
        """
        from tauguard.detectors.methods.reduced_set import reduced_set

        vectors, weights = reduced_set(self.vectors, self.weights, self.sigma, count)
        return KernelMachine(vectors, weights, self.intercept, self.sigma)
