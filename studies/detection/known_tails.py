"""Threshold laws on scores whose rate above every threshold is known: the truth is exact.

A calibration is 45 episodes of a minute; the peaks of their blocks are drawn. What a threshold
gives is not counted but computed, so that many calibrations can be compared at rates that no
simulated motion is long enough for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import stats

from studies.detection.threshold_laws import LAWS
from tauguard.arrays import Array
from tauguard.detectors import FreeScores
from tauguard.detectors.thresholds.expected_rate import ExpectedRate
from tauguard.report import Row
from tauguard.report import rate as wilson

#: Episodes of a calibration, and blocks in a minute.
EPISODES, BLOCKS = 45, 120
#: Bootstrap samples of a mean rate, which is skewed.
RESAMPLES = 4000
#: Standard deviation of the logarithm of an episode's scale, where episodes differ.
SPREAD = 0.4
#: Rare moments: how many an hour, the least peak, and the mean excess of their peaks.
RARE, BEGIN, EXCESS = 2.0, 6.0, 10.0


@dataclass(frozen=True)
class Tail:
    """How the peaks of blocks are drawn, and how often an hour they exceed a threshold."""

    draw: Callable[[np.random.Generator], Array]  #: shape (EPISODES, BLOCKS)
    rate: Callable[[float], float]  #: [1/h]


def _pareto(shape: float) -> Tail:
    known = stats.genpareto(shape)
    return Tail(
        lambda rng: known.rvs((EPISODES, BLOCKS), random_state=rng),
        lambda threshold: 60 * BLOCKS * float(known.sf(threshold)),
    )


def _differing() -> Tail:
    """Every episode has a scale of its own, lognormal."""
    scales = np.exp(SPREAD * stats.norm.ppf((np.arange(2000) + 0.5) / 2000))

    def draw(rng: np.random.Generator) -> Array:
        own = np.exp(SPREAD * rng.standard_normal((EPISODES, 1)))
        drawn: Array = own * rng.exponential(size=(EPISODES, BLOCKS))
        return drawn

    return Tail(draw, lambda threshold: 60 * BLOCKS * float(np.mean(np.exp(-threshold / scales))))


def _rare() -> Tail:
    """Exponential, and a few moments an hour that are far above the rest."""
    chance = RARE / (60 * BLOCKS)

    def draw(rng: np.random.Generator) -> Array:
        drawn: Array = rng.exponential(size=(EPISODES, BLOCKS))
        peaks = BEGIN + EXCESS * rng.exponential(size=drawn.shape)
        found: Array = np.where(rng.random(drawn.shape) < chance, peaks, drawn)
        return found

    def rate(threshold: float) -> float:
        rare = RARE * np.exp(-max(threshold - BEGIN, 0.0) / EXCESS)
        return float((60 * BLOCKS - RARE) * np.exp(-threshold) + rare)

    return Tail(draw, rate)


TAILS: dict[str, Tail] = {
    "exponential": _pareto(0.0),
    "heavy (shape 0.15)": _pareto(0.15),
    "ends (shape -0.3)": _pareto(-0.3),
    "episodes differ": _differing(),
    "rare moments": _rare(),
}


def rows(calibrations: int, asked: tuple[float, ...], seed: int) -> list[Row]:
    """``known``: a row for every tail, law and rate asked for."""
    found: list[Row] = []
    for name, tail in TAILS.items():
        rng = np.random.default_rng([seed, 17])
        true: dict[tuple[str, float], list[tuple[float, bool]]] = {}
        for _ in range(calibrations):
            known = [FreeScores(peaks, np.ones(BLOCKS), 60.0) for peaks in tail.draw(rng)]
            expected = ExpectedRate.of(known)
            for law, choose in LAWS.items():
                for rate in asked:
                    threshold = choose(known, expected, rate)
                    low, high = expected.interval(threshold)
                    real = tail.rate(threshold)
                    true.setdefault((law, rate), []).append((real, low <= real <= high))
        found += [_row(name, *key, pairs) for key, pairs in true.items()]
    return found


def _row(name: str, law: str, asked: float, pairs: list[tuple[float, bool]]) -> Row:
    rates = np.array([rate for rate, _ in pairs])
    again = np.random.default_rng(0).integers(len(rates), size=(RESAMPLES, len(rates)))
    low, high = np.quantile(rates[again].mean(axis=1), (0.025, 0.975))
    return {
        "study": "known",
        "tail": name,
        "law": law,
        "asked": asked,
        "mean_per_hour": {
            "value": float(rates.mean()),
            "low": float(low),
            "high": float(high),
            "n": len(rates),
        },
        "median_per_hour": float(np.median(rates)),
        "at_most_asked": wilson(int(np.sum(rates <= asked)), len(rates)),
        "inside": wilson(sum(inside for _, inside in pairs), len(rates)),
    }
