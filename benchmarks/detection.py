"""The dissertation's experiment on simulated arms: detectors, speeds, operating points.

Every arm differs from the nominal one within the measured magnitudes; its detectors are trained on
its own 15 slices with the dissertation's payloads, and judged on motions with payloads that no
slice had and nobody tells.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tauguard.benchmarks import detection_report as report
from tauguard.benchmarks import detection_table
from tauguard.benchmarks import detection_variations as variations
from tauguard.benchmarks.detection_fleet import (
    TEST,
    Fleet,
    Training,
    common_thresholds,
    stream,
    train,
)
from tauguard.benchmarks.detection_judge import (
    Tallies,
    Thresholds,
    judge_free,
    judge_struck,
    merged,
)
from tauguard.benchmarks.detection_pool import (
    FAINT,
    FAINT_FORCES,
    FORCES,
    SPEEDS,
    free_pool,
    struck_pool,
)
from tauguard.benchmarks.report import Row
from tauguard.benchmarks.workers import Workers
from tauguard.envs import simulate
from tauguard.traces import STRATA

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Size:
    """How much is simulated."""

    arms: int  #: judged, each with its own detectors
    detectors: tuple[str, ...]
    training: Training
    calibration_hours: float  #: collision-free, for the thresholds, of each arm
    hours: float  #: collision-free, judged, all speeds and arms together
    short: float  #: of them, those that all detectors judge; the rest only the first one
    per_stratum: int  #: judged collisions of a stratum at one speed
    faint: int  #: the same below the judged strata
    target: float = 0.5  #: false alarms per hour that the third threshold aims at
    variations: bool = False  #: also training size, sigma, conditions, sample rate


ALL = (
    "srq-svr",
    "srq-svr-plain",
    "current-network",
    "current-threshold",
    "residual-thresholds",
    "moving-thresholds",
    "cusum",
    "one-class",
    "window-network",
    "boosting",
)
#: Those whose need for collisions is compared.
LEARNERS = ("srq-svr", "window-network", "boosting")
PARTS = ("conditions", "training_size", "sigma", "sample_rate")
FULL = Size(3, ALL, Training(), 0.5, 10.0, 1.0, 13, 5, variations=True)
QUICK = Size(
    1,
    ("srq-svr", "srq-svr-plain", "current-network", "residual-thresholds"),
    Training(free=10, free_seconds=30.0),
    0.1,
    0.1,
    0.1,
    2,
    0,
)


def run(quick: bool, seed: int) -> list[Row]:
    """Rows of all studies; see :mod:`tauguard.benchmarks.detection_report` for their fields."""
    return study(QUICK if quick else FULL, seed)


def study(size: Size, seed: int, workers: int | None = None) -> list[Row]:
    """Train, judge, report; the result does not depend on the number of ``workers``."""
    arms = [1000 * (seed + 1) + k for k in range(size.arms)]
    with Workers(workers) as each:
        fleets = list(each(_train, [(size, seed, arm) for arm in arms]))
        thresholds = common_thresholds(fleets, size.target)
        jobs = [(size, seed, speed, arm) for speed in SPEEDS for arm in (*arms, 0)]
        tallies = dict(
            zip(
                [(job[2], job[3]) for job in jobs],
                each(_judge, [(job, fleets, thresholds) for job in jobs]),
                strict=True,
            )
        )
        by_speed = {
            speed: merged(t for (own, _), t in tallies.items() if own == speed) for speed in SPEEDS
        }
        rows = report.rows(by_speed, thresholds)
        rows += detection_table.headline(rows)
        if size.variations:
            jobs_more = [(part, fleets, thresholds, seed) for part in PARTS]
            for more in each(_vary, jobs_more):
                rows += more
    return rows


def _train(job: tuple[Size, int, int]) -> Fleet:
    size, seed, arm = job
    return train(seed, arm, size.detectors, size.training, size.calibration_hours)


def _vary(job: tuple[str, Sequence[Fleet], Thresholds, int]) -> list[Row]:
    part, fleets, thresholds, seed = job
    extent = variations.Extent()
    if part == "conditions":
        return variations.conditions(fleets, thresholds, seed, extent)
    bench = variations.Bench(seed, fleets[0].arm, extent)
    if part == "training_size":
        return variations.training_size(bench, LEARNERS)
    return {"sigma": variations.sigmas, "sample_rate": variations.sample_rate}[part](bench)


def _judge(job: tuple[tuple[Size, int, float, int], Sequence[Fleet], Thresholds]) -> Tallies:
    """One speed: an arm's free motion, or (arm 0) the collisions of all arms."""
    (size, seed, speed, arm), fleets, thresholds = job
    test = stream(seed, TEST)
    by_arm = {fleet.arm: fleet.detectors for fleet in fleets}
    if arm:
        share = 1 / len(SPEEDS) / size.arms
        pool = free_pool(test, speed, (arm,), share * size.hours)
        early = len(free_pool(test, speed, (arm,), share * size.short))
        first = {name: d for name, d in list(by_arm[arm].items())[:1]}
        return merged(
            judge_free(by_arm[arm] if k < early else first, thresholds, simulate(episode))
            for k, (_, episode) in enumerate(pool)
        )
    pools = [(STRATA, size.per_stratum, FORCES), (FAINT, size.faint, FAINT_FORCES)]
    return merged(
        judge_struck(by_arm[struck.arm], thresholds, struck)
        for k, (strata, count, forces) in enumerate(pools)
        if count
        for struck in struck_pool(test + k, speed, list(by_arm), count, strata, forces)
    )


def shown(rows: list[Row]) -> list[Row]:
    """See :func:`tauguard.benchmarks.detection_table.shown`."""
    return detection_table.shown(rows)


def draw(rows: list[Row], figure: Figure) -> None:
    """See :func:`tauguard.benchmarks.detection_report.draw`."""
    report.draw(rows, figure)
