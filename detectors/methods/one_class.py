"""A one-class detector: it learns what free motion looks like, without a single collision.

The one-class support vector machine (Schoelkopf et al. 2001) with the SRQ kernel on the windows
that the SVR looks at. The score is how far a window lies outside of what was seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from sklearn.svm import OneClassSVM

from tauguard.detectors import _kernel
from tauguard.detectors.features.training import Prepared
from tauguard.detectors.methods.svr_regressor import srq_kernel
from tauguard.detectors.methods.windowed import Windowed

Array = NDArray[np.float64]


@dataclass
class OneClass(Windowed):
    """One-class SVM on windows of free motion; collisions in the traces are left out."""

    windows: int = 3_000
    mined: int = 1_000  #: of the rarest free moments, added in each of two rounds
    sigma: float = 3.0  #: of the SRQ kernel
    outside: float = 0.05  #: share of the training windows that may lie outside
    vectors: Array | None = None  #: support vectors, shape (S, size)
    weights: Array | None = None  #: their coefficients, shape (S,)
    name: ClassVar[str] = "one-class"

    def _draw(self, prepared: Sequence[Prepared]) -> tuple[Array, Array]:
        assert self.features is not None
        rng = np.random.default_rng([self.seed, 3])
        total = sum(int(p.free.sum()) for p in prepared)
        x = []
        for p in prepared:
            rows = np.flatnonzero(p.free)
            share = min(len(rows), -(-self.windows * len(rows) // total))
            x.append(self.features.windows(p.signal, rng.choice(rows, share, replace=False)))
        return np.concatenate(x), np.zeros(sum(map(len, x)))

    def _learn(self, x: Array, y: Array) -> None:
        model = OneClassSVM(kernel="precomputed", nu=self.outside, cache_size=500)
        model.fit(srq_kernel(x, x, self.sigma))
        self.vectors = np.ascontiguousarray(x[model.support_])
        self.weights = np.ascontiguousarray(model.dual_coef_[0])

    def _predict(self, x: Array) -> Array:
        assert self.vectors is not None
        assert self.weights is not None
        out = np.empty(len(x))
        _kernel.KernelSum(self.vectors, -self.weights, 0.0, self.sigma).rows(
            np.ascontiguousarray(x), out, 0
        )
        return out

    def _own_parts(self) -> dict[str, Any]:
        return {"sigma": self.sigma, "vectors": self.vectors, "weights": self.weights}

    def _restore(self, parts: dict[str, Any]) -> None:
        self.sigma = float(parts["sigma"])
        self.vectors, self.weights = np.asarray(parts["vectors"]), np.asarray(parts["weights"])
