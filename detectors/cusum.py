"""CUSUM (Page 1954): small deviations that last count as much as large ones that are short."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.detectors.calibrate import free_rows
from tauguard.detectors.estimator import ArmModel
from tauguard.detectors.front_end import FrontEnd
from tauguard.traces.trace import Trace

Array = NDArray[np.float64]


def cusum(increments: ArrayLike) -> Array:
    """g_k = max(0, g_{k-1} + x_k), g_{-1} = 0, along the first axis.

    Computed as S - min(0, min S) over the running sum S, which is the same number.

    Args:
        increments: shape (T, ...).
    """
    total = np.cumsum(np.asarray(increments, dtype=np.float64), axis=0)
    lowest = np.minimum(np.minimum.accumulate(total, axis=0), 0.0)
    above: Array = total - lowest
    return above


@dataclass
class Cusum:
    """Two-sided CUSUM of every joint's residual in units of its envelope; the largest counts.

    The statistic grows by (|ratio| - drift) dt while the ratio keeps its sign and falls to zero
    otherwise; it is measured in envelope seconds. Below the drift nothing accumulates: the residual
    of free motion is not white (friction errors last), so the drift is what free motion exceeds in
    one sample of a hundred, not the half of a shift that white noise would ask for.
    """

    front: FrontEnd = field(default_factory=FrontEnd)
    drift: Array | None = None  #: ratio that does not count yet, shape (joints,)
    name: str = "cusum"

    @property
    def settle(self) -> float:
        """Seconds at the beginning of a trace whose scores mean nothing yet."""
        return self.front.settle

    @property
    def arm(self) -> ArmModel:
        """The calibrated arm."""
        return self.front.fitted()[0]

    def fit(self, traces: Sequence[Trace], robot: ArmModel) -> Cusum:
        """Calibrate the arm, fit the envelope and take each joint's drift."""
        estimates = self.front.fit(traces, robot)
        free = [
            np.abs(self.front.ratio(t, e)[free_rows(t, self.settle)])
            for t, e in zip(traces, estimates, strict=True)
        ]
        self.drift = np.maximum(np.quantile(np.concatenate(free), 0.99, axis=0), 1e-9)
        return self

    def scores(self, trace: Trace) -> Array:
        """The largest statistic over joints and signs, in envelope seconds, shape (T,)."""
        ratio = self.front.ratio(trace)
        assert self.drift is not None
        ratio[trace.t - trace.t[0] < self.settle] = 0.0
        up, down = cusum(ratio - self.drift), cusum(-ratio - self.drift)
        score: Array = np.maximum(up, down).max(axis=1) * self.front.dt
        return score

    def parts(self) -> dict[str, Any]:
        """What a model file keeps."""
        return {"front": self.front.parts(), "drift": self.drift}

    @classmethod
    def from_parts(cls, parts: dict[str, Any]) -> Cusum:
        """The detector again from :meth:`parts`."""
        return cls(FrontEnd.from_parts(parts["front"]), np.asarray(parts["drift"]))
