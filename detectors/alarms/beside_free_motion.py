"""A free-motion detector and a learned alarm of one arm: either of them raises the alarm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.alarms.alarm import AlarmStream, CollisionAlarm
from tauguard.detectors.calibration.recording import Load
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.frozen import Frozen
from tauguard.detectors.scores.free_motion import FittedFreeMotion
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace


@dataclass(frozen=True, eq=False)
class BesideFreeMotion(Frozen):
    """The larger of the free-motion score and the learned score divided by its threshold.

    The threshold is 1. The learned score counts only while the learned alarm is on. So every
    collision that the free-motion detector finds is found, and the false alarms of both occur.
    """

    free: FittedFreeMotion
    learned: CollisionAlarm  #: of the same arm

    def __post_init__(self) -> None:
        """Check the fields: ``ArgumentError``."""
        if self.learned.detector.arm.robot.joints != self.free.arm.robot.joints:
            raise ArgumentError("free, learned: of arms with different joints")
        if not self.learned.threshold > 0:
            raise ArgumentError(f"learned.threshold {self.learned.threshold}: expected above 0")

    @property
    def name(self) -> str:
        """Names of both methods."""
        return f"{self.free.name} and {self.learned.detector.name}"

    @property
    def arm(self) -> ArmModel:
        """The arm model of the free-motion detector."""
        return self.free.arm

    @property
    def dt(self) -> float:
        """Sample interval of the training traces [s]."""
        return self.learned.detector.dt

    @property
    def settle(self) -> float:
        """Settling time of the free-motion detector [s]."""
        return self.free.settle

    def carrying(self, load: Load) -> BesideFreeMotion:
        """The detector for the arm with a load; the learned alarm estimates loads itself."""
        return BesideFreeMotion(self.free.carrying(load), self.learned)

    def scores(self, trace: Trace) -> Array:
        """The larger score, shape (T,).

        Raises:
            ArgumentError: other joints or another sample rate than the training's.
        """
        found = self.learned.detect(trace)
        learned = np.where(found.alarm, found.score / self.learned.threshold, 0.0)
        larger: Array = np.maximum(self.free.scores(trace), learned)
        return larger

    def stream(self) -> BothStreams:
        """A new stream of the scores, sample by sample."""
        return BothStreams(self)


class BothStreams:
    """The free-motion detector and the learned alarm, sample by sample."""

    def __init__(self, detector: BesideFreeMotion) -> None:
        """Set up the state before the first sample."""
        self._free = detector.free.stream()
        self._learned = AlarmStream(detector.learned)
        self._threshold = detector.learned.threshold

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> float:
        """The larger score of this sample."""
        free = self._free.step(q, qd, current, dt)
        up = self._learned.step(q, qd, current, dt)
        return max(free, self._learned.score / self._threshold if up else 0.0)
