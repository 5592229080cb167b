"""Peaks of scores in collision-free motion."""

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


#: Length of the pieces of motion whose peaks are stored [s]; a longer sample interval is a piece.
#: Ten hours of motion are two million peaks.
PIECE = 0.02


@dataclass(frozen=True, eq=False)
class FreeScores:
    """Scores of a detector in one collision-free episode."""

    peaks: Array  #: highest sustained score of each piece, shape (P,)
    speeds: Array  #: recent speed at this score [rad/s], shape (P,)
    seconds: float  #: length of the collision-free motion [s]
    floor: FreeScores | None = None  #: scores of the detector's plain thresholds, if it has any
    interval: float = 0.0  #: sample interval [s]

    @classmethod
    def of(cls, level: Array, trace: Trace, settle: float) -> FreeScores:
        """Scores in the collision-free rows of a trace after the detector has settled.

        Args:
            level: least score within the last confirmation time, shape (T,); -inf if unknown.
            trace: the trace with these scores.
            settle: settling time of the detector [s].

        Raises:
            ValueError: the trace ends before the detector has settled.
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
        """The highest score; there is no alarm with a threshold at or above it."""
        return float(self.peaks.max())

    def blocks(self) -> tuple[Array, Array]:
        """Peak of each block of ``MERGE_GAP`` and the speed at this peak."""
        high, where = block_maxima(self.peaks, self._pieces(MERGE_GAP))
        return high, self.speeds[where]

    def cases(self) -> Array:
        """Peak of each complete non-collision case (``CASE_SECONDS``)."""
        case = self._pieces(CASE_SECONDS)
        whole = len(self.peaks) // case * case
        found: Array = self.peaks[:whole].reshape(-1, case).max(axis=1)
        return found

    def over(
        self, levels: SpeedNormalisation, floor: SpeedNormalisation | None = None
    ) -> FreeScores:
        """The normalised scores, or those of the floor where larger.

        The speed at the peak of a piece is used for the whole piece.
        """
        peaks, beneath = levels(self.peaks, self.speeds), None
        if floor is not None and self.floor is not None:
            beneath = self.floor.over(floor)
            peaks = np.maximum(peaks, beneath.peaks)
        return replace(self, peaks=peaks, floor=beneath)

    def alarms(self, threshold: float) -> int:
        """Number of alarms with a threshold; alarms less than ``MERGE_GAP`` apart count as one."""
        times = np.arange(len(self.peaks)) * self.piece
        return len(find_alarms(times, self.peaks > threshold, MERGE_GAP))

    def _pieces(self, seconds: float) -> int:
        """Number of pieces in ``seconds``, rounded."""
        return max(1, round(seconds / self.piece))


def speed_normalisation(episodes: Sequence[FreeScores]) -> SpeedNormalisation:
    """Speed normalisation from the peaks of blocks of ``MERGE_GAP``."""
    peaks, speeds = zip(*(episode.blocks() for episode in episodes), strict=True)
    return SpeedNormalisation.fit(np.concatenate(peaks), np.concatenate(speeds))
