"""The dissertation's experiment on simulated arms: detectors, speeds, operating points.

Every arm differs from the nominal one within the measured magnitudes; its detectors are trained on
its own 15 slices with the dissertation's payloads, get their thresholds from other motion of that
arm, and are judged on motions with payloads that no slice had and nobody tells.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from studies.detection import chart as detection_chart
from studies.detection import foreign, variations
from studies.detection import rows as report
from studies.detection import table as detection_table
from studies.detection.fleet import (
    NETWORK,
    TEST,
    Training,
    calibration_scores,
    stream,
    train,
    training_groups,
)
from studies.detection.judge import Tallies, judge_free, judge_struck, merged
from studies.detection.oracle import ORACLE, oracle
from studies.detection.pool import (
    FAINT,
    FAINT_FORCES,
    FORCES,
    SPEEDS,
    free_pool,
    struck_pool,
)
from studies.detection.thresholds import Fleet, Free, operated
from studies.framework import Each, Incomplete, JobCache, Workers
from tauguard.detectors import FittedDetector, make_detector
from tauguard.envs import simulate
from tauguard.report import Row
from tauguard.traces import STRATA

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_JUDGED = (
    "sensitivity: of the collisions from 16 N m up (achieved peak of the external torque, joints 1 "
    "to 4), "
)
#: The chart's size [in].
SIZE = (13.0, 8.5)

#: What the columns of each table mean.
NOTES = {
    "speed": _JUDGED + "and specificity, of collision-free cases of 2 s; by percent of the largest "
    "speed. threshold_a: the operating point [A]; threshold: of each arm's own, median [least, "
    "most]. All arms and collisions are simulated.",
    "hourly": _JUDGED + "all speeds, at thresholds that aim at 0.25 false alarms an hour; "
    "alarms_per_hour: what came of it in so many hours. Delays from the touch [ms]. tau98: the "
    "least torque above which 98 % are found [N m], by speed.",
    "once": "the same at thresholds that aim at one false alarm an hour.",
    "floor": "the same collisions by an oracle that is given the true external torque: no detector "
    "that needs as much torque is sooner.",
    "strata": "found of all, by torque [N m]; what is below 4 N m counts in no other rate.",
    "dissertation": "TP, FN, FP, TN printed for a real arm beside ours for simulated ones: the "
    "same experiment, not the same collisions. Sensitivities are of all from 4 N m up.",
    "mcnemar": "exact test on the same collisions: found by the first detector only, by the other.",
    "output": "Spearman's between a collision's torque and the highest output.",
    "training_size": "at a threshold for 0.5 false alarms an hour, one speed and arm; few "
    "collisions, wide intervals.",
    "conditions": "what training did not have, at the third point, one speed and arm; nothing is "
    "learnt anew.",
    "robot": foreign.NOTE,
    "sigma": "the length of the SRQ kernel, at a threshold for 0.5 false alarms an hour, one speed "
    "and arm.",
    "sample_rate": "a kilohertz beside the rate of the arm in the dissertation.",
    "headline": "the best detector (one for all cells) and SVR-SRQ beside the dissertation's SVR. "
    "met: both rates of the best reach 0.98, and both of SVR-SRQ's the dissertation's.",
}

Trained = Mapping[int, dict[str, FittedDetector]]


@dataclass(frozen=True)
class Size:
    """How much is simulated."""

    arms: int  #: judged, each with its own detectors
    detectors: tuple[str, ...]
    training: Training
    calibration_hours: float  #: collision-free, for the thresholds, of each arm
    hours: float  #: collision-free, judged, all speeds and arms together
    short: float  #: of them, those that all detectors judge; the rest only the thorough ones
    per_stratum: int  #: judged collisions of a stratum at one speed
    faint: int  #: the same below the judged strata
    target: float = 0.25  #: false alarms per hour that the third threshold aims at
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
#: Those that judge all of the collision-free motion.
THOROUGH = ("srq-svr",)
PARTS = ("training_size", "conditions", "sigma", "sample_rate")
FULL = Size(3, ALL, Training(), 0.75, 10.0, 1.0, 13, 5, variations=True)
#: Collision-free motion of a quick run, to calibrate and again to judge: an episode a speed [h].
SIX_MINUTES = 0.095
QUICK = Size(
    1,
    ("srq-svr", "current-network", "residual-thresholds"),
    Training(slices=5, free=4, free_seconds=20.0),
    SIX_MINUTES,
    SIX_MINUTES,
    SIX_MINUTES,
    1,
    0,
)


def measure(
    quick: bool,
    seed: int,
    detector: str | None = None,
    keep: str | None = None,
    robot: str | None = None,
) -> list[Row]:
    """Rows of all studies; see :mod:`studies.detection.rows` for their fields.

    Args:
        quick: a small run.
        seed: of all arms and motions.
        detector: one more method, as module:Class.
        keep: folder of what is done already, and goes on being done.
        robot: these arms instead, parted by commas: rows ``robot`` alone.
    """
    if robot is not None:
        if detector is not None:
            raise ValueError("--detector, --robot: one of them; robots have detectors of their own")
        return foreign.run([name.strip() for name in robot.split(",")], quick, seed, keep)
    size = QUICK if quick else FULL
    if detector is not None and detector not in size.detectors:
        make_detector(detector)  # names what is wrong before anything is simulated
        size = replace(size, detectors=(*size.detectors, detector))
    return study(size, seed, kept=JobCache.of(keep, "detection", seed, size))


def study(
    size: Size, seed: int, workers: int | None = None, kept: JobCache | None = None
) -> list[Row]:
    """Train, judge, report; the result does not depend on the number of ``workers``."""
    kept = kept or JobCache(None)
    arms = [1000 * (seed + 1) + k for k in range(size.arms)]
    with Workers(workers) as each:
        trained = _trained(size, seed, arms, kept.over(each, "train"))
        fleets = _calibrated(size, seed, trained, kept.over(each, "free"))
        parts = [(part, arms[0], fleets[arms[0]], seed) for part in PARTS]
        jobs = [(size, seed, speed, arm) for speed in SPEEDS for arm in (0, *arms)]
        judged = kept.over(each, "judged")(_judge, [(job, fleets) for job in jobs])
        vary = kept.over(each, "variation")
        more = vary(_vary, parts if size.variations else [])  # whoever is done goes on with it
        tallies = list(judged)
        by_speed = {
            speed: merged(t for (*_, own, _), t in zip(jobs, tallies, strict=True) if own == speed)
            for speed in SPEEDS
        }
        rows = report.rows(by_speed, report.spread(list(fleets.values())))
        rows += detection_table.headline(rows)
        return rows + _with_variations(rows, (part for part, *_ in parts), more)


def _with_variations(rows: list[Row], parts: Iterable[str], more: Iterator[list[Row]]) -> list[Row]:
    """The rows of the variations; one that fails does not take the others along."""
    found: list[Row] = []
    failed: dict[str, BaseException] = {}
    for part in parts:
        try:
            found += next(more)
        except StopIteration:
            break
        except Exception as error:
            failed[part] = error
    if failed:
        raise Incomplete(rows + found, failed)
    return found


def _trained(size: Size, seed: int, arms: Sequence[int], each: Each) -> Trained:
    """Every arm's detectors, in the order of their names."""
    groups = training_groups(size.detectors)
    jobs = [(size, seed, arm, group) for arm in arms for group in groups]
    found: dict[int, dict[str, FittedDetector]] = {arm: {} for arm in arms}
    for (_, _, arm, _), own in zip(jobs, each(_train, jobs), strict=True):
        found[arm].update(own)
    return {arm: {name: own[name] for name in size.detectors} for arm, own in found.items()}


