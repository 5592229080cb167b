"""What the learned rankings share: windows of the scaled residual, mined negatives, one output."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.detectors import _observer
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.estimation.noise_model import NoiseModel
from tauguard.detectors.events import CONFIRMATION, free_rows, undisturbed_rows
from tauguard.detectors.features.front_end import (
    FrontEnd,
    FrontEndSettings,
    NativeStream,
    OnFrontEnd,
    Scaling,
)
from tauguard.detectors.features.windows import (
    FELT,
    Prepared,
    WindowShape,
    binary_target,
    draw_windows,
    peaks,
    severity,
    severity_targets,
)
from tauguard.detectors.scores.baselines import FittedThresholds, MovingThresholds
from tauguard.detectors.scores.kernel import KernelMachine
from tauguard.traces.trace import Trace

#: Fraction of the collision-free samples that may exceed the unit.
RARE = 1e-3

#: Windows that are evaluated at once: memory stays small.
CHUNK = 20_000


class Regressor(Protocol):
    """A fitted function of windows."""

    def __call__(self, x: Array) -> Array:
        """Values at the rows of x, shape (N, d) -> (N,); each depends on its row alone."""


@dataclass(frozen=True)
class Windowed(ABC):
    """Settings of a regressor on windows of the residual in standard deviations of free motion,
    compressed by asinh.

    Training windows are drawn from collisions and from collision-free motion; then, twice, the
    collision-free moments that score highest are added as negatives.
    """

    windows: int = 20_000  #: training windows, a fifth of them from collisions
    mined: int = 2_000  #: collision-free moments added in each of two rounds
    units: float = 5.0  #: standard deviations that make 1 before the asinh
    seed: int = 0
    graded: bool = True  #: targets grow with the torque, and scores are severities; else 0 and 1
    front: FrontEndSettings = field(default_factory=FrontEndSettings)
    name: ClassVar[str] = "windowed"
    floored: ClassVar[bool] = False  #: whether plain thresholds lie beneath the score
    mining_gap: ClassVar[float] = 0.05  #: between two mined moments [s]
    stream_of_seeds: ClassVar[int] = 3  #: that the windows are drawn from

    @abstractmethod
    def learn(self, x: Array, y: Array) -> Regressor:
        """Fit the regressor on windows (N, size) and targets (N,)."""

    def fit(self, traces: Sequence[Trace], arm: ArmModel) -> FittedWindowed:
        """Calibrate, draw windows, learn, mine, learn.

        Raises:
            ValueError: traces that do not fit, or without collisions or collision-free motion.
        """
        front = self.front.fit(traces, arm)
        shape = WindowShape.at(front.dt, confirmation=CONFIRMATION)
        targets = self.targets(traces, front)
        scaling = self.scaling(traces, targets, front, shape)
        prepared = self.prepared(traces, targets, front, scaling)
        x, y = self.draw(np.random.default_rng([self.seed, self.stream_of_seeds]), prepared, shape)
        regressor = self.learn(x, y)
        for _ in range(2 if self.mined else 0):
            hardest = self._mine(prepared, shape, regressor, front.dt)
            x, y = np.concatenate([x, hardest]), np.concatenate([y, np.zeros(len(hardest))])
            regressor = self.learn(x, y)
        finished = self.finished(regressor)
        limits = MovingThresholds(self.front).fit(traces, arm).limits if self.floored else None
        return FittedWindowed(self.name, front, scaling, shape, finished, self.graded, limits)

    def targets(self, traces: Sequence[Trace], front: FrontEnd) -> list[Array]:
        """The regressor's targets for each trace, shape (T,)."""
        if self.graded:
            return severity_targets(traces, front.joints, front.gain)
        return [binary_target(trace) for trace in traces]

    def scaling(
        self,
        traces: Sequence[Trace],
        targets: Sequence[Array],
        front: FrontEnd,
        shape: WindowShape,
    ) -> Scaling:
        """How the residual is scaled."""
        return self.bare(traces, front)

    def bare(self, traces: Sequence[Trace], front: FrontEnd) -> Scaling:
        """The residual in ``units`` deviations, or more for a joint whose peaks are higher.

        With dry friction the residual of free motion is small except at starts and reversals, where
        it peaks at dozens of standard deviations. Those peaks must stay in the linear range of the
        asinh, or they come near to collisions.
        """
        plain = front.scaling(self.units)
        rows = undisturbed_rows(traces, front.settle)
        free = [np.abs(front.scaled(t, plain)[r]) for t, r in zip(traces, rows, strict=True)]
        most = np.quantile(np.concatenate(free), 1 - RARE, axis=0)
        return replace(plain, noise_model=_widened(plain, np.maximum(most, 1.0)), compress=True)

    def finished(self, regressor: Regressor) -> Regressor:
        """What is kept of the last regressor."""
        return regressor

    @staticmethod
    def prepared(
        traces: Sequence[Trace], targets: Sequence[Array], front: FrontEnd, scaling: Scaling
    ) -> list[Prepared]:
        """Training traces with their targets, and the rows that are free or surely in collision."""
        return [
            Prepared(
                front.scaled(trace, scaling),
                target,
                free_rows(trace, front.settle),
                (target > FELT) & (trace.t >= trace.t[0] + front.settle),
            )
            for trace, target in zip(traces, targets, strict=True)
        ]

    def draw(
        self, rng: np.random.Generator, prepared: Sequence[Prepared], shape: WindowShape
    ) -> tuple[Array, Array]:
        """Training windows and their targets."""
        return draw_windows(rng, prepared, shape, self.windows)

    def _mine(
        self, prepared: Sequence[Prepared], shape: WindowShape, regressor: Regressor, dt: float
    ) -> Array:
        """The collision-free moments with the highest output, as many from every trace."""
        fraction = -(-self.mined // len(prepared))
        thin = max(1, shape.lag // 2)
        gap = max(1, round(self.mining_gap / dt) // thin)
        found = []
        for p in prepared:
            rows = np.flatnonzero(p.free)[::thin]
            if len(rows):
                worst = peaks(evaluated(regressor, p.signal, shape, rows), fraction, gap)
                found.append(shape.of(p.signal, rows[worst]))
        return np.concatenate(found)


def _widened(scaling: Scaling, factors: Array) -> NoiseModel:
    """The noise model with that of the scaled joints times ``factors``."""
    assert scaling.noise_model is not None
    weights = scaling.noise_model.weights.copy()
    weights[list(scaling.joints)] *= factors[:, None]
    return NoiseModel(weights)


def evaluated(
    regressor: Regressor, signal: Array, shape: WindowShape, rows: NDArray[np.intp]
) -> Array:
    """The regressor at the windows that end at ``rows``, shape (len(rows),)."""
    out = np.empty(len(rows))
    for begin in range(0, len(rows), CHUNK):
        part = rows[begin : begin + CHUNK]
        out[begin : begin + CHUNK] = regressor(shape.of(signal, part))
    return out


@dataclass(frozen=True, eq=False)
class FittedWindowed(OnFrontEnd):
    """A fitted regressor on windows: a :class:`~tauguard.detectors.detector.FittedDetector`."""

    name: str
    front: FrontEnd
    scaling: Scaling
    shape: WindowShape
    regressor: Regressor
    graded: bool  #: the regressor says x / (1 + x), and the score is x
    limits: Array | None = None
    """Of :attr:`floor`, shape (joints,); ``None``: there is none."""

    @property
    def floor(self) -> FittedThresholds | None:
        """Plain thresholds on the same residual: a residual above them is an alarm too.

        A kernel machine has them: its native stream gives their score beside its own.
        """
        if self.limits is None or not isinstance(self.regressor, KernelMachine):
            return None
        return FittedThresholds(
            self.front, self.front.scaling(), self.limits, MovingThresholds.name
        )

    def scores(self, trace: Trace) -> Array:
        """Output of the regressor or its :func:`severity`, shape (T,)."""
        signal = self.front.scaled(trace, self.scaling)
        output = evaluated(self.regressor, signal, self.shape, np.arange(len(signal)))
        return severity(output) if self.graded else output

    def stream(self) -> NativeStream | WindowStream:
        """The same, sample by sample; of a kernel machine all of it is native."""
        machine, floor = self.regressor, self.floor
        if not isinstance(machine, KernelMachine):
            return WindowStream(self)
        vectors, weights = map(np.ascontiguousarray, (machine.vectors, machine.weights))
        scores = _observer.kernel_scores(
            self.front.estimator().native,
            *self.scaling.numbers,
            self.shape.lag,
            self.shape.count,
            vectors,
            weights,
            machine.intercept,
            machine.sigma,
            self.graded,
            [] if floor is None else floor.scaling.numbers[1],
            [] if floor is None else floor.limits.tolist(),
        )
        return NativeStream(scores, self.dt)


class WindowStream:
    """Residual, window and regressor, sample by sample."""

    def __init__(self, detector: FittedWindowed) -> None:
        """Begin anew."""
        joints, shape = len(detector.scaling.joints), detector.shape
        self._residual = detector.front.stream(detector.scaling)
        self._window, self._regressor = shape.stream(joints), detector.regressor
        self._graded = detector.graded
        self._x = np.zeros((1, joints * shape.count))

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> float:
        """The score of this sample."""
        self._window.step(self._residual.step(q, qd, current, dt), self._x)
        output = self._regressor(self._x)
        return float((severity(output) if self._graded else output)[0])
