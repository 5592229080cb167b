"""Generalised Pareto tails of the peaks of scores, and thresholds for a rate of false alarms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.thresholds.free_scores import (
    FreeScores,
    SpeedNormalisation,
    speed_normalisation,
)
from tauguard.findings import ArgumentError

#: The tail's shape unless the peaks show another one. For two detectors on 26 simulated arms, the
#: estimated shapes have means of 0.18 and 0.20 and standard deviations of 0.12, of which chance
#: alone explains 0.07. The value is larger than the means because most false alarms come from arms
#: with heavy tails. With it, all arms together have the accepted rate.
USUAL_SHAPE = 0.25
#: Largest distance of the shape from its estimate, in standard errors.
BEYOND_CHANCE = 3.0
#: Bounds of the shape: with -0.5 the density falls linearly to 0, and from 0.5 on the variance is
#: infinite.
SHAPES = (-0.5, 0.5)


@dataclass(frozen=True)
class Tail:
    """A generalised Pareto tail of peaks.

    Unlike an exponential tail, it can have an end, so that a bounded score is not extrapolated far
    beyond its bound.
    """

    base: float  #: level where the tail begins
    scale: float  #: scale of the excesses over the base; 0: unknown
    shape: float
    count: int  #: number of peaks above the base

    @classmethod
    def of(
        cls,
        peaks: Array,
        count: int,
        shapes: tuple[float, float] | None = None,
        usual: float = USUAL_SHAPE,
    ) -> Tail:
        """The tail of the ``count`` largest peaks, whose base is the next peak.

        Scale and shape are estimated from the excesses by probability-weighted moments (Hosking &
        Wallis 1987).

        Args:
            peaks: in descending order, shape (N,), N >= 1.
            count: number of peaks in the tail; at most N - 1 are used.
            shapes: lowest and highest shape (default: the shape is the one nearest to ``usual``
                within :data:`BEYOND_CHANCE` standard errors of the estimate).
            usual: see ``shapes``.
        """
        count = min(count, len(peaks) - 1)
        if count < 2:
            return cls(float(peaks[0]), 0.0, 0.0, 0)
        excess = peaks[:count] - peaks[count]
        mean = float(excess.mean())
        # Probability of exceeding each peak; peaks are in descending order.
        exceeded = (np.arange(1, count + 1) - 0.65) / count
        weighted = float(np.mean(excess * exceeded))
        if not mean - 2 * weighted > 1e-12 * max(mean, 1e-300):
            return cls(float(peaks[0]), 0.0, 0.0, 0)
        found = 2 - mean / (mean - 2 * weighted)
        shape = float(np.clip(found, *shapes)) if shapes else _likely_shape(found, count, usual)
        return cls(float(peaks[count]), mean * (1 - shape), shape, count)

    def level(self, allowed: float) -> float:
        """The level that ``allowed`` peaks, fewer than ``count``, are expected to exceed."""
        if not self.scale:
            return self.base
        ratio, shape = self.count / allowed, self.shape
        grown = np.log(ratio) if abs(shape) < 1e-9 else (ratio**shape - 1) / shape
        return self.base + self.scale * float(grown)


def shape_error(count: int) -> float:
    """Standard error of the shape of ``count`` peaks near the shape 0 (Hosking & Wallis 1987)."""
    return float(np.sqrt(4 / 3 / max(count, 1)))


def _likely_shape(found: float, count: int, usual: float) -> float:
    """The shape nearest to ``usual`` within BEYOND_CHANCE standard errors of ``found``."""
    found, margin = float(np.clip(found, *SHAPES)), BEYOND_CHANCE * shape_error(count)
    return float(np.clip(usual, found - margin, found + margin))


def tail_level(peaks: Array, allowed: float, count: int, usual: float = USUAL_SHAPE) -> float:
    """The level that ``allowed`` peaks are expected to exceed, by their :class:`Tail`.

    Args:
        peaks: in descending order, shape (N,), N >= 1.
        allowed: above 0. From ``count`` on, the result is the peak that ``allowed`` peaks exceed.
        count: number of peaks in the tail; at most N - 1 are used.
        usual: shape of the tail unless the peaks show another one.

    Raises:
        ArgumentError: no peaks, or ``allowed`` not above 0.
    """
    if not (len(peaks) and allowed > 0):
        raise ArgumentError(f"{len(peaks)} peaks, {allowed} allowed: expected some, and above 0")
    if allowed >= max(min(count, len(peaks) - 1), 1):
        return float(peaks[min(int(allowed), len(peaks) - 1)])
    return Tail.of(peaks, count, usual=usual).level(allowed)


#: Fraction of the blocks whose peaks are the tail.
TAIL = 0.05
#: This fraction for logs with sample intervals above SLOW [s]. There the residual depends on the
#: time between a brake and the next sample, which causes rare high peaks. The longer the interval,
#: the heavier is their tail. Chosen on four simulated arms.
SLOW_TAIL, SLOW = 0.1, 0.015
#: Above this sample interval the usual shape is proportional to the interval [s].
HEAVIER = 0.02


def tail_fraction(interval: float) -> float:
    """Fraction of the blocks in the tail, by the logs' sample interval [s]."""
    return SLOW_TAIL if interval > SLOW else TAIL


