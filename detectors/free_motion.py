"""A detector that learns from collision-free motion alone.

Estimator (friction, momentum observer, payload and slow offsets tracked), then per joint the
residual that is left over its envelope: what collision-free motion leaves at that speed and
acceleration, apart for joints that stand still. Static friction is indeterminate there: the
torque of a joint at rest wanders with the others' motion, which the tracked offset follows.

Both envelope and threshold come from residuals of logs that the calibration in use did not see:
every training log is judged by a calibration from the others, as new logs will be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.detector import check_interval, common_interval
from tauguard.detectors.estimator import ArmModel, Estimator, Unknowns
from tauguard.detectors.features import Envelope
from tauguard.detectors.filter import confirmation_samples, confirmed
from tauguard.detectors.identification import REAL_FRICTION, Beliefs, Recording, filtered, identify
from tauguard.detectors.operating_point import sustained, threshold_for_rate
from tauguard.detectors.thresholds import still
from tauguard.traces.trace import Bools, Trace

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FreeMotionSettings:
    """What can be chosen; the defaults are for real arms at 100 Hz and above."""

    observer_gain: float = 20.0  #: [1/s]
    confirmation: float = 0.04  #: t_c [s]
    settle: float = 2.0  #: seconds at the beginning that are never an alarm
    false_alarms_per_hour: float = 1.0  #: to accept when the threshold is chosen
    spike: bool = True
    """Take the median of three successive currents: a controller's kick of one sample, as at a
    commanded stop, says nothing about contact. It costs one sample of delay."""
    unknowns: Unknowns = Unknowns()
    beliefs: Beliefs = Beliefs()


@dataclass
class FreeMotionDetector:
    """Calibration, envelopes and threshold from logs in which nothing touched the arm."""

    settings: FreeMotionSettings = field(default_factory=FreeMotionSettings)
    name: str = "free-motion"
    model: ArmModel | None = None
    resting: Envelope | None = None
    moving: Envelope | None = None
    threshold: float = 1.0
    dt: float = 0.0
    seconds: float = 0.0  #: of motion that the threshold rests on

    @property
    def settle(self) -> float:
        """Seconds at the beginning of a trace whose scores mean nothing yet."""
        return self.settings.settle

    @property
    def arm(self) -> ArmModel:
        """The calibrated arm."""
        return self._fitted()[0]

    def _fitted(self) -> tuple[ArmModel, Envelope, Envelope]:
        if self.model is None or self.resting is None or self.moving is None:
            raise ValueError("this detector is not fitted: call fit or load first")
        return self.model, self.resting, self.moving

    def fit(
        self, traces: Sequence[Trace | Recording], robot: ArmModel
    ) -> FreeMotionDetector:
        """Calibrate, then learn envelopes and threshold from left-out logs.

        Args:
            traces: collision-free logs, three or more; plain traces count as without a load.
            robot: nominal numbers and drive gains, whose scale holds.

        Raises:
            ValueError: fewer than three logs, other joints, different sample rates.
        """
        recordings = [r if isinstance(r, Recording) else Recording(r) for r in traces]
        if len(recordings) < 3:
            raise ValueError(f"{len(recordings)} logs: give three or more, to leave each out once")
        self.dt = common_interval([r.trace for r in recordings], robot)
        friction = robot.friction or REAL_FRICTION
        bare = replace(friction, weights=np.empty((0, 0)))
        gain, beliefs = self.settings.observer_gain, self.settings.beliefs
        data = [
            filtered(r, robot.robot, robot.drive_gain, bare, gain, beliefs.rest)
            for r in recordings
        ]
        residuals = []
        for k in range(-1, len(recordings)):
            use = [i for i in range(len(recordings)) if i != k]
            model = identify(
                robot,
                [recordings[i] for i in use],
                friction=bare,
                beliefs=beliefs,
                rate=gain,
                data=[data[i] for i in use],
            ).arm
            if k < 0:
                self.model = model
            else:
                residuals.append(self._residual(model, recordings[k].trace))
        self._learn([r.trace for r in recordings], residuals)
        return self

    def _learn(self, traces: Sequence[Trace], residuals: Sequence[tuple[Array, ...]]) -> None:
        """Envelopes of the left-out residuals, and the threshold on their ratio."""
        left, qd, acceleration, rest = (
            np.concatenate([r[k][self._settled(t)] for r, t in zip(residuals, traces, strict=True)])
            for k in range(4)
        )
        self.resting, self.moving = (
            _envelope(left, qd, acceleration, mask) for mask in (rest > 0.5, rest < 0.5)
        )
        self.seconds = sum(int(self._settled(t).sum()) for t in traces) * self.dt
        self.resting = self._scaled(self.resting, traces, residuals, 1.0)
        self.moving = self._scaled(self.moving, traces, residuals, 0.0)

    def _scaled(
        self,
        envelope: Envelope,
        traces: Sequence[Trace],
        residuals: Sequence[tuple[Array, ...]],
        regime: float,
    ) -> Envelope:
        """The envelope times each joint's own threshold, so that 1 is an alarm for every joint.

        The false alarms to accept are shared among the joints and their two regimes.
        """
        rate = self.settings.false_alarms_per_hour / (2 * envelope.weights.shape[0])
        factors = []
        for j in range(envelope.weights.shape[0]):
            levels = []
            for trace, (left, qd, acceleration, rest) in zip(traces, residuals, strict=True):
                ratio = np.abs(left[:, j]) / envelope.scale(qd, acceleration)[:, j]
                level = sustained(np.where(rest[:, j] == regime, ratio, 0.0), self._samples())
                levels.append(level[self._settled(trace)])
            factors.append(threshold_for_rate(levels, self.dt, rate))
        return Envelope(envelope.weights * np.array(factors)[:, None])

    def _settled(self, trace: Trace) -> Bools:
        return np.asarray(trace.t - trace.t[0] >= self.settings.settle)

    def _samples(self) -> int:
        return confirmation_samples(self.settings.confirmation, self.dt)

    def _residual(self, model: ArmModel, trace: Trace) -> tuple[Array, Array, Array, Array]:
        """Residual, speed, acceleration and whether a joint rests, each of shape (T, n)."""
        q, qd, current = trace.q, trace.qd, trace.current
        if self.settings.spike:
            q, qd, current = delayed(q), delayed(qd), median_of_three(current)
        estimator = Estimator(model, self.settings.observer_gain, self.dt, self.settings.unknowns)
        found = estimator.run(trace.t, q, qd, current)
        return found.left, qd, found.acceleration, still(qd, self.dt).astype(np.float64)

    def _ratio(self, left: Array, qd: Array, acceleration: Array, rest: Array) -> Array:
        """The largest ratio of a residual to its envelope, shape (T,)."""
        return self.ratios(left, qd, acceleration, rest).max(axis=1)

    def ratios(self, left: Array, qd: Array, acceleration: Array, rest: Array) -> Array:
        """Each joint's residual over its envelope, shape (T, n)."""
        _, resting, moving = self._fitted()
        calm, busy = resting.scale(qd, acceleration), moving.scale(qd, acceleration)
        ratio: Array = np.abs(left) / np.where(rest > 0.5, calm, busy)
        return ratio

    def scores(self, trace: Trace) -> Array:
        """The largest ratio of a joint's residual to its envelope, shape (T,)."""
        check_interval("the trace", trace, self.dt)
        return self._ratio(*self._residual(self._fitted()[0], trace))

    def residual(self, trace: Trace) -> Array:
        """What the estimator leaves [N m], shape (T, n)."""
        return self._residual(self._fitted()[0], trace)[0]

    def alarms(self, trace: Trace) -> Bools:
        """Whether the alarm is up at each sample, shape (T,)."""
        raw = (self.scores(trace) > self.threshold) & self._settled(trace)
        return confirmed(raw, self._samples())


def _envelope(left: Array, qd: Array, acceleration: Array, mask: Bools) -> Envelope:
    """The envelope of each joint's rows in ``mask``; a joint without such rows takes all."""
    parts = []
    for j in range(left.shape[1]):
        rows = mask[:, j] if mask[:, j].sum() >= 50 else np.ones(len(left), dtype=np.bool_)
        parts.append(Envelope.fit(left[rows], qd[rows], acceleration[rows]).weights[j])
    return Envelope(np.array(parts))


def delayed(x: Array) -> Array:
    """The sample before, shape (T, n); the first one twice."""
    return np.ascontiguousarray(np.concatenate([x[:1], x[:-1]]))


def median_of_three(x: Array) -> Array:
    """Median of a sample and the two before it: of the delayed series, shape (T, n)."""
    before = delayed(x)
    stacked = np.stack([x, before, delayed(before)])
    return np.ascontiguousarray(np.median(stacked, axis=0))
