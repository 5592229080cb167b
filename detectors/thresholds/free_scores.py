"""Peaks of scores and their tails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.detectors.events import CASE_SECONDS, MERGE_GAP, find_alarms, free_rows
from tauguard.detectors.thresholds.speed_normalisation import SpeedNormalisation, recent_speed
from tauguard.traces.trace import Trace


def block_maxima(level: Array, rows: int) -> tuple[Array, NDArray[np.intp]]:
    """The maximum of each block of ``rows`` samples (the last may be shorter) and its row."""
    rows = max(1, rows)
    padded = np.append(level, np.full(-len(level) % rows, -np.inf)).reshape(-1, rows)
    where = padded.argmax(axis=1) + rows * np.arange(len(padded))
    return level[where], where


#: Motion is kept as the peaks of pieces this long [s], or of single samples that are longer: ten
#: hours are two million numbers.
PIECE = 0.02


@dataclass(frozen=True, eq=False)
class FreeScores:
    """One detector on one collision-free episode."""

    peaks: Array  #: highest sustained score of every piece, shape (P,)
    speeds: Array  #: recent speed where it stands [rad/s], shape (P,)
    seconds: float  #: of collision-free motion
    floor: FreeScores | None = None  #: of the plain thresholds beneath the score
    interval: float = 0.0  #: between two samples [s]

    @classmethod
    def of(cls, level: Array, trace: Trace, settle: float) -> FreeScores:
        """From the collision-free rows of a trace after the detector has settled.

        Args:
            level: what the score has reached throughout the last t_c, shape (T,); -inf: not known.
            trace: that was scored.
            settle: time that the detector needs to settle [s].

        Raises:
            ValueError: the trace is over before the detector has settled.
        """
        rows = np.flatnonzero(free_rows(trace, settle) & (level > -np.inf))
        if not len(rows):
            raise ValueError(
                f"an episode of {trace.t[-1] - trace.t[0]:g} s: no collision-free motion after the "
                f"{settle:g} s that the detector needs to settle"
            )
        samples = max(1, round(PIECE / trace.dt))
        peaks, where = block_maxima(level[rows], samples)
        speeds = recent_speed(trace.qd, trace.dt)[rows][where]
        return cls(peaks, speeds, len(rows) * trace.dt, interval=trace.dt)

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

    def over(
        self, levels: SpeedNormalisation, floor: SpeedNormalisation | None = None
    ) -> FreeScores:
        """The larger of normalised score and floor; within a piece the speed hardly changes."""
        peaks, beneath = levels(self.peaks, self.speeds), None
        if floor is not None and self.floor is not None:
            beneath = self.floor.over(floor)
            peaks = np.maximum(peaks, beneath.peaks)
        return replace(self, peaks=peaks, floor=beneath)

    def alarms(self, threshold: float) -> int:
        """How many alarms a threshold gives, those less than the merge gap apart as one."""
        times = np.arange(len(self.peaks)) * self.piece
        return len(find_alarms(times, self.peaks > threshold, MERGE_GAP))

    def _pieces(self, seconds: float) -> int:
        """How many pieces come nearest to ``seconds``."""
        return max(1, round(seconds / self.piece))


def speed_normalisation(episodes: Sequence[FreeScores]) -> SpeedNormalisation:
    """What the peaks of merge gaps reach at each speed."""
    peaks, speeds = zip(*(episode.blocks() for episode in episodes), strict=True)
    return SpeedNormalisation.fit(np.concatenate(peaks), np.concatenate(speeds))