def threshold_for_rate(scores: Sequence[FreeScores], per_hour: float) -> float:
    """The threshold that collision-free motion exceeds ``per_hour`` times per hour.

    Each block of ``MERGE_GAP`` whose peak exceeds the threshold counts as one alarm. Rare alarms
    are extrapolated by a generalised Pareto tail of the blocks' peaks.

    Args:
        scores: scores of each episode. If they have a ``floor``, only the floor is used.
        per_hour: accepted false alarms per hour.

    Raises:
        ArgumentError: no scores, or ``per_hour`` not above 0.
    """
    if not (len(scores) and per_hour > 0):
        raise ArgumentError(
            f"per_hour: {per_hour} of {len(scores)} episodes; expected both above 0"
        )
    peaks = np.sort(np.concatenate([(one.floor or one).blocks()[0] for one in scores]))[::-1]
    hours = sum(one.seconds for one in scores) / 3600
    interval = max(one.interval for one in scores)
    usual = min(USUAL_SHAPE * max(interval / HEAVIER, 1.0), SHAPES[1])
    count = max(2, round(tail_fraction(interval) * len(peaks)))
    return tail_level(peaks, per_hour * hours, count, usual)


#: At the threshold at which a detector's thresholds on the residual alone have PLAIN alarms per
#: hour, its learned score alone has LEARNED. Together they then have about PLAIN by the tail model,
#: because most alarms of the two coincide. Chosen on three arms.
PLAIN, LEARNED = 1.0, 0.3


def normalisations(
    scores: Sequence[FreeScores],
) -> tuple[SpeedNormalisation, SpeedNormalisation | None]:
    """The normalisation of a learned score, and that of the floor (thresholds on the residual).

    The threshold for the larger of both normalised scores is the threshold of the floor alone. So
    every collision that the floor detects is detected, with the same delay or a shorter one. The
    learned score is scaled so that it adds few false alarms.

    Args:
        scores: scores of each episode, not normalised.

    Returns:
        Both normalisations; the second is ``None`` if the scores have no floor.
    """
    levels = speed_normalisation(scores)
    beneath = [one.floor for one in scores if one.floor is not None]
    if not beneath:
        return levels, None
    floor = speed_normalisation(beneath)
    reached = threshold_for_rate([one.over(levels) for one in scores], LEARNED)
    plain = threshold_for_rate([one.over(floor) for one in beneath], PLAIN)
    factor = reached / plain if min(plain, reached) > 0 else 1.0
    return replace(levels, unit=factor * levels.unit), floor
