"""Whether a threshold for a rate of false alarms keeps to it, on ten arms of fresh seeds.

Every arm has its own detectors, trained as in the detection study, and thresholds from its own
collision-free motion with the training payloads. What is counted is other collision-free motion of
that arm, with payloads that were in no recording before. Nothing is struck, so the study is cheap
enough for many arms: one arm tells little of a rate, since a bad moment of one returns in all of
its motion.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tauguard.benchmarks.detection.arm_scores import Arm, Extent, arm_scores
from tauguard.benchmarks.detection.fleet import Training
from tauguard.benchmarks.kept import Kept
from tauguard.benchmarks.workers import Workers
from tauguard.detectors import poisson_rate
from tauguard.detectors.thresholds.free_scores import speed_levels
from tauguard.detectors.thresholds.law import rate_interval, threshold_for_rate
from tauguard.report import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Detectors of the study: the one that is shipped, and thresholds on the same residual.
NAMES = ("srq-svr", "moving-thresholds")

#: How a threshold is chosen: the one expected to give the rate, or one that would be enough in this
#: share of all calibrations.
LAWS: dict[str, float | None] = {"expected": None, "80 % bound": 0.8}

#: What the columns of each table mean.
NOTES = {
    "arms": "thresholds that aim at asked_per_hour, from the calibration motion of each arm; "
    "found_per_hour is of all arms' fresh motion together, with its exact 95 % interval. stated: "
    "the 95 % interval that the calibration alone gives at the threshold, median over the arms. "
    "kept: the rate asked lies in or above the interval found; arms_kept: the same arm by arm. "
    "Missed collisions are not in it.",
}


@dataclass(frozen=True)
class Size:
    """How much is simulated."""

    arms: int
    asked: tuple[float, ...]  #: false alarms per hour
    extent: Extent  #: of each arm


FULL = Size(10, (0.25, 1.0, 5.0), Extent(NAMES, Training(), 0.75, 1.4, 1))
QUICK = Size(
    2, (5.0, 30.0), Extent(NAMES, Training(slices=5, free=6, free_seconds=20.0), 0.1, 0.05, 0)
)


def arms_of(
    size: Size, seed: int, workers: int | None = None, keep: str | None = None
) -> list[Arm]:
    """Train, simulate and score; the same for any number of workers.

    Arms that the folder ``keep`` holds are read.
    """
    seeds = [51_000 + 100 * seed + k for k in range(size.arms)]
    kept = Kept.of(keep, "false_alarms", seed, size.extent)
    with Workers(workers) as each:
        jobs = [(size.extent, seed, arm) for arm in seeds]
        return list(kept.over(each, "arm")(arm_scores, jobs))


def run(quick: bool, seed: int, keep: str | None = None) -> list[Row]:
    """Rows ``arms``: a row per detector, way to choose the threshold, and rate asked for."""
    size = QUICK if quick else FULL
    arms = arms_of(size, seed, keep=keep)
    cases = itertools.product(NAMES, LAWS, size.asked)
    return [row_of(arms, name, law, asked) for name, law, asked in cases]


def row_of(arms: Sequence[Arm], name: str, law: str, asked: float) -> Row:
    """What one way to choose thresholds gives on all arms."""
    counts, hours, stated, kept = [], [], [], 0
    for arm in arms:
        levels = speed_levels(arm.calibration[name])
        known = [one.over(levels) for one in arm.calibration[name]]
        fresh = [one.over(levels) for one in arm.fresh[name]]
        threshold = threshold_for_rate(known, asked, LAWS[law])
        stated.append(rate_interval(known, threshold))
        counts.append(sum(one.alarms(threshold) for one in fresh))
        hours.append(sum(one.seconds for one in fresh) / 3600)
        kept += bool(poisson_rate(counts[-1], hours[-1])["low"] <= asked)
    found = poisson_rate(sum(counts), sum(hours))
    low, high = np.median(stated, axis=0)
    return {
        "study": "arms",
        "detector": name,
        "threshold": law,
        "asked_per_hour": asked,
        "stated_low": float(low),
        "stated_high": float(high),
        "found_per_hour": found,
        "alarms": sum(counts),
        "fresh_hours": sum(hours),
        "kept": bool(found["low"] <= asked),
        "arms": len(arms),
        "arms_kept": kept,
        "by_arm": " ".join(map(str, counts)),
    }


def draw(rows: list[Row], figure: Figure) -> None:
    """Rate found, with its interval, over the rate asked for."""
    axes = figure.add_subplot()
    for k, (name, law) in enumerate(dict.fromkeys((r["detector"], r["threshold"]) for r in rows)):
        own = [r for r in rows if (r["detector"], r["threshold"]) == (name, law)]
        at = [r["asked_per_hour"] * 1.05 ** (k - 1.5) for r in own]
        value = np.array([r["found_per_hour"]["value"] for r in own])
        low = value - [r["found_per_hour"]["low"] for r in own]
        high = np.array([r["found_per_hour"]["high"] for r in own]) - value
        axes.errorbar(at, value, [low, high], fmt="o", capsize=3, label=f"{name}, {law}")
    asked = sorted({r["asked_per_hour"] for r in rows})
    axes.plot(asked, asked, "k--", label="as asked")
    axes.set(xscale="log", yscale="symlog", xlabel="false alarms per hour, asked for")
    axes.set(ylabel="counted on fresh motion", title="False alarms of arms nothing was set on")
    axes.legend()
    axes.grid(alpha=0.3)
