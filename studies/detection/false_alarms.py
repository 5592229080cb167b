"""Whether a threshold for a rate of false alarms keeps to it, on ten arms of fresh seeds.

Every arm has its own detectors, trained as in the detection study, and thresholds from its own
collision-free motion with the training payloads. What is counted is other collision-free motion of
that arm, with payloads that were in no recording before. Nothing is struck, so the study is cheap
enough for many arms: one arm tells little of a rate, since a bad moment of one returns in all of
its motion.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

from studies.detection import known_tails
from studies.detection.arm_scores import Arm, Extent, arm_scores
from studies.detection.fleet import Training
from studies.detection.threshold_laws import LAWS, judged, price_row, rate_row
from studies.framework import JobCache, Workers
from tauguard.report import Row
from tauguard.report.charts import errorbars

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Detectors of the study: the one that is shipped, and thresholds on the same residual.
NAMES = ("srq-svr", "moving-thresholds")

#: Laws are compared on so many arms; the others say what came of it.
KNOWN = 5

#: What the columns of each table mean.
NOTES = {
    "known": "scores drawn from a tail that is known, so that the rate of a threshold is computed, "
    "not counted: its mean with 95 % interval and median over calibrations of 45 minutes, the "
    "share of them at or below the rate asked for, and of those whose stated interval holds it.",
    "arms": "thresholds that aim at asked [1/h], from the calibration motion of each arm. found: "
    "in these arms' fresh motion together, with its exact 95 % interval. stated: what the "
    "calibration alone allows (95 %, per hour), median over the arms. kept: share of arms whose "
    "interval of found reaches down to asked; inside: whose intervals of found and stated meet; "
    "alarms_an_arm: median [least, most].",
    "price": "what the same thresholds find of the collisions from 16 N m up, and of all from "
    "4 N m up; the delay of the former [ms].",
}


@dataclass(frozen=True)
class Size:
    """How much is simulated."""

    arms: int
    asked: tuple[float, ...]  #: false alarms per hour
    extent: Extent  #: of each arm
    calibrations: int  #: of scores whose rate is known


FULL = Size(10, (0.25, 1.0, 5.0), Extent(NAMES, Training(), 0.75, 1.4, 1), 40)
LITTLE = Training(slices=4, free=4, free_seconds=20.0)
QUICK = Size(1, (5.0, 30.0), Extent(NAMES, LITTLE, 0.05, 0.03, 0), 2)


def arms_of(
    size: Size, seed: int, workers: int | None = None, keep: str | None = None
) -> list[Arm]:
    """Train, simulate and score; the same for any number of workers.

    Arms that the folder ``keep`` holds are read.
    """
    seeds = [51_000 + 100 * seed + k for k in range(size.arms)]
    kept = JobCache.of(keep, "false_alarms", seed, size.extent)
    with Workers(workers) as each:
        jobs = [(size.extent, seed, arm) for arm in seeds]
        return list(kept.over(each, "arm")(arm_scores, jobs))


def measure(quick: bool, seed: int, keep: str | None = None) -> list[Row]:
    """Rows ``known``, ``arms`` and ``price``: of every law and rate asked for."""
    size = QUICK if quick else FULL
    arms = arms_of(size, seed, keep=keep)
    cases = itertools.product(NAMES, LAWS, size.asked)
    found = [judged(arms, *case) for case in cases]
    groups = {
        f"first {KNOWN}": slice(KNOWN),
        "others": slice(KNOWN, None),
        "all": slice(None),
    }
    split = groups if size.arms > KNOWN else {"all": slice(None)}
    known = known_tails.rows(size.calibrations, size.asked, seed)
    return known + [
        row
        for make in (rate_row, price_row)
        for case in found
        for group, part in split.items()
        if (row := make(case, group, case.arms[part]))
    ]


def draw(rows: list[Row], figure: Figure) -> None:
    """Rate found, with its interval, over the rate asked for."""
    axes = figure.add_subplot()
    rows = [r for r in rows if r["study"] == "arms" and r["arms"] == "all"]
    for k, (name, law) in enumerate(dict.fromkeys((r["detector"], r["law"]) for r in rows)):
        own = [r for r in rows if (r["detector"], r["law"]) == (name, law)]
        at = [r["asked"] * 1.05 ** (k - 2.5) for r in own]
        found = (r["found_per_hour"] for r in own)
        errorbars(axes, at, found, fmt="o", capsize=3, label=f"{name}, {law}")
    asked = sorted({r["asked"] for r in rows})
    axes.plot(asked, asked, "k--", label="as asked")
    axes.set(xscale="log", yscale="symlog", xlabel="false alarms per hour, asked for")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_ticks([], minor=True)
        axis.set_ticks(asked, [f"{rate:g}" for rate in asked])
    axes.set(ylabel="counted on fresh motion", title="False alarms of arms nothing was set on")
    axes.legend()
    axes.grid(alpha=0.3)
