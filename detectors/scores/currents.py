"""A network that predicts motor currents from the motion; the score is its largest error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.events import free_rows
from tauguard.detectors.frozen import Frozen
from tauguard.detectors.samples import check_trace, common_interval
from tauguard.detectors.scores.network import Network
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace


def smoothed(x: Array, rate: float, dt: float) -> Array:
    """Low-pass of rate ``rate`` [1/s] over the rows of x, initially the first row."""
    from scipy.signal import lfilter

    keep = float(np.exp(-rate * dt))
    filtered: Array = lfilter([1 - keep], [1, -keep], x - x[:1], axis=0) + x[:1]
    return filtered


class LowPass:
    """:func:`smoothed`, sample by sample, with equal results."""

    def __init__(self, rate: float, dt: float) -> None:
        """Set rate [1/s] and sample interval [s]."""
        self._keep = float(np.exp(-rate * dt))
        self._first: Array | None = None
        self._state: Array | float = 0.0

    def step(self, x: Array) -> Array:
        """The filtered value at this sample, shape as x."""
        if self._first is None:
            self._first = x.copy()
        self._state = self._keep * self._state + (1 - self._keep) * (x - self._first)
        return self._state + self._first


#: Rate of the filter that differentiates the velocity [1/s].
DERIVATIVE = 100.0

#: Speed over which friction changes its sign [rad/s].
REVERSAL = 0.02

#: Addition to the sum of |acceleration| in the drawing of samples, so that samples at rest are
#: drawn, too [rad/s^2].
STILL = 0.5


class Sample(NamedTuple):
    """Signals of some samples, shape (N, n) each."""

    q: Array
    qd: Array
    qdd: Array  #: filtered derivative of the velocity
    current: Array


@dataclass(frozen=True)
class Inputs:
    """The inputs of the network."""

    lags: tuple[float, ...]  #: ages of the window's samples [s]
    memory: float  #: age of the past sample that is fed back [s]
    dt: float  #: sample interval [s]

    @property
    def ages(self) -> tuple[int, ...]:
        """Ages of the window's samples and of the sample that is fed back, in samples."""
        own = tuple(round(lag / self.dt) for lag in self.lags)
        return (*own, max(1, round(self.memory / self.dt)))

    def of(self, now: Sample, past: Sequence[Sample]) -> Array:
        """The inputs, shape (N, d).

        They are sine and cosine of the position, direction of motion, velocity and acceleration at
        the window's ages, and the current and position of the past sample that is fed back.

        Args:
            now: the samples.
            past: for each of :attr:`ages`, the samples that much older.
        """
        parts = [np.sin(now.q), np.cos(now.q), np.tanh(now.qd / REVERSAL)]
        for sample in past[: len(self.lags)]:
            parts += [sample.qd, sample.qdd]
        fed = past[-1]
        parts += [fed.current, fed.q - now.q, np.tanh(fed.qd / REVERSAL)]
        return np.concatenate(parts, axis=1)

    def rows(self, trace: Trace, rows: NDArray[np.intp]) -> tuple[Sample, list[Sample]]:
        """Samples of a trace and their past; the first sample replaces samples before it."""
        signals = (trace.q, trace.qd, self.acceleration(trace), trace.current)
        past = [Sample(*(x[np.maximum(rows - age, 0)] for x in signals)) for age in self.ages]
        return Sample(*(x[rows] for x in signals)), past

    def acceleration(self, trace: Trace) -> Array:
        """The filtered derivative of the velocity [rad/s^2], shape (T, n)."""
        return DERIVATIVE * (trace.qd - smoothed(trace.qd, DERIVATIVE, self.dt))


