"""A time-varying threshold on the motor currents alone: no robot model, no joint positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.optimize import nnls

from tauguard.arrays import Array
from tauguard.detectors.detector import check_trace, common_interval
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.evaluation.events import free_rows
from tauguard.detectors.features.low_pass import LowPass, smoothed
from tauguard.traces.trace import Trace


@dataclass(frozen=True)
class CurrentThreshold:
    """The fast part of each current, against a threshold that follows how large it has been.

    The fast part is the current less its low-pass at ``slow``; the threshold of a joint is
    a + b level + c total, with the low-pass of its own |fast part| and of the sum over all joints
    at ``follow``. The weights are fitted to collision-free motion. The score is the largest ratio
    of fast part to threshold over the joints.
    """

    slow: float = 20.0  #: [1/s]
    follow: float = 4.0  #: [1/s]
    settle: float = 1.0  #: [s]
    name: ClassVar[str] = "current-threshold"

    def fit(self, traces: Sequence[Trace], arm: ArmModel) -> FittedCurrentThreshold:
        """Fit the threshold's weights to the collision-free rows.

        Raises:
            ValueError: traces that do not fit, or without collision-free motion.
        """
        dt = common_interval(traces, arm)
        fast, levels = [], []
        for trace in traces:
            rows = np.flatnonzero(free_rows(trace, self.settle))[::5]
            own, level = _parts(trace.current, self.slow, self.follow, dt)
            fast.append(np.abs(own[rows]))
            levels.append(level[rows])
        size, level = np.concatenate(fast), np.concatenate(levels)
        if not len(size):
            raise ValueError("no collision-free motion in the traces")
        total = level.sum(axis=1)
        table = [np.column_stack([np.ones_like(total), own, total]) for own in level.T]
        weights = np.array([nnls(a, b)[0] for a, b in zip(table, size.T, strict=True)])
        floor = np.maximum(0.1 * size.mean(axis=0), 1e-9)
        weights[:, 0] = np.maximum(weights[:, 0], floor)
        return FittedCurrentThreshold(arm, dt, self.settle, self.slow, self.follow, weights)


def _parts(current: Array, slow: float, follow: float, dt: float) -> tuple[Array, Array]:
    """The fast part, and how large it was up to the sample before, shape (T, n) each."""
    fast = current - smoothed(current, slow, dt)
    # One sample late: a blow must not raise the threshold that it is compared with.
    size = np.abs(np.concatenate([fast[:1], fast[:-1]]))
    return fast, smoothed(size, follow, dt)


@dataclass(frozen=True, eq=False)
class FittedCurrentThreshold:
    """A :class:`~tauguard.detectors.detector.FittedDetector`."""

    arm: ArmModel  #: as it was given: nothing of it is used
    dt: float  #: [s]
    settle: float  #: [s]
    slow: float  #: [1/s]
    follow: float  #: [1/s]
    weights: Array  #: a [A], b, c of each joint, shape (n, 3)
    name: ClassVar[str] = "current-threshold"

    def __post_init__(self) -> None:
        """Check: ``ValueError``."""
        if self.weights.shape != (self.arm.robot.joints, 3) or not (self.weights[:, 0] > 0).all():
            raise ValueError("weights: expected three a joint, the first above 0")

    def scores(self, trace: Trace) -> Array:
        """The largest ratio over the joints, shape (T,)."""
        check_trace(trace, len(self.weights), self.dt)
        return self._score(*_parts(trace.current, self.slow, self.follow, self.dt))

    def _score(self, fast: Array, level: Array) -> Array:
        a, b, c = self.weights.T
        score: Array = (np.abs(fast) / (a + b * level + c * level.sum(axis=1, keepdims=True))).max(
            axis=1
        )
        return score

    def stream(self) -> CurrentThresholdStream:
        """The same, sample by sample."""
        return CurrentThresholdStream(self)


class CurrentThresholdStream:
    """Sample by sample."""

    def __init__(self, detector: FittedCurrentThreshold) -> None:
        """Begin anew."""
        self._detector = detector
        self._slow = LowPass(detector.slow, detector.dt)
        self._follow = LowPass(detector.follow, detector.dt)
        self._size: Array | None = None

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> float:
        """The score of this sample; the currents alone count."""
        fast = current - self._slow.step(current)
        level = self._follow.step(np.abs(fast) if self._size is None else self._size)
        self._size = np.abs(fast)
        return float(self._detector._score(fast[None], level[None])[0])