def _train(job: tuple[Size, int, int, tuple[str, ...]]) -> dict[str, FittedDetector]:
    size, seed, arm, group = job
    return train(seed, arm, group, size.training)


def _calibrated(size: Size, seed: int, trained: Trained, each: Each) -> dict[int, Fleet]:
    """Every arm's detectors with their alarms, from that arm's own motion."""
    hours = size.calibration_hours / len(SPEEDS)
    jobs = [(seed, arm, own, speed, hours) for arm, own in trained.items() for speed in SPEEDS]
    free: dict[int, dict[float, Free]] = {arm: {} for arm in trained}
    for (_, arm, _, speed, _), found in zip(jobs, each(_calibrate, jobs), strict=True):
        free[arm][speed] = found
    network = NETWORK if NETWORK in size.detectors else None
    return {arm: operated(own, free[arm], network, size.target) for arm, own in trained.items()}


def _calibrate(job: tuple[int, int, dict[str, FittedDetector], float, float]) -> Free:
    return calibration_scores(*job)


def _vary(job: tuple[str, int, Fleet, int]) -> list[Row]:
    part, arm, fleet, seed = job
    extent = variations.Extent()
    if part == "conditions":
        return variations.conditions(fleet, arm, seed, extent)
    bench = variations.Bench(seed, arm, extent)
    if part == "training_size":
        return variations.training_size(bench, LEARNERS)
    return {"sigma": variations.sigmas, "sample_rate": variations.sample_rate}[part](bench)


def _judge(job: tuple[tuple[Size, int, float, int], Mapping[int, Fleet]]) -> Tallies:
    """One speed: an arm's free motion, or (arm 0) the collisions of all arms."""
    (size, seed, speed, arm), fleets = job
    test = stream(seed, TEST)
    if arm:
        share = 1 / len(SPEEDS) / size.arms
        pool = free_pool(test, speed, (arm,), share * size.hours)
        early = len(free_pool(test, speed, (arm,), share * size.short))
        thorough = {name: own for name, own in fleets[arm].items() if name in THOROUGH}
        return merged(
            judge_free(fleets[arm] if k < early else thorough, simulate(episode))
            for k, (_, episode) in enumerate(pool)
        )
    pools = [(STRATA, size.per_stratum, FORCES), (FAINT, size.faint, FAINT_FORCES)]
    return merged(
        judge_struck({**fleets[struck.arm], ORACLE: oracle()}, struck)
        for k, (strata, count, forces) in enumerate(pools)
        if count
        for struck in struck_pool(test + k, speed, list(fleets), count, strata, forces)
    )


def table(rows: list[Row]) -> list[Row]:
    """See :func:`studies.detection_table.shown`."""
    return detection_table.shown(rows)


def draw(rows: list[Row], figure: Figure) -> None:
    """See :func:`studies.detection_chart.draw`."""
    if all(row["study"] == "robot" for row in rows):
        foreign.draw(rows, figure)
    else:
        detection_chart.draw(rows, figure)
