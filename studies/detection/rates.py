"""Requested and counted false alarms on fresh arms, and the collisions found.

Every arm has its own detectors and thresholds from its own collision-free motion with the training
payloads. Alarms are counted on other motion of that arm, with payloads that were in no recording.
One arm says little about a rate, because its model errors recur in all of its motion.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from studies.detection.motions import (
    CALIBRATE,
    SPEEDS,
    TEST,
    Conditions,
    Training,
    free_pool,
    stream,
    struck_pool,
)
from studies.detection.operating import (
    Operated,
    Tallies,
    Tally,
    free_scores,
    joined,
    merged,
    on_free,
    on_struck,
    trained,
)
from studies.framework import JobCache, Workers
from tauguard.datasets.plans import TRAINING_PAYLOADS
from tauguard.detectors import CollisionAlarm, FittedMethod, poisson_rate
from tauguard.detectors.alarms.training import normalised
from tauguard.detectors.evaluation.matching import HEADLINE, delay_metrics
from tauguard.detectors.thresholds.free_scores import FreeScores
from tauguard.detectors.thresholds.guarantee import guaranteed_threshold
from tauguard.detectors.thresholds.tail_model import threshold_for_rate
from tauguard.envs import simulate
from tauguard.report import Row, rate
from tauguard.traces import STRATA, Trace, resampled

#: How a threshold is chosen: expected to give a rate, or guaranteed not to exceed it.
AIMED, GUARANTEED = "aimed at", "guaranteed"

#: What the columns of the table mean.
NOTES = {
    "false alarms": "thresholds from each arm's calibration motion for a requested rate of false "
    "alarms per hour: aimed at, as `train` chooses them, or guaranteed with 95 % confidence "
    "(conformal). found: rate in other motion of all these arms, with its exact 95 % interval; "
    "kept: fraction of the arms whose own interval begins at or below the requested rate; refused: "
    "arms whose calibration is too short for the guarantee. sensitivity: of collisions from 16 N m "
    "up; all: from 4 N m up; delays of those from 16 N m up [ms].",
}


@dataclass(frozen=True)
class Size:
    """Amount of simulated motion."""

    arms: int
    names: tuple[str, ...]  #: names of the detectors
    asked: tuple[float, ...]  #: wanted rates of false alarms [1/h]
    training: Training
    calibration_hours: float  #: motion per arm from which thresholds are set
    hours: float  #: other collision-free motion per arm, for the test
    per_stratum: int  #: test collisions per stratum and speed
    under: Conditions = field(default_factory=Conditions)


NAMES = ("srq-svr", "moving-thresholds")
FULL = Size(6, NAMES, (0.25, 1.0, 5.0), Training(), 0.75, 1.0, 1)
LITTLE = Training(slices=4, free=4, free_seconds=20.0)
QUICK = Size(1, NAMES, (5.0, 30.0), LITTLE, 0.05, 0.03, 0)


def measure(quick: bool, seed: int, keep: str | None = None) -> list[Row]:
    """Rows ``false alarms``: one per detector, wanted rate and way to choose the threshold."""
    size = QUICK if quick else FULL
    jobs = [(size, seed, 51_000 + 100 * seed + k) for k in range(size.arms)]
    with Workers() as each:
        cache = JobCache.of(keep, "false_alarms", seed, size)
        arms = list(cache.over(each, "arm")(arm_tallies, jobs))
    return [
        {"study": "false alarms", "detector": name, "threshold": way, "asked": asked}
        | _counted(arms, name, way, asked)
        for name in size.names
        for way in (AIMED, GUARANTEED)
        for asked in size.asked
    ]


def _counted(arms: Sequence[Tallies], name: str, way: str, asked: float) -> Row:
    tallies = [arm[name, point(way, asked)] for arm in arms if (name, point(way, asked)) in arm]
    rates = [poisson_rate(tally.false_alarms, tally.free_seconds / 3600) for tally in tallies]
    whole = merged({("", ""): tally} for tally in tallies).get(("", ""), Tally())
    row = collisions(whole, 1.0)
    return {
        "found": row.pop("false_alarms_per_hour"),
        "kept": rate(sum(one["low"] <= asked for one in rates), len(rates)),
        "refused": len(arms) - len(tallies),
        **row,
    }


def collisions(tally: Tally, share: float) -> Row:
    """Collisions found on an arm whose torques are ``share`` of the CURA6-like arm's."""
    pairs = [(outcome.collision.peak_tau, outcome.delay) for outcome in tally.outcomes]
    hard = [delay for torque, delay in pairs if torque >= share * HEADLINE]
    every = [delay for torque, delay in pairs if torque >= share * STRATA[0][0]]
    delays = delay_metrics(hard)
    return {
        "sensitivity": rate(sum(d is not None for d in hard), len(hard)),
        "all": rate(sum(d is not None for d in every), len(every)),
        "median_ms": delays["median"],
        "p95_ms": delays["p95"],
        "false_alarms_per_hour": poisson_rate(tally.false_alarms, tally.free_seconds / 3600),
    }


