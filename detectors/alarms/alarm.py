"""Alarms from the scores of any detection method, for whole traces or sample by sample."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

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
from tauguard.detectors.frozen import Frozen, Unshared
from tauguard.detectors.samples import same_rate
from tauguard.detectors.scores.baselines import FittedThresholds
from tauguard.detectors.scores.method import FittedMethod
from tauguard.detectors.thresholds.free_scores import (
    FreeScores,
    SpeedNormalisation,
    memory_samples,
    recent_speed,
)
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Detection, Trace

if TYPE_CHECKING:
    from tauguard.models.stored_robot import StoredRobot

#: Message when an extreme sample has made the detector's state infinite or NaN.
LOST = "the score is not a number, because a sample was beyond any arm's range; leave it out"


@dataclass(frozen=True, eq=False)
class CollisionAlarm(Frozen):
    """A fitted detector with its threshold, normalisation and confirmation time.

    The alarm is on while the normalised score has been above the threshold for at least the
    confirmation time. It is always off until the detector has settled.
    """

    detector: FittedMethod
    threshold: float  #: of the normalised score
    confirmation: float = CONFIRMATION  #: confirmation time [s]
    normalisation: SpeedNormalisation | None = None  #: None: the score is not normalised
    inputs: UsualInput | None = None  #: limits of samples without a fault; None: no fault checks
    floor: SpeedNormalisation | None = None
    """Normalisation of the floor's score. The floor, ``detector.floor``, sets thresholds on the
    residual beside a learned score. The larger of the two normalised scores is used. None: only the
    detector's own score is used."""
    robot: StoredRobot | None = None  #: robot file and surface of the arm, for diagnoses

    def __post_init__(self) -> None:
        """Check the fields: ``ArgumentError``."""
        confirmation_samples(self.confirmation, self.detector.dt)
        if np.isnan(self.threshold):
            raise ArgumentError("threshold: not a number")
        if self.floor is not None and (self.normalisation is None or floor_of(self) is None):
            raise ArgumentError("floor: needs a normalisation and a detector with a floor")

    @property
    def settle(self) -> float:
        """Time until the detector has settled, in which it raises no alarm [s]."""
        return self.detector.settle

    @property
    def samples(self) -> int:
        """Number of successive samples above the threshold that raises an alarm."""
        return confirmation_samples(self.confirmation, self.detector.dt)

    def normalised(self, score: Array, trace: Trace) -> Array:
        """The larger of the normalised ``score`` and the floor's normalised score, shape (T,)."""
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
        """Least normalised score within the last confirmation time, shape (T,).

        The alarm is on where it is above the threshold. -inf before the detector has settled.

        Args:
            trace: of the detector's arm.
            score: the detector's score before normalisation (default: computed).
        """
        known = self.detector.scores(trace) if score is None else score
        level = self.normalised(known, trace)
        return sustained(np.where(self._settled(trace), level, -np.inf), self.samples)

    def free_scores(self, trace: Trace, score: Array | None = None) -> FreeScores:
        """Scores of the collision-free rows of a trace, from which a threshold is chosen.

        Without a normalisation, the result also has the scores of the detector's floor.

        Args:
            trace: of the detector's arm.
            score: the detector's score before normalisation (default: computed).

        Raises:
            ArgumentError: the trace ends before the detector has settled.
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
        """Alarms of a trace, with the residual of the plain momentum observer.

        Raises:
            ArgumentError: the trace has another number of joints than the training data, or a
                sample rate that the detector does not accept.
        """
        score = self.scores(trace)
        samples = self.samples
        if not same_rate(trace.dt, self.detector.dt):  # some detectors accept other rates
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
        """A new stream, which computes the alarm sample by sample."""
        return AlarmStream(self)


def floor_of(alarm: CollisionAlarm) -> FittedThresholds | None:
    """The thresholds on the residual that a learned detector uses in addition; None: none."""
    plain = getattr(alarm.detector, "floor", None)  # any type in a user's own detector
    return plain if isinstance(plain, FittedThresholds) else None


def _finite(score: Array, trace: Trace) -> Array:
    if not np.isfinite(score).all():
        raise ArgumentError(f"{LOST}; first at {trace.t[~np.isfinite(score)][0]:g} s")
    return score


class AlarmStream(Unshared):
    """An alarm computed sample by sample along one recording.

    Attributes:
        native: the C++ stream.
    """

    def __init__(self, alarm: CollisionAlarm) -> None:
        """Set up the state before the first sample."""
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
        """Whether the alarm is on at this sample, as :meth:`CollisionAlarm.detect` computes it.

        Args: as :meth:`~tauguard.detectors.ScoreStream.step`.

        Raises:
            ArgumentError: as there, or a sample interval that differs from the training's.
        """
        interval = self._dt if dt is None else dt
        if not self._first and not same_rate(interval, self._dt):
            raise ArgumentError(
                f"dt {1e3 * interval:g} ms: this detector works at {1e3 * self._dt:g} ms; feed it "
                "every sample, or train one at this rate"
            )
        try:
            up = self.native.step(q, qd, current, interval)
        except TypeError:
            raise ArgumentError(
                "q, qd, current: expected float64 arrays, one entry per joint"
            ) from None
        self._first = False
        return up


def _levels(speed: SpeedNormalisation | None) -> _observer.Levels:
    if speed is None:
        return _observer.Levels([], [], [])
    return _observer.Levels(
        *(np.asarray(x).tolist() for x in (speed.speed, speed.base, speed.unit))
    )


def native_scores(detector: FittedMethod) -> _observer.Scores:
    """A native stream of the detector's scores. A stream written in Python is wrapped."""
    stream = detector.stream()
    if isinstance(stream, NativeStream):
        return stream.native
    return _observer.python_scores(detector.stream, detector.arm.robot.joints)
