"""The dissertation's experiment on simulated arms: detectors, speeds, operating points.

Every arm differs from the nominal arm by errors of measured magnitude. Its detectors are trained on
its own 15 slices with the dissertation's payloads, and their thresholds come from other motion of
that arm. They are tested on motions with other payloads, which no detector is given.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from studies.detection import rows as report
from studies.detection.motions import (
    FAINT,
    FAINT_FORCES,
    FORCES,
    SPEEDS,
    TEST,
    Conditions,
    Training,
    free_pool,
    stream,
    struck_pool,
)
from studies.detection.operating import (
    HOURLY,
    NETWORK,
    Fleet,
    Free,
    Tallies,
    calibration,
    merged,
    on_free,
    on_struck,
    operated,
    trained,
)
from studies.framework import Each, Incomplete, JobCache, Workers
from tauguard.detectors import FittedMethod, make_detector
from tauguard.envs import PayloadPick, simulate
from tauguard.report import Row
from tauguard.traces import STRATA

#: How rows are printed, and their figure.
table, draw = report.printed, report.draw

_JUDGED = (
    "sensitivity: of the collisions from 16 N m up (achieved peak of the external torque, joints 1 "
    "to 4), "
)
#: The figure's size [in].
SIZE = (11.0, 8.5)

#: What the columns of each table mean.
NOTES = {
    "speed": _JUDGED + "and specificity, of collision-free cases of 2 s; by percent of the largest "
    "speed. threshold_a: the operating point [A]; threshold: median over the arms [least, "
    "most]. All arms and collisions are simulated.",
    "hourly": _JUDGED + "all speeds, at thresholds that aim at 0.25 false alarms per hour; "
    "alarms_per_hour: measured rate, and its hours. Delays from the touch [ms]. Columns of "
    "speeds: tau98, the smallest torque above which 98 % are found [N m].",
    "strata": "collisions found / all, by torque [N m]; collisions below 4 N m count in no "
    "other table.",
    "dissertation": "TP, FN, FP, TN: theirs as printed for a real arm, ours for simulated arms in "
    "the same experiment. Sensitivities are of all collisions from 4 N m up.",
    "conditions": "conditions that training lacked, at the third operating point, for one "
    "speed and arm; detectors and thresholds stay the same.",
    "headline": "sensitivity / specificity of the best detector (one for all cells), of SVR-SRQ, "
    "and of the dissertation's SVR. met: both rates of the best detector reach 0.98, and both of "
    "SVR-SRQ reach those of the dissertation.",
}


@dataclass(frozen=True)
class Size:
    """Amount of simulated motion."""

    arms: int  #: number of arms, each with its own detectors
    detectors: tuple[str, ...]
    training: Training
    calibration_hours: float  #: collision-free motion per arm from which thresholds are set
    hours: float  #: collision-free test motion, all speeds and arms together
    per_stratum: int  #: test collisions per stratum and speed
    faint: int  #: test collisions per faint stratum and speed
    target: float = 0.25  #: false alarms per hour that the third threshold aims at
    conditions: bool = False  #: whether conditions that training lacks are tested, too


#: Detectors with the same front end are neighbours, so that it runs once for all of them.
ALL = (
    "srq-svr",
    "moving-thresholds",
    "srq-svr-plain",
    "residual-thresholds",
    "current-network",
)
#: The part ``false_alarms`` measures rates of false alarms, on more arms.
FULL = Size(3, ALL, Training(), 0.75, 2.0, 13, 5, conditions=True)
#: Collision-free motion of a quick run for calibration; the test has as much [h].
SIX_MINUTES = 0.095
QUICK = Size(
    1,
    ("srq-svr", "current-network", "residual-thresholds"),
    Training(slices=5, free=4, free_seconds=20.0),
    SIX_MINUTES,
    SIX_MINUTES,
    1,
    0,
)


#: Conditions that training did not have: speed [% of the maximum], how the arm is simulated.
CONDITIONS: dict[str, tuple[float, Conditions]] = {
    "as trained": (40.0, Conditions()),
    "payload 4.5 kg": (40.0, Conditions(payloads=(4500.0,))),
    "payload 6 kg": (40.0, Conditions(payloads=(6000.0,))),
    "gears at 10 degC": (40.0, Conditions(temperature=10.0)),
    "gears at 60 degC": (40.0, Conditions(temperature=60.0)),
    "mismatch doubled since training": (40.0, Conditions(scale=2.0)),
    "speed 80 %": (80.0, Conditions()),
}
#: Payloads that are picked up half-way [g]; an alarm that they raise is false.
TAKEN_UP = (1500.0, 2500.0, 3500.0)
PER_CONDITION = 5  #: collisions per stratum for each condition
HOURS = 0.1  #: collision-free motion for each condition [h]


def measure(
    quick: bool, seed: int, detector: str | None = None, keep: str | None = None
) -> list[Row]:
    """Rows of the tables that :data:`NOTES` names; ``detector`` is one more, as module:Class."""
    size = QUICK if quick else FULL
    if detector is not None and detector not in size.detectors:
        make_detector(detector)  # raises for a bad name before anything is simulated
        size = replace(size, detectors=(*size.detectors, detector))
    cache = JobCache.of(keep, "detection", seed, size)
    arms = [1000 * (seed + 1) + k for k in range(size.arms)]
    with Workers() as each:
        fleets = _fleets(size, seed, arms, cache, each)
        jobs = [(size, seed, speed, arm) for speed in SPEEDS for arm in (0, *arms)]
        judged = cache.over(each, "judged")(_judge, [(job, fleets) for job in jobs])
        names = [*CONDITIONS, ""] if size.conditions else []
        more = cache.over(each, "condition")(
            _condition, [(name, arms[0], fleets[arms[0]], seed) for name in names]
        )
        tallies = list(zip(jobs, judged, strict=True))
        by_speed = {
            speed: merged(found for (*_, own, _), found in tallies if own == speed)
            for speed in SPEEDS
        }
        found = report.rows(by_speed, list(fleets.values()))
        return found + _rest(found, names, more)


def _rest(found: list[Row], names: Sequence[str], more: Iterator[list[Row]]) -> list[Row]:
    """The rows of the conditions; an error in one condition keeps the rows of the others."""
    rest: list[Row] = []
    failed: dict[str, BaseException] = {}
    for name in names:
        try:
            rest += next(more)
        except Exception as error:
            failed[name] = error
    if failed:
        raise Incomplete(found + rest, failed)
    return rest


def _fleets(
    size: Size, seed: int, arms: Sequence[int], cache: JobCache, each: Each
) -> dict[int, Fleet]:
    """The detectors of every arm, with thresholds from motion of the same arm."""
    # Two jobs per arm: neighbours in the list share their front end, so they stay together.
    half = -(-len(size.detectors) // 2)
    halves = [own for own in (size.detectors[:half], size.detectors[half:]) if own]
    training = [(seed, arm, own, size.training) for arm in arms for own in halves]
    detectors: dict[int, dict[str, FittedMethod]] = {arm: {} for arm in arms}
    for job, own in zip(training, cache.over(each, "train")(_train, training), strict=True):
        detectors[job[1]].update(own)
    hours = size.calibration_hours / len(SPEEDS)
    jobs = [(seed, arm, detectors[arm], speed, hours) for arm in arms for speed in SPEEDS]
    free: dict[int, dict[float, Free]] = {arm: {} for arm in arms}
    for (_, arm, _, speed, _), found in zip(
        jobs, cache.over(each, "free")(calibration, jobs), strict=True
    ):
        free[arm][speed] = found
    network = NETWORK if NETWORK in size.detectors else None
    return {arm: operated(detectors[arm], free[arm], network, size.target) for arm in arms}


def _train(job: tuple[int, int, tuple[str, ...], Training]) -> dict[str, FittedMethod]:
    seed, arm, names, training = job
    return trained(training.traces(seed, arm), names, Conditions())


def _judge(job: tuple[tuple[Size, int, float, int], Mapping[int, Fleet]]) -> Tallies:
    """Results at one speed on an arm's free motion, or (arm 0) on the collisions of all arms."""
    (size, seed, speed, arm), fleets = job
    test = stream(seed, TEST)
    if arm:
        share = 1 / len(SPEEDS) / size.arms
        pool = free_pool(test, speed, (arm,), share * size.hours)
        return merged(on_free(fleets[arm], simulate(episode)) for _, episode in pool)
    pools = [(STRATA, size.per_stratum, FORCES), (FAINT, size.faint, FAINT_FORCES)]
    return merged(
        on_struck(fleets[struck.arm], struck)
        for k, (strata, count, forces) in enumerate(pools)
        if count
        for struck in struck_pool(test + k, speed, list(fleets), count, strata, forces)
    )


def _condition(job: tuple[str, int, Fleet, int]) -> list[Row]:
    """``conditions``: one of :data:`CONDITIONS`, or payloads that are taken up."""
    name, arm, fleet, seed = job
    parts: list[Tallies] = []
    if name:
        speed, under = CONDITIONS[name]
        own = stream(seed, TEST, 7)
        struck = struck_pool(own, speed, [arm], PER_CONDITION, conditions=under)
        parts += [on_struck(fleet, one) for one in struck]
        free = free_pool(own, speed, [arm], HOURS, under)
        parts += [on_free(fleet, simulate(episode)) for _, episode in free]
    else:
        pool = free_pool(stream(seed, TEST, 8), 40.0, [arm], HOURS)
        name = f"payload taken up, {len(pool)} times"
        for k, (_, episode) in enumerate(pool):
            pick = PayloadPick(episode.seconds / 2, TAKEN_UP[k % 3])
            trace = simulate(replace(episode, payload_g=0.0, picks=(pick,)))
            parts.append(on_free(fleet, trace))
    return [
        {"study": "conditions", "condition": name, "detector": detector, **report.summary(tally)}
        for (detector, point), tally in merged(parts).items()
        if point == HOURLY
    ]
