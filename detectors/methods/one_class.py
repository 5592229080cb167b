"""A one-class detector: it learns what collision-free motion looks like, without a collision.

The one-class support vector machine (Schoelkopf et al. 2001) with the SRQ kernel on the windows
that the SVR uses. The score is how far a window lies outside of the training windows: minus the
logarithm of the machine's kernel sum, which orders windows as its decision function does. That
function ends at 0 far from all training windows, where thresholds for few false alarms lie.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from sklearn.svm import OneClassSVM

from tauguard.arrays import Array
from tauguard.detectors.features.training import Prepared
from tauguard.detectors.features.windows import WindowShape
from tauguard.detectors.frozen import Frozen
from tauguard.detectors.methods.kernel_machine import KernelMachine
from tauguard.detectors.methods.svr_regressor import srq_kernel
from tauguard.detectors.methods.windowed import Windowed

#: Smallest kernel sum: the logarithm stays finite.
LEAST = 1e-300


@dataclass(frozen=True, eq=False)
class Remoteness(Frozen):
    """``-log`` of a kernel sum with weights of 0 or more, without bound far from its vectors."""

    kernels: KernelMachine

    def __call__(self, x: Array) -> Array:
        """Values at the rows of x, shape (N, d) -> (N,)."""
        found: Array = -np.log(np.maximum(self.kernels(x), LEAST))
        return found


@dataclass(frozen=True)
class OneClass(Windowed):
    """One-class SVM on windows of collision-free motion; collisions in the traces are not used."""

    windows: int = 3_000
    mined: int = 1_000  #: of the rarest collision-free moments, added in each of two rounds
    sigma: float = 3.0  #: of the SRQ kernel
    graded: bool = False
    outside: float = 0.05  #: share of the training windows that may lie outside
    name: ClassVar[str] = "one-class"

    def draw(
        self, rng: np.random.Generator, prepared: Sequence[Prepared], shape: WindowShape
    ) -> tuple[Array, Array]:
        """Collision-free windows, as many of a trace as it has rows."""
        total = sum(int(p.free.sum()) for p in prepared)
        x = []
        for p in prepared:
            rows = np.flatnonzero(p.free)
            share = min(len(rows), -(-self.windows * len(rows) // total))
            x.append(shape.of(p.signal, rng.choice(rows, share, replace=False)))
        return np.concatenate(x), np.zeros(sum(map(len, x)))

    def learn(self, x: Array, y: Array) -> Remoteness:
        """The machine's decision function, but for its constant, as a remoteness."""
        model = OneClassSVM(kernel="precomputed", nu=self.outside, cache_size=500)
        model.fit(srq_kernel(x, x, self.sigma))
        vectors = np.ascontiguousarray(x[model.support_])
        weights = np.ascontiguousarray(model.dual_coef_[0])
        return Remoteness(KernelMachine(vectors, weights, 0.0, self.sigma))
