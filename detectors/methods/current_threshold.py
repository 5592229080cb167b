"""A time-varying threshold on the motor currents alone: no robot model, no joint positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.signal import lfilter

from tauguard.detectors.calibration.calibrate import free_rows
from tauguard.detectors.detector import check_trace, common_interval
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.model_parts import arm_from_parts, arm_parts
from tauguard.traces.trace import Trace

Array = NDArray[np.float64]


def smoothed(x: Array, rate: float, dt: float) -> Array:
    """First-order low-pass of rate ``rate`` [1/s] along the rows, from the first row's value."""
    keep = float(np.exp(-rate * dt))
    filtered: Array = lfilter([1 - keep], [1, -keep], x - x[:1], axis=0) + x[:1]
    return filtered


@dataclass
class CurrentThreshold:
    """What of each current is fast, against a threshold that follows how lively it has been.

    The fast part is current less its low-pass at ``slow``; the threshold of a joint is
    a + b level + c total, with the low-pass of its own |fast part| and of the sum over all joints
    at ``follow``. The weights are fitted to free motion. The score is the largest ratio of fast
    part to threshold over the joints.
    """

    slow: float = 20.0  #: [1/s]
    follow: float = 4.0  #: [1/s]
    settle: float = 1.0  #: [s]
    weights: Array | None = None  #: a [A], b, c of each joint, shape (n, 3)
    dt: float = 1e-3
    known: ArmModel | None = None  #: as given; nothing of it is used
    name: str = "current-threshold"

    @property
    def arm(self) -> ArmModel:
        """The arm as it was given."""
        if self.known is None:
            raise ValueError("this detector is not fitted: call fit or load a model file first")
        return self.known

    def fit(self, traces: Sequence[Trace], robot: ArmModel) -> CurrentThreshold:
        """Fit the threshold's weights to the collision-free rows."""
        self.dt, self.known = common_interval(traces, robot), robot
        fast, columns = [], []
        for trace in traces:
            rows = np.flatnonzero(free_rows(trace, self.settle))[::5]
            own, table = self._columns(trace.current)
            fast.append(np.abs(own[rows]))
            columns.append(table[rows])
        size, table = np.concatenate(fast), np.concatenate(columns)
        if not len(size):
            raise ValueError("no collision-free motion in the traces")
        self.weights = np.array([nnls(table[:, j], size[:, j])[0] for j in range(size.shape[1])])
        floor = np.maximum(0.1 * size.mean(axis=0), 1e-9)
        self.weights[:, 0] = np.maximum(self.weights[:, 0], floor)
        return self

    def _columns(self, current: Array) -> tuple[Array, Array]:
        """The fast part, shape (T, n), and the columns of the threshold, shape (T, n, 3)."""
        fast = current - smoothed(current, self.slow, self.dt)
        # One sample late: a blow must not raise the threshold that it is held against.
        size = np.abs(np.concatenate([fast[:1], fast[:-1]]))
        level = smoothed(size, self.follow, self.dt)
        total = np.broadcast_to(level.sum(axis=1, keepdims=True), level.shape)
        return fast, np.stack([np.ones_like(level), level, total], axis=-1)

    def scores(self, trace: Trace) -> Array:
        """The largest ratio over the joints, shape (T,)."""
        if self.weights is None:
            raise ValueError("this detector is not fitted: call fit or load a model file first")
        check_trace(trace, len(self.weights), self.dt)
        fast, table = self._columns(trace.current)
        score: Array = (np.abs(fast) / np.einsum("tjc,jc->tj", table, self.weights)).max(axis=1)
        return score

    def parts(self) -> dict[str, Any]:
        """What a model file keeps."""
        return {
            "slow": self.slow,
            "follow": self.follow,
            "settle": self.settle,
            "dt": self.dt,
            "weights": self.weights,
            "arm": arm_parts(self.arm),
        }

    @classmethod
    def from_parts(cls, parts: dict[str, Any]) -> CurrentThreshold:
        """The detector again from :meth:`parts`."""
        slow, follow, settle, dt = (float(parts[k]) for k in ("slow", "follow", "settle", "dt"))
        weights, known = np.asarray(parts["weights"]), arm_from_parts(parts["arm"])
        return cls(slow, follow, settle, weights, dt, known)
