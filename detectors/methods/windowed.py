"""What the learned rankings share: windows of the scaled residual, mined negatives, one output."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.calibration.calibrate import free_rows
from tauguard.detectors.estimation.estimator import ArmModel, Estimate
from tauguard.detectors.features.front_end import FrontEnd, OnFrontEnd
from tauguard.detectors.features.training import Prepared, draw_windows, peaks, severity_target
from tauguard.detectors.features.windows import Features, WindowShape
from tauguard.detectors.thresholds.confirmation import CONFIRMATION
from tauguard.traces.trace import Trace

Array = NDArray[np.float64]

#: Torque that counts 1 in the training target, one a joint; the last is repeated [N m].
REFERENCE = (20.0, 20.0, 15.0, 6.0)
#: Windows that are judged at once: memory stays small.
CHUNK = 20_000


@dataclass
class Windowed(OnFrontEnd, ABC):
    """A regressor on windows of the residual over its envelope, compressed by asinh.

    Training windows are drawn from collisions and from free motion; then, twice, the free moments
    that score highest are added as negatives.
    """

    windows: int = 20_000  #: training windows, a fifth of them from collisions
    mined: int = 2_000  #: free moments added in each of two rounds
    units: float = 5.0  #: envelopes that count one before the asinh
    seed: int = 0
    features: Features | None = None
    name: ClassVar[str] = "windowed"

    @abstractmethod
    def _learn(self, x: Array, y: Array) -> None:
        """Fit the regressor on windows (N, size) and targets (N,)."""

    @abstractmethod
    def _predict(self, x: Array) -> Array:
        """Its output at windows (N, size), shape (N,)."""

    def fit(self, traces: Sequence[Trace], robot: ArmModel) -> Windowed:
        """Calibrate, draw windows, learn, mine, learn."""
        estimates = self.front.fit(traces, robot)
        joints = tuple(range(min(self.front.joints, robot.robot.joints)))
        shape = WindowShape.at(self.front.dt, confirmation=CONFIRMATION)
        self.features = Features(
            joints, shape, self.front.envelope, 1.0, self.units, True, (shape.note,)
        )
        prepared = [self._prepare(t, e) for t, e in zip(traces, estimates, strict=True)]
        x, y = self._draw(prepared)
        self._learn(x, y)
        for _ in range(2 if self.mined else 0):
            hardest = self._mine(prepared)
            x, y = np.concatenate([x, hardest]), np.concatenate([y, np.zeros(len(hardest))])
            self._learn(x, y)
        return self

    def _prepare(self, trace: Trace, estimate: Estimate) -> Prepared:
        assert self.features is not None
        joints = self.features.joints
        signal = self.features.signal(estimate.left, trace.qd, estimate.acceleration)
        own = np.array([REFERENCE[min(j, len(REFERENCE) - 1)] for j in joints])
        target = severity_target(trace, joints, own, self.front.gain)
        settled = trace.t >= trace.t[0] + self.settle
        free = free_rows(trace, self.settle)
        return Prepared(signal, target, free, (target > 0.05) & settled)

    def _draw(self, prepared: Sequence[Prepared]) -> tuple[Array, Array]:
        assert self.features is not None
        rng = np.random.default_rng([self.seed, 3])
        return draw_windows(rng, prepared, self.features, self.windows)

    def _mine(self, prepared: Sequence[Prepared]) -> Array:
        """The free moments with the highest output now, an equal number from every trace."""
        assert self.features is not None
        share = -(-self.mined // len(prepared))
        thin = max(1, self.features.shape.lag // 2)
        gap = max(1, round(0.05 / self.front.dt) // thin)
        found = []
        for p in prepared:
            rows = np.flatnonzero(p.free)[::thin]
            if len(rows):
                worst = peaks(self._rows(p.signal, rows), share, gap)
                found.append(self.features.windows(p.signal, rows[worst]))
        return np.concatenate(found)

    def _rows(self, signal: Array, rows: NDArray[np.intp]) -> Array:
        assert self.features is not None
        out = np.empty(len(rows))
        for begin in range(0, len(rows), CHUNK):
            part = rows[begin : begin + CHUNK]
            out[begin : begin + CHUNK] = self._predict(self.features.windows(signal, part))
        return out

    def scores(self, trace: Trace) -> Array:
        """Output of the regressor, shape (T,)."""
        if self.features is None:
            raise ValueError("this detector is not fitted: call fit or load a model file first")
        ratio = self.front.ratio(trace)
        signal = np.ascontiguousarray(self.features.factor * np.arcsinh(ratio / self.units))
        return self._rows(signal, np.arange(len(signal)))

    def parts(self) -> dict[str, Any]:
        """What a model file keeps."""
        return {"front": self.front.parts(), "units": self.units, **self._own_parts()}

    @abstractmethod
    def _own_parts(self) -> dict[str, Any]:
        """The regressor's share of :meth:`parts`."""

    @abstractmethod
    def _restore(self, parts: dict[str, Any]) -> None:
        """Take up what :meth:`_own_parts` gave."""

    @classmethod
    def from_parts(cls, parts: dict[str, Any]) -> Windowed:
        """The detector again from :meth:`parts`."""
        front = FrontEnd.from_parts(parts["front"])
        detector = cls(front, units=float(parts["units"]))
        arm, envelope = front.fitted()
        joints = tuple(range(min(front.joints, arm.robot.joints)))
        shape = WindowShape.at(front.dt, confirmation=CONFIRMATION)
        detector.features = Features(
            joints, shape, envelope, 1.0, detector.units, True, (shape.note,)
        )
        detector._restore(parts)
        return detector
