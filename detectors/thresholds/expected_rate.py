"""The rate of false alarms of a threshold, estimated from recorded motion.

The motion is divided into blocks of 0.5 s (``MERGE_GAP``). A block whose peak exceeds the threshold
counts as one alarm. For alarms that are too rare to count, a generalised Pareto tail is fitted to
the peaks. The interval comes from a bootstrap of whole episodes, because samples of one episode are
not independent. Each draw has its own tail. A tail has an end only if the peaks show one
significantly.

A tail does not describe situations that are in no episode. Therefore the interval always contains
the exact Poisson interval of the number of episodes that exceed the threshold. For example, 45
minutes without an alarm do not exclude two alarms per hour with 80 % confidence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.detectors.thresholds.free_scores import FreeScores
from tauguard.detectors.thresholds.tail_model import (
    BEYOND_CHANCE,
    Tail,
    shape_error,
    tail_fraction,
)
from tauguard.findings import ArgumentError
from tauguard.report import poisson_rate, two_digits

#: Bounds of the tail's shape unless the peaks show an end of the tail; then the lowest is LOWEST.
SHAPES, LOWEST = (0.0, 0.5), -0.5
#: Number of bootstrap draws.
DRAWS = 200


@dataclass(frozen=True, eq=False)
class ExpectedRate:
    """Rates of false alarms of one detector, by threshold."""

    blocks: tuple[Array, ...]  #: peaks of each episode's blocks, in ascending order
    draws: NDArray[np.int64]  #: number of times that a draw contains an episode, shape (D, E)
    tails: Tails  #: of the draws
    draw_hours: Array  #: total length of each draw [h], shape (D,)
    highest: Array  #: peak of each episode, shape (E,)
    hours: float  #: total length of all episodes [h]

    @classmethod
    def of(cls, scores: Sequence[FreeScores]) -> ExpectedRate:
        """The rates from scores of collision-free episodes.

        Raises:
            ArgumentError: no episodes.
        """
        if not scores:
            raise ArgumentError("no collision-free motion to estimate a rate of false alarms from")
        blocks = tuple(np.sort(one.blocks()[0]) for one in scores)
        highest = np.array([one.peak for one in scores])
        hours = np.array([one.seconds for one in scores]) / 3600
        draws = _draws(len(scores))
        own = draws @ hours
        tails = Tails.of(blocks, draws, own, tail_fraction(max(one.interval for one in scores)))
        return cls(blocks, draws, tails, own, highest, float(hours.sum()))

    def rates(self, threshold: float) -> Array:
        """The rate of each draw, counted or from its tail if alarms are rare [1/h], shape (D,)."""
        found = self.tails.above(threshold)
        counted = threshold <= self.tails.base
        if counted.any():
            above = [len(b) - np.searchsorted(b, threshold, side="right") for b in self.blocks]
            found[counted] = (self.draws[counted] @ np.array(above)) / self.draw_hours[counted]
        return found

    def interval(self, threshold: float, confidence: float = 0.95) -> tuple[float, float]:
        """Interval of the rate from the bootstrap and the count of episodes with alarms [1/h]."""
        side = (1 - confidence) / 2
        low, high = np.quantile(self.rates(threshold), (side, 1 - side))
        seen = poisson_rate(int(np.sum(self.highest > threshold)), self.hours, confidence)
        return min(float(low), seen["low"]), max(float(high), seen["high"])

    def at(self, threshold: float, requested: float) -> str:
        """Text: the requested rate [1/h] beside the 95 % interval of the rate at a threshold."""
        low, high = map(two_digits, self.interval(threshold))
        return (
            f"requested: {requested:g} false alarms per hour; 95 % interval of the rate in the "
            f"{max(1, round(60 * self.hours))} min of motion on which the threshold was set: "
            f"{low} to {high}"
        )


@dataclass(frozen=True)
class Tails:
    """The tails of all draws, shape (D,) each."""

    base: Array
    scale: Array
    shape: Array
    per_hour: Array  #: rate of peaks above the base [1/h]

    @classmethod
    def of(
        cls, blocks: Sequence[Array], draws: NDArray[np.int64], hours: Array, fraction: float
    ) -> Tails:
        """Tails of the highest ``fraction`` of each draw's blocks; ``hours``: lengths of draws."""
        together = np.concatenate(blocks)
        order = np.argsort(together)
        together = together[order]
        episode = np.repeat(np.arange(len(blocks)), [len(b) for b in blocks])[order]
        shapes = _shapes(together[::-1], fraction)
        rows = []
        for counts, own in zip(draws, hours, strict=True):
            peaks = np.repeat(together, counts[episode])
            tail = Tail.of(peaks[::-1], max(2, round(fraction * len(peaks))), shapes)
            rows.append((tail.base, tail.scale, tail.shape, tail.count / own))
        return cls(*np.array(rows).T)

    def above(self, threshold: float) -> Array:
        """Rate of peaks above a threshold in each draw [1/h], shape (D,).

        Valid for thresholds at or above the base of the draw's tail.
        """
        far = np.maximum(threshold - self.base, 0.0) / np.where(self.scale > 0, self.scale, np.inf)
        steep = np.where(np.abs(self.shape) < 1e-9, 1e-9, self.shape)
        inside = steep * far > -1  # a tail of negative shape ends at 1 + shape * far = 0
        grown = np.log1p(np.where(inside, steep * far, 0.0)) / steep
        found: Array = np.where(inside, self.per_hour * np.exp(-grown), 0.0)
        return found


def _draws(episodes: int) -> NDArray[np.int64]:
    """Number of times that each bootstrap draw contains each episode, shape (DRAWS, episodes)."""
    rng = np.random.default_rng(0)
    again = (rng.integers(episodes, size=episodes) for _ in range(DRAWS))
    return np.stack([np.bincount(one, minlength=episodes) for one in again])


def _shapes(peaks: Array, fraction: float) -> tuple[float, float]:
    """Bounds of the shape of the draws' tails, from all peaks in descending order."""
    whole = Tail.of(peaks, max(2, round(fraction * len(peaks))), (LOWEST, SHAPES[1]))
    margin = BEYOND_CHANCE * shape_error(whole.count)
    return max(LOWEST, min(SHAPES[0], whole.shape + margin)), SHAPES[1]
