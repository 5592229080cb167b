"""Computing time of each part of a simulation, and a detector trained without the part.

The shipped detector and its threshold are trained on recordings whose simulation lacks one part. It
is then judged on other motion, twice: in the same poorer simulation (what a user would believe) and
in the complete one (what is true). If leaving a part out changes neither result, data for this
detector do not need it.
"""

import functools
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from studies.framework import Workers, draw_found, time_in_turn
from tauguard.datasets import plans
from tauguard.detectors import SrqSvr, detection_metrics
from tauguard.detectors.alarms.training import train
from tauguard.detectors.calibration.nominal import nominal_arm
from tauguard.detectors.evaluation.matching import matchings
from tauguard.envs import Episode, simulate
from tauguard.models import Mismatch
from tauguard.models.drive import PARTS
from tauguard.report import Row
from tauguard.traces import Trace

#: False alarms an hour that the thresholds aim at.
PER_HOUR = 10.0
#: Things left out besides parts of the drives: the arm's deviation from its design, and loads.
OTHERS = ("model errors", "payloads")
#: Loads with which a detector is judged [g].
PAYLOADS = (0.0, 1016.0, 4039.0, 2298.0, 782.0)
#: Numbers of episodes: training with 5 collisions each; training without collisions (40 s each);
#: test with 8 collisions each; test without collisions (50 s each).
FULL, QUICK = (12, 18, 9, 24), (2, 3, 1, 1)
NOTES = {
    "needs": "srq-svr trained on simulations without a part for 10 false alarms per hour, and "
    "judged on other motion of the whole simulation and (believed) of the one without the part. "
    "from_16: fraction found of the collisions from 16 N m up; delay: their median delay [ms]. "
    "cost: processor time per sample / that of the whole simulation.",
}
Episodes = tuple[Episode, ...]


def measure(quick: bool, seed: int) -> list[Row]:
    """A row for the whole simulation and one for each part that is left out."""
    training, judging = episodes(QUICK if quick else FULL, seed)
    parts = ("nothing", *(("friction",) if quick else (*PARTS, *OTHERS)))
    with Workers() as each:
        found = list(each(judged_without, [(training, judging, part) for part in parts]))
    cost = costs(judging[-1], parts, 3 if quick else 9)
    return [
        {"study": "needs", "left out": part, "cost": cost[part], **row}
        for part, row in zip(parts, found, strict=True)
    ]


def draw(rows: list[Row], figure: Any) -> None:
    """Fraction found without each part, judged in the whole and in the poorer simulation."""
    judged = {"in the whole simulation": "from_16", "in the poorer one": "believed_from_16"}
    own = {k: {row["left out"]: row[key] for row in rows} for k, key in judged.items()}
    draw_found(own, figure)


def episodes(size: tuple[int, int, int, int], seed: int) -> tuple[Episodes, Episodes]:
    """Episodes to train on and to judge on, of one arm that deviates from its design."""
    arm, own, loads = Mismatch(seed=70_000 + seed), 3000 + 4 * seed, plans.TRAINING_PAYLOADS
    struck, free, judged, quiet = size
    slow, speeds = plans.TRAINING_SPEEDS, plans.SPEEDS
    training = (
        *plans.struck_episodes(own, struck, 5, slow, loads, arm),
        *plans.free_episodes(own, free, 40.0, slow, loads[::2], arm),
    )
    judging = (
        *plans.struck_episodes(own + 1, judged, 8, speeds, PAYLOADS, arm),
        *plans.free_episodes(own + 2, quiet, 50.0, speeds, PAYLOADS, arm),
    )
    return training, judging


def costs(episode: Episode, parts: Sequence[str], repeats: int) -> dict[str, dict[str, float]]:
    """Processor time of an episode without each part, divided by that of the complete one."""
    calls = {part: functools.partial(recordings, (episode,), part) for part in parts}
    taken = time_in_turn(calls, repeats, time.process_time)
    whole = taken["nothing"]["median"]
    return {part: {key: s / whole for key, s in one.items()} for part, one in taken.items()}


def judged_without(job: tuple[Episodes, Episodes, str]) -> dict[str, Any]:
    """Train a detector without a part of the simulation; judge it with and without the part."""
    training, judging, part = job
    traces = recordings(training, part)
    alarm = train(SrqSvr(), traces, nominal_arm(traces), PER_HOUR)
    found = detection_metrics(matchings(alarm, whole_recordings(judging)))
    believed = found
    if part != "nothing":
        believed = detection_metrics(matchings(alarm, recordings(judging, part)))
    return {
        "from_16": found["headline"]["sensitivity"],
        "delay": found["headline"]["delay_ms"]["median"],
        "false_per_hour": found["false_alarms_per_hour"],
        "believed_from_16": believed["headline"]["sensitivity"],
        "believed_false": believed["false_alarms_per_hour"],
    }


@functools.lru_cache(1)
def whole_recordings(judging: Episodes) -> list[Trace]:
    """Recordings of the whole simulation, made once per process for all the parts."""
    return recordings(judging, "nothing")


def recordings(chosen: Episodes, part: str) -> list[Trace]:
    """Recordings without the part."""
    absent: dict[str, dict[str, Any]] = {
        "model errors": {"mismatch": None},
        "payloads": {"payload_g": 0.0},
    }
    poorer = [replace(episode, **absent.get(part, {})) for episode in chosen]
    return [simulate(episode, without=(part,) if part in PARTS else ()) for episode in poorer]
