"""CUSUM (Page 1954): small deviations that last count as much as large ones that are short."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.detectors import _ranking
from tauguard.detectors.estimation.estimator import Estimate
from tauguard.detectors.methods.per_joint import PerJoint
from tauguard.traces.trace import Trace

Array = NDArray[np.float64]


#: The statistic is bounded to what this much time without a residual takes away again [s]: a long
#: contact would otherwise leave an alarm behind that lasts longer than itself.
RECOVERY = 0.1


def bounded_cusum(increments: ArrayLike, cap: ArrayLike) -> Array:
    """g_k = min(cap, max(0, g_{k-1} + x_k)) down the rows, from g_{-1} = 0.

    Args:
        increments: shape (T, c).
        cap: at or above 0, one number or one a column.
    """
    x = np.ascontiguousarray(increments, dtype=np.float64)
    bound = np.ascontiguousarray(np.broadcast_to(cap, x.shape[1:]), dtype=np.float64)
    out = np.empty_like(x)
    _ranking.bounded_cusum(x, bound, np.zeros(x.shape[1]), out)
    return out


@dataclass
class Cusum(PerJoint):
    """Two-sided CUSUM of every joint's residual in units of its envelope; the largest counts.

    The statistic grows by (|ratio| - drift) dt while the ratio keeps its sign, falls otherwise,
    and stays between 0 and a bound; the score is in seconds times the drift. The residual of free
    motion is not white (friction errors last), so the drift is the limit that free motion exceeds
    in one sample of a hundred, not the half of a shift that white noise would ask for.
    """

    name: ClassVar[str] = "cusum"
    share: ClassVar[float] = 0.99

    def deviation(self, trace: Trace, estimate: Estimate) -> Array:
        """The residual over its envelope."""
        return self.front.ratio(trace, estimate)

    def scores(self, trace: Trace) -> Array:
        """The largest statistic over joints and signs, in units of its drift [s], shape (T,)."""
        ratio = self.front.ratio(trace).copy()
        assert self.limits is not None
        ratio[trace.t - trace.t[0] < self.settle] = 0.0
        both = np.concatenate([ratio, -ratio], axis=1)
        drift = np.concatenate([self.limits, self.limits])
        level = bounded_cusum((both - drift) * self.front.dt, drift * RECOVERY)
        score: Array = (level / drift).max(axis=1)
        return score
