"""A score that means the same at every speed: what free motion reaches is levelled out.

Free motion leaves more of a residual the faster the arm moves, whatever the detector makes of it.
One threshold on the score is then set by the fastest motion and is far too high for the slow.
Levelled, a score is counted from what free motion's peaks at this speed seldom exceed, in units of
their mean excess beyond that, so that one threshold asks for one rate at every speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter1d
from sklearn.isotonic import IsotonicRegression

from tauguard.detectors.calibration.calibrate import free_rows
from tauguard.detectors.detector import Detector
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.evaluation.events import MERGE_GAP
from tauguard.detectors.thresholds.rates import block_maxima
from tauguard.traces.trace import Trace

Array = NDArray[np.float64]

#: A motion is remembered this long [s]: what stiction leaves comes after a stop.
MEMORY = 0.5
#: Speeds that are told apart, and blocks that one of them needs at least.
BINS, FEWEST = 10, 40
#: Share of a speed's blocks whose peaks are its tail.
TAIL = 0.1


def recent_speed(qd: ArrayLike, dt: float, memory: float = MEMORY) -> Array:
    """The largest sum of |qd| over the joints within the last ``memory`` seconds, shape (T,).

    Causal: a value depends on this sample and those before it.

    Args:
        qd: [rad/s], shape (T, n).
        dt: sample interval [s].
        memory: [s].
    """
    total = np.abs(np.asarray(qd, dtype=np.float64)).sum(axis=1)
    samples = _samples(dt, memory)
    found: Array = maximum_filter1d(
        total, samples, mode="constant", cval=0.0, origin=(samples - 1) // 2
    )
    return found


def _samples(dt: float, memory: float) -> int:
    if not (dt > 0 and np.isfinite(memory) and memory >= 0):
        raise ValueError(f"dt {dt}, memory {memory} s: expected above 0, and 0 or more")
    return max(1, round(memory / dt))


@dataclass(frozen=True, eq=False)
class SpeedLevels:
    """What the peaks of free motion's scores reach, as functions of the recent speed.

    Both grow with the speed, are linear between the speeds given and constant beyond them.
    """

    speed: Array  #: rising [rad/s], shape (K,)
    base: Array  #: of the score: seldom exceeded by a block's peak, shape (K,)
    unit: Array  #: of the score, above 0: mean excess of those that do exceed it, shape (K,)

    def __post_init__(self) -> None:
        """Check the shapes: ``ValueError`` says what they are."""
        shapes = [np.shape(value) for value in (self.speed, self.base, self.unit)]
        if len(shapes[0]) != 1 or not shapes[0][0] or len(set(shapes)) != 1:
            raise ValueError(f"speed, base, unit: shapes {shapes}, expected (K,) each, K > 0")

    @classmethod
    def fit(cls, peaks: ArrayLike, speeds: ArrayLike) -> SpeedLevels:
        """From the peaks of blocks of collision-free motion.

        Args:
            peaks: highest score of each block, shape (B,).
            speeds: recent speed where the block has its peak [rad/s], shape (B,).

        Raises:
            ValueError: no blocks, shapes that differ, or numbers that are not finite.
        """
        value, speed = np.asarray(peaks, dtype=np.float64), np.asarray(speeds, dtype=np.float64)
        if value.shape != speed.shape or value.ndim != 1 or not len(value):
            raise ValueError(
                f"peaks, speeds: shapes {value.shape} and {speed.shape}, expected (B,) twice, B > 0"
            )
        if not (np.isfinite(value).all() and np.isfinite(speed).all()):
            raise ValueError("peaks, speeds: expected finite numbers only")
        parts = np.array_split(np.argsort(speed, kind="stable"), _bins(len(value)))
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
        """The levelled score at a recent speed [rad/s], both of one shape."""
        at = np.asarray(speed, dtype=np.float64)
        base = np.interp(at, self.speed, self.base)
        unit = np.interp(at, self.speed, self.unit)
        levelled: Array = (np.asarray(score, dtype=np.float64) - base) / unit
        return levelled


def _bins(blocks: int) -> int:
    return int(np.clip(blocks // FEWEST, 1, BINS))


def _mean_excess(peaks: Array, base: float) -> float:
    above = peaks[peaks > base]
    return float(np.mean(above - base)) if len(above) else 0.0


@dataclass(frozen=True, eq=False)
class Levelled:
    """A fitted detector whose score is levelled; a :class:`~tauguard.detectors.detector.Detector`.

    Attributes:
        detector: fitted.
        levels: of its score on free motion.
    """

    detector: Detector
    levels: SpeedLevels

    @classmethod
    def on(cls, detector: Detector, traces: Sequence[Trace]) -> Levelled:
        """Level a detector on the collision-free rows of ``traces``.

        Motion that it was not trained on tells more of what free motion reaches.

        Raises:
            ValueError: no motion is left after the detector has settled.
        """
        peaks, speeds = [], []
        for trace in traces:
            free = free_rows(trace, detector.settle)
            score = detector.scores(trace)[free]
            speed = recent_speed(trace.qd, trace.dt)[free]
            if len(score):
                high, where = block_maxima(score, max(1, round(MERGE_GAP / trace.dt)))
                peaks.append(high)
                speeds.append(speed[where])
        if not peaks:
            raise ValueError("no collision-free motion to level by after the detector has settled")
        return cls(detector, SpeedLevels.fit(np.concatenate(peaks), np.concatenate(speeds)))

    @property
    def name(self) -> str:
        """The detector's."""
        return self.detector.name

    @property
    def settle(self) -> float:
        """The detector's [s]."""
        return self.detector.settle

    @property
    def arm(self) -> ArmModel:
        """The detector's."""
        return self.detector.arm

    def fit(self, traces: Sequence[Trace], robot: ArmModel) -> Levelled:
        """Train the detector anew; the levels are then those of its free training rows."""
        return Levelled.on(self.detector.fit(traces, robot), traces)

    def scores(self, trace: Trace) -> Array:
        """The levelled score, shape (T,)."""
        return self.levels(self.detector.scores(trace), recent_speed(trace.qd, trace.dt))
