"""From scores to alarms, the same way for every method, in batch and online."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.detectors import _observer
from tauguard.detectors.events import (
    CONFIRMATION,
    confirmation_samples,
    confirmed,
    find_alarms,
    sustained,
)
from tauguard.detectors.faults.inputs import UsualInput
from tauguard.detectors.features.front_end import NativeStream, plain_residual
from tauguard.detectors.frozen import Frozen
from tauguard.detectors.samples import same_rate
from tauguard.detectors.scores.baselines import FittedThresholds
from tauguard.detectors.scores.detector import FittedDetector
from tauguard.detectors.thresholds.free_scores import FreeScores
from tauguard.detectors.thresholds.speed_normalisation import (
    SpeedNormalisation,
    memory_samples,
    recent_speed,
)
from tauguard.traces.trace import Detection, Trace

#: Message after an absurd sample has made the detector's state infinite or NaN.
LOST = "the score is not a number: a sample was out of any arm's range; begin anew without it"


@dataclass(frozen=True, eq=False)
class CollisionAlarm(Frozen):
    """A fitted detector with its threshold, normalisation and confirmation time.

    The alarm is up where the score, normalised over the speed, has stayed above the threshold for
    the confirmation time; never before the detector has settled.
    """

    detector: FittedDetector
    threshold: float  #: of the normalised score
    confirmation: float = CONFIRMATION  #: t_c [s]
    normalisation: SpeedNormalisation | None = None  #: None: the score is compared as it is
    inputs: UsualInput | None = None  #: limits of usual samples; None: not known
    floor: SpeedNormalisation | None = None
    """Normalisation of the plain thresholds beneath a learned score (``detector.floor``). The
    larger of both normalised scores counts. None: the learned score alone."""

    def __post_init__(self) -> None:
        """Check: ``ValueError``."""
        confirmation_samples(self.confirmation, self.detector.dt)
        if np.isnan(self.threshold):
            raise ValueError("threshold: not a number")
        if self.floor is not None and (self.normalisation is None or floor_of(self) is None):
            raise ValueError("floor: of a detector without one, or of a score not normalised")

    @property
    def settle(self) -> float:
        """Seconds at the beginning without an alarm."""
        return self.detector.settle

    @property
    def samples(self) -> int:
        """Successive samples above the threshold that make an alarm."""
        return confirmation_samples(self.confirmation, self.detector.dt)

    def normalised(self, score: Array, trace: Trace) -> Array:
        """Scores of a trace relative to the speed normalisation, shape (T,)."""
        if self.normalisation is None:
            return score
        speed = recent_speed(trace.qd, trace.dt)
        level, plain = self.normalisation(score, speed), floor_of(self)
        if self.floor is None or plain is None:
            return level
        return np.maximum(level, self.floor(_finite(plain.scores(trace), trace), speed))

    def scores(self, trace: Trace) -> Array:
        """The normalised score, shape (T,)."""
        return self.normalised(_finite(self.detector.scores(trace), trace), trace)

    def sustained(self, trace: Trace, score: Array | None = None) -> Array:
        """Least normalised score within the last t_c, shape (T,).

        Above the threshold is an alarm; -inf before the detector has settled.

        Args:
            trace: of the detector's arm.
            score: score of the detector, before it is normalised, where it is known.
        """
        known = self.detector.scores(trace) if score is None else score
        level = self.normalised(known, trace)
        return sustained(np.where(self._settled(trace), level, -np.inf), self.samples)

    def free_scores(self, trace: Trace, score: Array | None = None) -> FreeScores:
        """The scores of a trace's collision-free rows, for a threshold.

        Where this alarm does not normalise them, those of the detector's floor are beside them.

        Args:
            trace: of the detector's arm.
            score: score of the detector, before it is normalised, where it is known.

        Raises:
            ValueError: the trace is over before the detector has settled.
        """
        found = FreeScores.of(self.sustained(trace, score), trace, self.settle)
        plain = floor_of(self)
        if self.normalisation is not None or plain is None:
            return found
        beneath = CollisionAlarm(plain, np.inf, self.confirmation).free_scores(trace)
        return replace(found, floor=beneath)

    def _settled(self, trace: Trace) -> NDArray[np.bool_]:
        return np.asarray(trace.t - trace.t[0] > self.settle - self.detector.dt / 2)

    def detect(self, trace: Trace) -> Detection:
        """The alarms of a trace; its residual is the plain momentum observer's.

        Raises:
            ValueError: another number of joints or another sample rate.
        """
        score = self.scores(trace)
        samples = self.samples
        if not same_rate(trace.dt, self.detector.dt):  # a detector that takes other rates
            samples = confirmation_samples(self.confirmation, trace.dt)
        alarm = confirmed((score > self.threshold) & self._settled(trace), samples)
        return Detection(
            detector=self.detector.name,
            t=trace.t,
            residual=plain_residual(self.detector.arm, trace),
            score=score,
            threshold=self.threshold,
            alarm=alarm,
            alarms=find_alarms(trace.t, alarm),
        )

    def stream(self) -> AlarmStream:
        """The alarm sample by sample, from the next sample on."""
        return AlarmStream(self)


def floor_of(alarm: CollisionAlarm) -> FittedThresholds | None:
    """The plain thresholds beneath a learned score; None: it has none."""
    plain = getattr(alarm.detector, "floor", None)  # of another's detector it may be anything
    return plain if isinstance(plain, FittedThresholds) else None


def _finite(score: Array, trace: Trace) -> Array:
    if not np.isfinite(score).all():
        raise ValueError(f"{LOST}; first at {trace.t[~np.isfinite(score)][0]:g} s")
    return score


class AlarmStream:
    """An alarm as the samples of one recording come in.

    Attributes:
        native: the stream in C++.
    """

    def __init__(self, alarm: CollisionAlarm) -> None:
        """Begin anew."""
        detector = alarm.detector
        self._dt, self._first = detector.dt, True
        self.native = _observer.Alarm(
            native_scores(detector),
            detector.dt,
            alarm.settle - detector.dt / 2,
            alarm.threshold,
            alarm.samples,
            memory_samples(detector.dt),
            _levels(alarm.normalisation),
            _levels(alarm.floor),
        )

    @property
    def score(self) -> float:
        """The normalised score at the last sample, 0 before the first."""
        return self.native.score

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> bool:
        """Whether the alarm is up at this sample; equal to :meth:`CollisionAlarm.detect`.

        Args:
            q: [rad], float64, shape (n,).
            qd: [rad/s], shape (n,).
            current: [A], shape (n,).
            dt: time since the last sample [s] (default: that of the training traces).

        Raises:
            ValueError: wrong shapes, numbers that are not finite, or another sample rate than the
                training's.
        """
        interval = self._dt if dt is None else dt
        if not self._first and not same_rate(interval, self._dt):
            raise ValueError(
                f"dt {1e3 * interval:g} ms: this detector works at {1e3 * self._dt:g} ms; feed it "
                "every sample, or train one at this rate"
            )
        try:
            up = self.native.step(q, qd, current, interval)
        except TypeError:
            raise ValueError("q, qd, current: expected float64 arrays, one entry a joint") from None
        self._first = False
        return up


def _levels(speed: SpeedNormalisation | None) -> _observer.Levels:
    if speed is None:
        return _observer.Levels([], [], [])
    return _observer.Levels(
        *(np.asarray(x).tolist() for x in (speed.speed, speed.base, speed.unit))
    )


def native_scores(detector: FittedDetector) -> _observer.Scores:
    """A new native stream of the detector; it calls a stream that is written in Python."""
    stream = detector.stream()
    if isinstance(stream, NativeStream):
        return stream.native
    return _observer.python_scores(detector.stream, detector.arm.robot.joints)
