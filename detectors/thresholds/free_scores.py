"""Peaks of scores in collision-free motion, and normalisation of scores by speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.arrays import Array
from tauguard.detectors.events import CASE_SECONDS, MERGE_GAP, find_alarms, free_rows
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace

#: Time for which the recent speed includes a motion [s], because stiction acts after a stop.
MEMORY = 0.5
BINS = 10  # largest number of speeds with their own base and unit
FEWEST = 40  # least number of blocks for each of these speeds
#: Fraction of the blocks at a speed whose peaks exceed the base.
TAIL = 0.1


def recent_speed(qd: ArrayLike, dt: float, memory: float = MEMORY) -> Array:
    """The largest sum of |qd| over the joints within the last ``memory`` seconds, shape (T,).

    Values are causal: each depends only on this sample and earlier ones.

    Args:
        qd: [rad/s], shape (T, n).
        dt: sample interval [s].
        memory: length of the window [s].
    """
    from scipy.ndimage import maximum_filter1d

    total = np.abs(np.asarray(qd, dtype=np.float64)).sum(axis=1)
    samples = memory_samples(dt, memory)
    found: Array = maximum_filter1d(
        total, samples, mode="constant", cval=0.0, origin=(samples - 1) // 2
    )
    return found


def memory_samples(dt: float, memory: float = MEMORY) -> int:
    """Number of samples within ``memory``, at least 1; times in s."""
    if not (dt > 0 and np.isfinite(memory) and memory >= 0):
        raise ArgumentError(f"dt {dt}, memory {memory} s: expected above 0, and 0 or more")
    return max(1, round(memory / dt))


@dataclass(frozen=True, eq=False)
class SpeedNormalisation:
    """Base and unit of collision-free scores, as functions of the recent speed.

    The residual of collision-free motion increases with the speed. A threshold of the score that
    suits the fastest motion would be far too high for slow motion. A normalised score is 0 at the
    base, which the peaks of collision-free motion at this speed seldom exceed. Its unit is the mean
    excess of peaks over the base. Both are interpolated linearly between the given speeds.
    """

    speed: Array  #: ascending [rad/s], shape (K,)
    base: Array  #: score that the peak of a block seldom exceeds, shape (K,)
    unit: Array  #: mean excess of the peaks that exceed ``base``, above 0, shape (K,)

    def __post_init__(self) -> None:
        """Check shapes and values: ``ArgumentError``."""
        shapes = [np.shape(value) for value in (self.speed, self.base, self.unit)]
        if len(shapes[0]) != 1 or not shapes[0][0] or len(set(shapes)) != 1:
            raise ArgumentError(f"speed, base, unit: shapes {shapes}, expected (K,) each, K > 0")
        if not ((np.diff(self.speed) >= 0).all() and (self.unit > 0).all()):
            raise ArgumentError("speed, unit: expected rising speeds and units above 0")

    @classmethod
    def fit(cls, peaks: ArrayLike, speeds: ArrayLike) -> SpeedNormalisation:
        """Fit to the peaks of blocks of collision-free motion.

        Args:
            peaks: highest score of each block, shape (B,).
            speeds: recent speed at this score [rad/s], shape (B,).

        Raises:
            ArgumentError: no blocks, shapes that differ, or numbers that are not finite.
        """
        from sklearn.isotonic import IsotonicRegression

        value, speed = np.asarray(peaks, dtype=np.float64), np.asarray(speeds, dtype=np.float64)
        if value.shape != speed.shape or value.ndim != 1 or not len(value):
            raise ArgumentError(
                f"peaks, speeds: shapes {value.shape} and {speed.shape}, expected (B,) twice, B > 0"
            )
        if not (np.isfinite(value).all() and np.isfinite(speed).all()):
            raise ArgumentError("peaks, speeds: expected finite numbers only")
        bins = int(np.clip(len(value) // FEWEST, 1, BINS))
        parts = np.array_split(np.argsort(speed, kind="stable"), bins)
        base = [float(np.quantile(value[part], 1 - TAIL)) for part in parts]
        unit = [_mean_excess(value[part], low) for part, low in zip(parts, base, strict=True)]
        middle = np.array([np.median(speed[part]) for part in parts])
        floor = max(1e-3 * float(np.ptp(value)), 1e-12)
        rising = IsotonicRegression()
        return cls(
            middle,
            np.asarray(rising.fit(middle, base).predict(middle)),
            np.maximum(rising.fit(middle, unit).predict(middle), floor),
        )

    def __call__(self, score: ArrayLike, speed: ArrayLike) -> Array:
        """The normalised score at a recent speed [rad/s]; shapes are equal."""
        at = np.asarray(speed, dtype=np.float64)
        base = np.interp(at, self.speed, self.base)
        unit = np.interp(at, self.speed, self.unit)
        normalised: Array = (np.asarray(score, dtype=np.float64) - base) / unit
        return normalised


def _mean_excess(peaks: Array, base: float) -> float:
    above = peaks[peaks > base]
    return float(np.mean(above - base)) if len(above) else 0.0


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
    floor: FreeScores | None = None  #: scores of the thresholds on the residual, if used as well
    interval: float = 0.0  #: sample interval [s]

    @classmethod
    def of(cls, level: Array, trace: Trace, settle: float) -> FreeScores:
        """Scores in the collision-free rows of a trace after the detector has settled.

        Args:
            level: least score within the last confirmation time, shape (T,); -inf if unknown.
            trace: the trace with these scores.
            settle: settling time of the detector [s].

        Raises:
            ArgumentError: the trace ends before the detector has settled.
        """
        rows = np.flatnonzero(free_rows(trace, settle) & (level > -np.inf))
        if not len(rows):
            raise ArgumentError(
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
        """The larger of the normalised scores and the floor's normalised scores.

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
