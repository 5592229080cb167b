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

#: Fraction of the collision-free samples whose scaled residual may exceed 1.
RARE = 1e-3
#: Number of windows from which the scale of the features is computed.
SAMPLED = 1000
#: Least time between two collision-free windows that are added as negatives [s].
MINING_GAP = 0.1
#: Number of windows that are evaluated at once, to limit the memory.
CHUNK = 20_000


@dataclass(frozen=True)
class SrqSvr:
    """The dissertation's regressor, on residuals in standard deviations compressed by asinh.

    Training windows are drawn from collisions and from collision-free motion. Then, in two rounds,
    the collision-free windows with the highest scores are added as negatives. The windows are
    scaled so that the median distance between windows of collisions and of collision-free motion is
    ``distance``, which the kernel resolves. The thresholds of ``moving-thresholds`` raise alarms
    in addition, because they detect residuals unlike all training windows.
    """

    windows: int = 3000  #: number of training windows, a fifth of them from collisions
    mined: int = 300  #: number of collision-free windows added in each of the two rounds
    units: float = 5.0  #: number of standard deviations with the value 1 before the asinh
    seed: int = 0
    graded: bool = True  #: scores are severities; False: training labels are 0 and 1
    front: FrontEndSettings = field(default_factory=FrontEndSettings)
    sigma: float = 3.0  #: of the SRQ kernel
    C: float = 1.0
    epsilon: float = 0.02
    distance: float = 2.0  #: median distance after scaling; 0 leaves the windows as they are
    vectors: int = 400  #: largest number of support vectors; 0 keeps all
    name: ClassVar[str] = "srq-svr"
    floored: ClassVar[bool] = True  #: whether thresholds on the residual can raise alarms, too

    def fit(self, traces: Sequence[Trace], arm: ArmModel) -> FittedWindowed:
        """Calibrate, draw windows, and train, with two rounds of added negatives.

        Raises:
            ValueError: traces of different arms or rates, or without collisions or collision-free
                motion.
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
        """The scaling with which the median distance of windows is ``distance``."""
        bare = self.initial_scaling(traces, front)
        if self.distance <= 0:
            return bare
        rng = np.random.default_rng(self.seed)
        prepared = self.prepared(traces, targets, front, bare)
        windows, target = draw_windows(rng, prepared, shape, SAMPLED)
        spread = median_distance(windows[target > 0], windows[target == 0], rng)
        return replace(bare, factor=self.distance / spread if spread > 0 else 1.0)

    def initial_scaling(self, traces: Sequence[Trace], front: FrontEnd) -> Scaling:
        """The residual divided by ``units`` standard deviations, or by more if its peaks are high.

        With dry friction, the residual of free motion is small except at starts and reversals, with
        peaks of dozens of standard deviations. These peaks have to stay in the linear range of the
        asinh, so that they differ from collisions.
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
        """Training traces with targets, and rows that are certainly free or in collision."""
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
        """The collision-free windows with the highest output, the same number of each trace."""
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
    """The noise model of ``scaling``, multiplied by ``factors`` for its joints."""
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
    """A fitted regressor on windows, a ``FittedMethod``."""

    name: str
    front: FrontEnd
    scaling: Scaling
    shape: WindowShape
    regressor: KernelMachine
    graded: bool  #: the regressor's output is x / (1 + x), and the score is x
    limits: Array | None = None
    """Limits of :attr:`floor`, shape (joints,). ``None``: no floor."""

    @property
    def floor(self) -> FittedThresholds | None:
        """Thresholds on the same residual: they or the score can raise an alarm."""
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
        """A new stream of the scores, sample by sample."""
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
    """The dissertation's form: residuals in N m times a factor, labels 0/1, no friction model.

    Residuals in N m have distances near 100, at which the matrix of a kernel of sigma = 3 is almost
    diagonal and nothing is learned. The factor scales the median distance to ``distance``.
    ``distance=0`` is the literal form of the dissertation, without the factor.
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

    def initial_scaling(self, traces: Sequence[Trace], front: FrontEnd) -> Scaling:
        """Residuals in N m."""
        return Scaling(front.joints)