def point(way: str, asked: float) -> str:
    """The name of an operating point."""
    return f"{way} {asked:g}/h"


def arm_tallies(job: tuple[Size, int, int]) -> Tallies:
    """Train, set thresholds and test on the arm ``job[2]``, with the study's seed ``job[1]``."""
    return tallies_by_rate((*job, (None,)))[0]


def tallies_by_rate(job: tuple[Size, int, int, Sequence[float | None]]) -> list[Tallies]:
    """:func:`arm_tallies` for one motion at several sample rates [Hz]; None: as simulated."""
    size, seed, arm, rates = job
    payloads = tuple(sorted(map(float, set(TRAINING_PAYLOADS))))
    known, hours = replace(size.under, payloads=payloads), size.calibration_hours / len(SPEEDS)
    slices = size.training.traces(seed, arm, size.under)
    logs = [trained([_logged(t, hz) for t in slices], size.names, size.under) for hz in rates]
    del slices
    pools = [free_pool(stream(seed, CALIBRATE, 9), v, (arm,), hours, known) for v in SPEEDS]
    parts = []
    for trace in (simulate(episode) for pool in pools for _, episode in pool):
        parts.append(
            [free_scores(d, _logged(trace, hz)) for d, hz in zip(logs, rates, strict=True)]
        )
    fleets = [
        {n: Operated(d, dict(_alarms(d, scores[n], size.asked))) for n, d in detectors.items()}
        for detectors, scores in zip(logs, map(joined, zip(*parts, strict=True)), strict=True)
    ]
    judged = list(_judged(size, seed, arm, [*zip(fleets, rates, strict=True)]))
    return [merged(own) for own in zip(*judged, strict=True)]


def _logged(trace: Trace, hz: float | None) -> Trace:
    return trace if hz is None else resampled(trace, hz)


def _alarms(
    detector: FittedMethod, scores: Sequence[FreeScores], asked: Sequence[float]
) -> Iterator[tuple[str, CollisionAlarm]]:
    aimed, levels = normalised(detector, scores)
    for per_hour in asked:
        yield (
            point(AIMED, per_hour),
            replace(aimed, threshold=threshold_for_rate(levels, per_hour)),
        )
        try:
            held = guaranteed_threshold(scores, per_hour).threshold
        except ValueError:
            continue  # too little motion for a guarantee; the row counts such arms
        yield point(GUARANTEED, per_hour), CollisionAlarm(detector, held)


def _judged(
    size: Size, seed: int, arm: int, fleets: Sequence[tuple[dict[str, Operated], float | None]]
) -> Iterator[list[Tallies]]:
    fresh, struck = stream(seed, TEST, 9), stream(seed, TEST, 10, arm)
    for k, speed in enumerate(SPEEDS):
        for _, episode in free_pool(fresh, speed, (arm,), size.hours / len(SPEEDS), size.under):
            trace = simulate(episode)
            yield [on_free(fleet, _logged(trace, hz)) for fleet, hz in fleets]
        if size.per_stratum:
            pool = struck_pool(
                struck, speed, (arm,), size.per_stratum, conditions=size.under, first=k
            )
            for one in pool:
                logs = [(fleet, _logged(one.trace, hz)) for fleet, hz in fleets]
                yield [on_struck(fleet, replace(one, trace=log)) for fleet, log in logs]
