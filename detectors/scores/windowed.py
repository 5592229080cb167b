"""Support vector regression with the SRQ kernel on windows of the scaled residual."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.detectors import _observer
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.estimation.noise_model import NoiseModel
from tauguard.detectors.events import free_rows, undisturbed_rows
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
    median_distance,
    peaks,
    severity,
    severity_targets,
)
from tauguard.detectors.scores.baselines import FittedThresholds, MovingThresholds
from tauguard.detectors.scores.kernel import KernelMachine, SrqRegressor
from tauguard.traces.trace import Trace

#: Fraction of the collision-free samples that may exceed the unit.
RARE = 1e-3

#: Windows that the scale of the features is found with.
SAMPLED = 1000

#: Between two mined moments [s].
MINING_GAP = 0.1

#: Windows that are evaluated at once: memory stays small.
CHUNK = 20_000


@dataclass(frozen=True)
class SrqSvr:
    """The dissertation's regressor on the residual in standard deviations of free motion,
    compressed by asinh.

    Training windows are drawn from collisions and from collision-free motion; then, twice, the
    collision-free moments that score highest are added as negatives. One factor brings the median
    distance between windows of collisions and of collision-free motion to ``distance``, a length
    that the kernel resolves. Beneath the score lie the thresholds of ``moving-thresholds``: they
    find what is far from anything that the regressor has seen.
    """

    windows: int = 3000  #: training windows, a fifth of them from collisions
    mined: int = 300  #: collision-free moments added in each of two rounds
    units: float = 5.0  #: standard deviations that make 1 before the asinh
    seed: int = 0
    graded: bool = True  #: targets grow with the torque, and scores are severities; else 0 and 1
    front: FrontEndSettings = field(default_factory=FrontEndSettings)
    sigma: float = 3.0  #: of the SRQ kernel
    C: float = 1.0
    epsilon: float = 0.02
    distance: float = 2.0  #: median distance after scaling; 0 leaves the windows as they are
    vectors: int = 400  #: support vectors that are kept, at most; 0 keeps all
    name: ClassVar[str] = "srq-svr"
    floored: ClassVar[bool] = True  #: whether plain thresholds lie beneath the score

    def fit(self, traces: Sequence[Trace], arm: ArmModel) -> FittedWindowed:
        """Calibrate, draw windows, learn, mine, learn.

        Raises:
            ValueError: traces that do not fit, or without collisions or collision-free motion.
        """
        front = self.front.fit(traces, arm)
        shape = WindowShape.at(front.dt)
        targets = self.targets(traces, front)
        scaling = self.scaling(traces, targets, front, shape)
        prepared = self.prepared(traces, targets, front, scaling)
        x, y = draw_windows(np.random.default_rng([self.seed, 1]), prepared, shape, self.windows)
        machine = self.learn(x, y)
        for _ in range(2 if self.mined else 0):
            hardest = self._mine(prepared, shape, machine, front.dt)
            x, y = np.concatenate([x, hardest]), np.concatenate([y, np.zeros(len(hardest))])
            machine = self.learn(x, y)
        if 0 < self.vectors < len(machine.vectors):
            machine = machine.reduced(self.vectors)
        limits = MovingThresholds(self.front).fit(traces, arm).limits if self.floored else None
        return FittedWindowed(self.name, front, scaling, shape, machine, self.graded, limits)

    def learn(self, x: Array, y: Array) -> KernelMachine:
        """Epsilon-SVR on windows (N, size) and targets (N,)."""
        return SrqRegressor(self.sigma, self.C, self.epsilon).fit(x, y).machine_

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
        """Bring the median distance of windows to ``distance``."""
        bare = self.bare(traces, front)
        if self.distance <= 0:
            return bare
        rng = np.random.default_rng(self.seed)
        prepared = self.prepared(traces, targets, front, bare)
        windows, target = draw_windows(rng, prepared, shape, SAMPLED)
        spread = median_distance(windows[target > 0], windows[target == 0], rng)
        return replace(bare, factor=self.distance / spread if spread > 0 else 1.0)

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

    def _mine(
        self, prepared: Sequence[Prepared], shape: WindowShape, machine: KernelMachine, dt: float
    ) -> Array:
        """The collision-free moments with the highest output, as many from every trace."""
        fraction = -(-self.mined // len(prepared))
        thin = max(1, shape.lag // 2)
        gap = max(1, round(MINING_GAP / dt) // thin)
        found = []
        for p in prepared:
            rows = np.flatnonzero(p.free)[::thin]
            if len(rows):
                worst = peaks(evaluated(machine, p.signal, shape, rows), fraction, gap)
                found.append(shape.of(p.signal, rows[worst]))
        return np.concatenate(found)


def _widened(scaling: Scaling, factors: Array) -> NoiseModel:
    """The noise model with that of the scaled joints times ``factors``."""
    assert scaling.noise_model is not None
    weights = scaling.noise_model.weights.copy()
    weights[list(scaling.joints)] *= factors[:, None]
    return NoiseModel(weights)


def evaluated(
    machine: KernelMachine, signal: Array, shape: WindowShape, rows: NDArray[np.intp]
) -> Array:
    """The kernel machine at the windows that end at ``rows``, shape (len(rows),)."""
    out = np.empty(len(rows))
    for begin in range(0, len(rows), CHUNK):
        part = rows[begin : begin + CHUNK]
        out[begin : begin + CHUNK] = machine(shape.of(signal, part))
    return out


@dataclass(frozen=True, eq=False)
class FittedWindowed(OnFrontEnd):
    """A fitted regressor on windows, a ``FittedDetector``."""

    name: str
    front: FrontEnd
    scaling: Scaling
    shape: WindowShape
    regressor: KernelMachine
    graded: bool  #: the regressor says x / (1 + x), and the score is x
    limits: Array | None = None
    """Of :attr:`floor`, shape (joints,); ``None``: there is none."""

    @property
    def floor(self) -> FittedThresholds | None:
        """Plain thresholds on the same residual: a residual above them is an alarm too."""
        if self.limits is None:
            return None
        return FittedThresholds(
            self.front, self.front.scaling(), self.limits, MovingThresholds.name
        )

    def scores(self, trace: Trace) -> Array:
        """Output of the regressor or its :func:`severity`, shape (T,)."""
        signal = self.front.scaled(trace, self.scaling)
        output = evaluated(self.regressor, signal, self.shape, np.arange(len(signal)))
        return severity(output) if self.graded else output

    def stream(self) -> NativeStream:
        """The same, sample by sample."""
        machine, floor = self.regressor, self.floor
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


@dataclass(frozen=True)
class PlainSrqSvr(SrqSvr):
    """The dissertation's form: residuals in N m times one factor, labels 0/1, no friction model.

    Residuals in N m lie some 100 apart, where a kernel of sigma = 3 is diagonal and nothing is
    learnt; the factor brings the median distance to sigma. ``distance=0`` is the literal form.
    """

    mined: int = 0
    distance: float = 3.0
    vectors: int = 0
    graded: bool = False
    front: FrontEndSettings = field(
        default_factory=lambda: FrontEndSettings(adapt=False, settle=0.5, calibrate=False)
    )
    name: ClassVar[str] = "srq-svr-plain"
    floored: ClassVar[bool] = False

    def bare(self, traces: Sequence[Trace], front: FrontEnd) -> Scaling:
        """Residuals in N m."""
        return Scaling(front.joints)