@dataclass(frozen=True)
class CurrentNetwork:
    """Predicts changes of motor currents since a past sample; the score is the largest error.

    Without the past sample, an unknown payload would cause an error.
    """

    lags: tuple[float, ...] = (0.0, 0.025, 0.05)  #: ages of the window's samples [s]
    memory: float = 0.05  #: age of the past sample that is fed back [s]
    hidden: tuple[int, ...] = (64, 32)
    rows: int = 30_000  #: collision-free samples to train on
    epochs: int = 60
    seed: int = 0
    settle: float = 0.5  #: [s]
    name: ClassVar[str] = "current-network"

    def fit(self, traces: Sequence[Trace], arm: ArmModel) -> FittedCurrentNetwork:
        """Train on collision-free samples of all traces, more of them where the arm accelerates.

        The probability of a sample is proportional to the square root of the sum of |acceleration|,
        because errors are largest at fast starts and stops, which are rare.

        Raises:
            ArgumentError: traces of different arms or rates, or without collision-free motion.
        """
        inputs = Inputs(self.lags, self.memory, common_interval(traces, arm.robot.joint_names))
        x, y = [], []
        for trace, rows in zip(traces, self._drawn(traces, inputs), strict=True):
            if len(rows):
                now, past = inputs.rows(trace, rows)
                x.append(inputs.of(now, past))
                y.append(now.current - past[-1].current)
        network = Network.fit(
            np.concatenate(x), np.concatenate(y), self.hidden, seed=self.seed, epochs=self.epochs
        )
        return FittedCurrentNetwork(self.name, arm, self.settle, inputs, network)

    def _drawn(self, traces: Sequence[Trace], inputs: Inputs) -> list[NDArray[np.intp]]:
        """Rows of each trace to train on."""
        rng = np.random.default_rng([self.seed, 7])
        free = [np.flatnonzero(free_rows(trace, self.settle)) for trace in traces]
        if not sum(len(rows) for rows in free):
            raise ArgumentError("no collision-free motion in the traces")
        lively = [
            np.sqrt(np.abs(inputs.acceleration(trace)[rows]).sum(axis=1) + STILL)
            for trace, rows in zip(traces, free, strict=True)
        ]
        total = sum(float(weight.sum()) for weight in lively)
        drawn = []
        for rows, weight in zip(free, lively, strict=True):
            fraction = min(len(rows), int(np.ceil(self.rows * weight.sum() / total)))
            if fraction:
                rows = rng.choice(rows, fraction, replace=False, p=weight / weight.sum())
            drawn.append(np.sort(rows))
        return drawn


@dataclass(frozen=True, eq=False)
class FittedCurrentNetwork(Frozen):
    """A :class:`~tauguard.detectors.scores.method.FittedMethod`."""

    name: str
    arm: ArmModel  #: as given; the scores do not depend on it
    settle: float  #: [s]
    inputs: Inputs
    network: Network

    @property
    def dt(self) -> float:
        """Sample interval [s]."""
        return self.inputs.dt

    def scores(self, trace: Trace) -> Array:
        """The largest |measured - predicted current| over the joints [A], shape (T,)."""
        check_trace(trace, len(self.network.biases[-1]), self.dt)
        return self._score(*self.inputs.rows(trace, np.arange(len(trace.t))))

    def _score(self, now: Sample, past: Sequence[Sample]) -> Array:
        predicted = past[-1].current + self.network(self.inputs.of(now, past))
        score: Array = np.abs(now.current - predicted).max(axis=1)
        return score

    def stream(self) -> CurrentNetworkStream:
        """A new stream of the scores, sample by sample."""
        return CurrentNetworkStream(self)


class CurrentNetworkStream:
    """Scores sample by sample; past samples up to the oldest age are stored."""

    def __init__(self, detector: FittedCurrentNetwork) -> None:
        """Begin anew."""
        self._detector, self._ages = detector, detector.inputs.ages
        self._low_pass = LowPass(DERIVATIVE, detector.dt)
        self._kept: list[Sample] = []
        self._at = 0

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> float:
        """The score of this sample."""
        acceleration = DERIVATIVE * (qd - self._low_pass.step(qd))
        now = Sample(*(x[None].copy() for x in (q, qd, acceleration, current)))
        if not self._kept:
            self._kept = [now] * (1 + max(self._ages))
        self._at = (self._at + 1) % len(self._kept)
        self._kept[self._at] = now
        past = [self._kept[self._at - age] for age in self._ages]
        return float(self._detector._score(now, past)[0])
