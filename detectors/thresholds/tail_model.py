"""Peaks of scores and their tails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.thresholds.free_scores import FreeScores, speed_normalisation
from tauguard.detectors.thresholds.speed_normalisation import SpeedNormalisation

#: The tail's shape where its peaks do not show another. Estimates of 26 simulated arms with two
#: detectors have means of 0.18 and 0.20 and deviations of 0.12; chance alone makes 0.07. False
#: alarms come from arms with heavier tails: with 0.25 all arms together have as many as asked.
USUAL_SHAPE = 0.25

#: An estimated shape counts if it is this number of standard errors from the usual one.
BEYOND_CHANCE = 3.0

#: Bounds of an estimated shape: the tail ends no sooner than a triangle, and has a variance.
SHAPES = (-0.5, 0.5)


@dataclass(frozen=True)
class Tail:
    """A generalised Pareto tail of peaks: the level that a number of them is expected to exceed.

    Unlike an exponential tail it can end: a score that has a highest value is not extrapolated far
    beyond it.
    """

    base: float  #: level where the tail begins
    scale: float  #: 0: nothing is known beyond the base
    shape: float
    count: int  #: peaks above the base

    @classmethod
    def of(
        cls,
        peaks: Array,
        count: int,
        shapes: tuple[float, float] | None = None,
        usual: float = USUAL_SHAPE,
    ) -> Tail:
        """From the ``count`` largest peaks and the next one.

        Scale and shape follow from their excesses by probability-weighted moments (Hosking & Wallis
        1987).

        Args:
            peaks: in descending order, shape (N,), N >= 1.
            count: at most N - 1 are used.
            shapes: lowest and highest shape; ``None``: the one nearest to ``usual`` that is within
                :data:`BEYOND_CHANCE` standard errors of the estimate.
            usual: see ``shapes``.
        """
        count = min(count, len(peaks) - 1)
        if count < 2:
            return cls(float(peaks[0]), 0.0, 0.0, 0)
        excess = peaks[:count] - peaks[count]
        mean = float(excess.mean())
        # The largest comes first: its probability of being exceeded is the smallest.
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
    """The shape nearest to the usual one that an estimate of ``count`` peaks allows."""
    found, margin = float(np.clip(found, *SHAPES)), BEYOND_CHANCE * shape_error(count)
    return float(np.clip(usual, found - margin, found + margin))


def tail_level(peaks: Array, allowed: float, count: int, usual: float = USUAL_SHAPE) -> float:
    """The level that ``allowed`` peaks are expected to exceed, along their :class:`Tail`.

    Args:
        peaks: in descending order, shape (N,), N >= 1.
        allowed: above 0; at or above ``count`` it is the peak that so many exceed.
        count: at most N - 1 are used.
        usual: shape of the tail where the peaks do not show another.

    Raises:
        ValueError: no peaks, or a number allowed that is not above 0.
    """
    if not (len(peaks) and allowed > 0):
        raise ValueError(f"{len(peaks)} peaks, {allowed} allowed: expected some, and above 0")
    if allowed >= max(min(count, len(peaks) - 1), 1):
        return float(peaks[min(int(allowed), len(peaks) - 1)])
    return Tail.of(peaks, count, usual=usual).level(allowed)


#: Fraction of the blocks whose peaks the tail is fitted to.
TAIL = 0.05

#: The same of a log whose samples are further apart than :data:`SLOW` [s]. Whether a brake acts
#: just after a sample or just before the next decides how large the residual is: such peaks are
#: rare, and the wider the interval, the heavier their tail. Chosen on four simulated arms.
SLOW_TAIL, SLOW = 0.1, 0.015

#: The usual shape of a slow log grows with its interval from this one on [s].
HEAVIER = 0.02


def tail_fraction(interval: float) -> float:
    """Fraction of the blocks in the tail, by the logs' sample interval [s]."""
    return SLOW_TAIL if interval > SLOW else TAIL


def threshold_for_rate(scores: Sequence[FreeScores], per_hour: float) -> float:
    """The threshold that collision-free motion exceeds ``per_hour`` times an hour.

    Alarms are counted as blocks of the merge gap that exceed the threshold. Rarer alarms than the
    motion shows are extrapolated along a generalised Pareto tail of the blocks' peaks.

    Args:
        scores: an episode each. Where plain thresholds lie beneath a score, they alone decide.
        per_hour: false alarms to accept.

    Raises:
        ValueError: no scores, or a rate that is not above 0.
    """
    if not (len(scores) and per_hour > 0):
        raise ValueError(f"per_hour: {per_hour} of {len(scores)} episodes; expected both above 0")
    peaks = np.sort(np.concatenate([(one.floor or one).blocks()[0] for one in scores]))[::-1]
    hours = sum(one.seconds for one in scores) / 3600
    interval = max(one.interval for one in scores)
    usual = min(USUAL_SHAPE * max(interval / HEAVIER, 1.0), SHAPES[1])
    count = max(2, round(tail_fraction(interval) * len(peaks)))
    return tail_level(peaks, per_hour * hours, count, usual)


#: Where the plain thresholds beneath a learned score have the first rate, it has the second [1/h].
#: Both together then have the first by the tail's law: most moments that either exceeds are those
#: of the other. Chosen on three arms.
PLAIN, LEARNED = 1.0, 0.3


def normalisations(
    scores: Sequence[FreeScores],
) -> tuple[SpeedNormalisation, SpeedNormalisation | None]:
    """The normalisation of a score, and that of the plain thresholds beneath it.

    One threshold holds for the larger of both: the one that the plain thresholds alone would have.
    So what they find is found, and no later. The learned score is scaled to add few alarms to it.

    Args:
        scores: not normalised, an episode each.

    Returns:
        The second is ``None`` where the score has no floor.
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
