"""CUSUM (Page 1954): small deviations that last count as much as large ones that are short."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array, Bools
from tauguard.detectors import _ranking
from tauguard.detectors.features.front_end import FrontEnd
from tauguard.detectors.features.scaling import Scaling
from tauguard.detectors.methods.per_joint import FittedPerJoint, PerJoint
from tauguard.traces.trace import Trace

#: Once the statistic falls, it is at most what this much time without a residual takes away [s]: a
#: long contact would otherwise leave an alarm that lasts longer than the contact.
RECOVERY = 0.1


def bounded_cusum(increments: ArrayLike, cap: ArrayLike, state: Array | None = None) -> Array:
    """g_k = max(0, g + x_k) down the rows, g = g_{k-1}, or min(cap, g_{k-1}) where x_k < 0.

    Args:
        increments: shape (T, c).
        cap: at or above 0, one number or one a column.
        state: g before the first row, shape (c,) (default: 0); holds the last g afterwards.
    """
    x = np.ascontiguousarray(increments, dtype=np.float64)
    bound = np.ascontiguousarray(np.broadcast_to(cap, x.shape[1:]), dtype=np.float64)
    out = np.empty_like(x)
    _ranking.bounded_cusum(x, bound, np.zeros(x.shape[1]) if state is None else state, out)
    return out


@dataclass(frozen=True)
class Cusum(PerJoint["FittedCusum"]):
    """Two-sided CUSUM of every joint's residual in units of its envelope; the largest counts.

    The statistic grows by (|ratio| - drift) dt while the ratio keeps its sign. Otherwise it falls,
    from a bound at most, down to 0; the score is in seconds times the drift. The residual of
    collision-free motion is not white (friction errors last), so the drift is the limit that such
    motion exceeds in one sample of a hundred, not the half of a shift that white noise would ask
    for.
    """

    share: float = 0.99
    name: ClassVar[str] = "cusum"

    def fitted(self, front: FrontEnd, scaling: Scaling, limits: Array) -> FittedCusum:
        """See the class."""
        return FittedCusum(front, scaling, limits)


@dataclass(frozen=True, eq=False)
class FittedCusum(FittedPerJoint):
    """The statistic over its drift; it begins when the estimator has settled."""

    name: ClassVar[str] = "cusum"

    def scores(self, trace: Trace) -> Array:
        """The largest statistic over joints and signs, in units of its drift [s], shape (T,)."""
        settled = trace.t - trace.t[0] > self.settle - self.dt / 2
        return self._score(self.front.scaled(trace, self.scaling), settled, None)

    def _score(self, ratio: Array, settled: Bools, state: Array | None) -> Array:
        both = np.concatenate([ratio, -ratio], axis=1) * settled[:, None]
        drift = np.concatenate([self.limits, self.limits])
        level = bounded_cusum((both - drift) * self.dt, drift * RECOVERY, state)
        score: Array = (level / drift).max(axis=1)
        return score

    def stream(self) -> CusumStream:
        """The same, sample by sample."""
        return CusumStream(self)


class CusumStream:
    """Sample by sample."""

    def __init__(self, detector: FittedCusum) -> None:
        """Begin anew."""
        self._detector, self._residual = detector, detector.front.stream(detector.scaling)
        self._state = np.zeros(2 * len(detector.limits))
        self._time = -1.0

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> float:
        """The score of this sample."""
        own = self._detector
        ratio = self._residual.step(q, qd, current, dt)
        self._time = 0.0 if self._time < 0 else self._time + (own.dt if dt is None else dt)
        settled = np.array([self._time > own.settle - own.dt / 2])
        return float(own._score(ratio, settled, self._state)[0])
