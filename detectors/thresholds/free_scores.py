"""The scores of collision-free motion, reduced to the peaks of short pieces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.evaluation.events import CASE_SECONDS, MERGE_GAP, find_alarms, free_rows
from tauguard.detectors.thresholds.alarm import CollisionAlarm
from tauguard.detectors.thresholds.rates import block_maxima
from tauguard.detectors.thresholds.speed_levels import SpeedLevels, recent_speed
from tauguard.traces.trace import Trace

#: Motion is kept as the peaks of pieces this long [s], or of single samples that are longer: ten
#: hours are two million numbers.
PIECE = 0.02


@dataclass(frozen=True, eq=False)
class FreeScores:
    """One detector on one collision-free episode."""

    peaks: Array  #: highest sustained score of every piece, shape (P,)
    speeds: Array  #: recent speed where it stands [rad/s], shape (P,)
    seconds: float  #: of collision-free motion

    @classmethod
    def of(cls, alarm: CollisionAlarm, trace: Trace, score: Array | None = None) -> FreeScores:
        """From the collision-free rows of a trace after the detector has settled.

        Args:
            alarm: detector, confirmation and speed levels; its threshold does not count.
            trace: of the detector's arm.
            score: of the detector, where it is known already.

        Raises:
            ValueError: the trace is over before the detector has settled.
        """
        level = alarm.sustained(trace, score)
        rows = np.flatnonzero(free_rows(trace, alarm.settle) & (level > -np.inf))
        if not len(rows):
            raise ValueError(
                f"an episode of {trace.t[-1] - trace.t[0]:g} s: no collision-free motion after the "
                f"{alarm.settle:g} s that {alarm.detector.name} needs to settle"
            )
        samples = max(1, round(PIECE / trace.dt))
        peaks, where = block_maxima(level[rows], samples)
        speeds = recent_speed(trace.qd, trace.dt)[rows][where]
        return cls(peaks, speeds, len(rows) * trace.dt)

    @property
    def piece(self) -> float:
        """Length of a piece [s]."""
        return self.seconds / len(self.peaks)

    @property
    def peak(self) -> float:
        """The highest score: a threshold at or above it gives no alarm."""
        return float(self.peaks.max())

    def blocks(self) -> tuple[Array, Array]:
        """Peak of every merge gap and the speed where it stands."""
        high, where = block_maxima(self.peaks, self._pieces(MERGE_GAP))
        return high, self.speeds[where]

    def cases(self) -> Array:
        """Peak of every whole non-collision case."""
        case = self._pieces(CASE_SECONDS)
        whole = len(self.peaks) // case * case
        found: Array = self.peaks[:whole].reshape(-1, case).max(axis=1)
        return found

    def over(self, levels: SpeedLevels) -> FreeScores:
        """Normalised: the speed hardly changes within a piece."""
        return replace(self, peaks=levels(self.peaks, self.speeds))

    def alarms(self, threshold: float) -> int:
        """How many alarms a threshold gives, those less than the merge gap apart as one."""
        times = np.arange(len(self.peaks)) * self.piece
        return len(find_alarms(times, self.peaks > threshold, MERGE_GAP))

    def _pieces(self, seconds: float) -> int:
        """How many pieces come nearest to ``seconds``."""
        return max(1, round(seconds / self.piece))


def speed_levels(episodes: Sequence[FreeScores]) -> SpeedLevels:
    """What the peaks of merge gaps reach at each speed."""
    peaks, speeds = zip(*(episode.blocks() for episode in episodes), strict=True)
    return SpeedLevels.fit(np.concatenate(peaks), np.concatenate(speeds))
