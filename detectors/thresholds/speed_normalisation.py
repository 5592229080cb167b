"""Normalisation of scores by speed, so that one threshold suits all speeds.

The residual of collision-free motion increases with the speed. A threshold of the score that suits
the fastest motion would be far too high for slow motion. A normalised score is 0 at a base score
that the peaks of collision-free motion at this speed seldom exceed. Its unit is the mean excess of
peaks over this base.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array

#: Time for which the recent speed includes a motion [s], because stiction acts after a stop.
MEMORY = 0.5
#: Largest number of speeds with their own base and unit, and least number of blocks for each.
BINS, FEWEST = 10, 40
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
        raise ValueError(f"dt {dt}, memory {memory} s: expected above 0, and 0 or more")
    return max(1, round(memory / dt))


@dataclass(frozen=True, eq=False)
class SpeedNormalisation:
    """Base and unit of collision-free scores, as functions of the recent speed.

    Both are linear between the given speeds and constant beyond them.
    """

    speed: Array  #: ascending [rad/s], shape (K,)
    base: Array  #: score that the peak of a block seldom exceeds, shape (K,)
    unit: Array  #: mean excess of the peaks that exceed ``base``, above 0, shape (K,)

    def __post_init__(self) -> None:
        """Check shapes and values: ``ValueError``."""
        shapes = [np.shape(value) for value in (self.speed, self.base, self.unit)]
        if len(shapes[0]) != 1 or not shapes[0][0] or len(set(shapes)) != 1:
            raise ValueError(f"speed, base, unit: shapes {shapes}, expected (K,) each, K > 0")
        if not ((np.diff(self.speed) >= 0).all() and (self.unit > 0).all()):
            raise ValueError("speed, unit: expected rising speeds and units above 0")

    @classmethod
    def fit(cls, peaks: ArrayLike, speeds: ArrayLike) -> SpeedNormalisation:
        """Fit to the peaks of blocks of collision-free motion.

        Args:
            peaks: highest score of each block, shape (B,).
            speeds: recent speed at this score [rad/s], shape (B,).

        Raises:
            ValueError: no blocks, shapes that differ, or numbers that are not finite.
        """
        from sklearn.isotonic import IsotonicRegression

        value, speed = np.asarray(peaks, dtype=np.float64), np.asarray(speeds, dtype=np.float64)
        if value.shape != speed.shape or value.ndim != 1 or not len(value):
            raise ValueError(
                f"peaks, speeds: shapes {value.shape} and {speed.shape}, expected (B,) twice, B > 0"
            )
        if not (np.isfinite(value).all() and np.isfinite(speed).all()):
            raise ValueError("peaks, speeds: expected finite numbers only")
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
