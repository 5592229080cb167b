"""Model only what a scene needs: what a part costs, and what leaving it out does to a detector.

The shipped detector is trained on recordings whose simulation lacks one part, and its threshold
comes from them. It is then judged twice on other motion: in the same poorer simulation (what one
would believe) and in the whole one (what holds). A part whose absence moves neither can be left
out of data for this detector.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.framework import Workers, time_in_turn
from tauguard.datasets.plans import (
    SPEEDS,
    TRAINING_PAYLOADS,
    TRAINING_SPEEDS,
    free_episodes,
    struck_episodes,
)
from tauguard.detectors import SrqSvr, detection_metrics, matchings, train
from tauguard.detectors.calibration.nominal import nominal_arm
from tauguard.envs import Episode, simulate
from tauguard.models import Mismatch
from tauguard.models.drive import PARTS
from tauguard.report import Row
from tauguard.report.charts import errorbars
from tauguard.traces import Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: False alarms an hour that the thresholds aim at.
PER_HOUR = 10.0
#: What is left out beside parts of the drives: how the arm differs from its design, and loads.
OTHERS = ("model errors", "payloads")
#: Carried where a detector is judged [g].
PAYLOADS = (0.0, 1016.0, 4039.0, 2298.0, 782.0)

#: What the columns mean.
NOTES = {
    "needs": "srq-svr trained on simulations without a part, 10 false alarms an hour aimed at, and "
    "judged on other motion of the whole simulation and (believed) of the one without the part. "
    "from_16: share found of the collisions from 16 N m up; delay: median of those [ms]. cost: "
    "processor time of a sample over that of the whole simulation, taken in turn.",
}


@dataclass(frozen=True)
class Size:
    """How much is simulated of every kind."""

    slices: int  #: with 5 collisions each, to train on
    free: int  #: collision-free ones of 40 s, to train on
    judged: int  #: with 8 collisions each
    quiet: int  #: collision-free ones of 50 s, judged
    parts: tuple[str, ...]


FULL = Size(12, 18, 9, 24, (*PARTS, *OTHERS))
QUICK = Size(2, 3, 1, 1, ("friction",))


@dataclass(frozen=True)
class Plan:
    """The episodes of an arm, to train on and to judge on."""

    train: tuple[Episode, ...]
    judge: tuple[Episode, ...]


def plan(size: Size, seed: int) -> Plan:
    """Episodes of one arm that differs from its design; nothing is both trained and judged on."""
    arm, own = Mismatch(seed=70_000 + seed), 3000 + 4 * seed
    loads = TRAINING_PAYLOADS
    return Plan(
        train=(
            *struck_episodes(own, size.slices, 5, TRAINING_SPEEDS, loads, arm),
            *free_episodes(own, size.free, 40.0, TRAINING_SPEEDS, loads[::2], arm),
        ),
        judge=(
            *struck_episodes(own + 1, size.judged, 8, SPEEDS, PAYLOADS, arm),
            *free_episodes(own + 2, size.quiet, 50.0, SPEEDS, PAYLOADS, arm),
        ),
    )


def measure(quick: bool, seed: int) -> list[Row]:
    """A row for the whole simulation and one for each part that is left out."""
    size = QUICK if quick else FULL
    episodes = plan(size, seed)
    with Workers() as each:
        jobs = [(episodes, part) for part in ("", *size.parts)]
        found = dict(zip(("nothing", *size.parts), each(_without, jobs), strict=True))
    cost = costs(episodes.judge[-1], size.parts, 3 if quick else 9)
    return [_row(part, one, cost[part]) for part, one in found.items()]


def costs(episode: Episode, parts: Sequence[str], repeats: int) -> dict[str, dict[str, float]]:
    """Processor time of an episode without each part over that of the whole one, in turn."""
    calls = {
        part: functools.partial(_simulated, (episode,), "" if part == "nothing" else part)
        for part in ("nothing", *parts)
    }
    taken = time_in_turn(calls, repeats, time.process_time)
    whole = taken["nothing"]["median"]
    return {part: {key: s / whole for key, s in one.items()} for part, one in taken.items()}


@dataclass(frozen=True)
class TrainedWithout:
    """A detector from simulations without a part, judged in them."""

    found: dict[str, Any]  #: judged in the whole simulation
    believed: dict[str, Any]  #: judged in the one without the part


def _without(job: tuple[Plan, str]) -> TrainedWithout:
    episodes, part = job
    recordings = _simulated(episodes.train, part)
    alarm = train(SrqSvr(), recordings, nominal_arm(recordings), PER_HOUR)
    found = detection_metrics(matchings(alarm, _whole(episodes.judge)))
    if not part:
        return TrainedWithout(found, found)
    return TrainedWithout(
        found, detection_metrics(matchings(alarm, _simulated(episodes.judge, part)))
    )


@functools.lru_cache(1)
def _whole(episodes: tuple[Episode, ...]) -> list[Trace]:
    """Recordings of the whole simulation, made once a process for all the parts that it judges."""
    return _simulated(episodes, "")


def _simulated(episodes: Sequence[Episode], part: str) -> list[Trace]:
    """Recordings without the part."""
    without = (part,) if part in PARTS else ()
    return [simulate(poorer(episode, part), without=without) for episode in episodes]


def poorer(episode: Episode, part: str) -> Episode:
    """The episode without what is no part of the drives."""
    if part == "model errors":
        return replace(episode, mismatch=None)
    if part == "payloads":
        return replace(episode, payload_g=0.0)
    return episode


def _row(part: str, one: TrainedWithout, cost: dict[str, float]) -> Row:
    found, head = one.found, one.found["headline"]
    return {
        "study": "needs",
        "left out": part,
        "cost": cost,
        "from_16": head["sensitivity"],
        "delay": head["delay_ms"]["median"],
        "false_per_hour": found["false_alarms_per_hour"],
        "believed_from_16": one.believed["headline"]["sensitivity"],
        "believed_false": one.believed["false_alarms_per_hour"],
    }


def draw(rows: list[Row], figure: Figure) -> None:
    """False alarms and misses, believed and found, by what was left out."""
    left, right = figure.subplots(1, 2, sharey=True)
    for axes, keys, title in (
        (left, ("false_per_hour", "believed_false"), "false alarms per hour"),
        (right, ("from_16", "believed_from_16"), "share found from 16 N m up"),
    ):
        for key, marker, label in zip(
            keys, "os", ("in the whole simulation", "in the poorer one"), strict=True
        ):
            shift = 0.12 if marker == "s" else -0.12
            colour = "C0" if marker == "o" else "C1"
            style = {"fmt": marker, "color": colour, "label": label, "capsize": 3}
            at = np.arange(len(rows)) + shift
            errorbars(axes, at, (row[key] for row in rows), across=True, **style)
        axes.set(xlabel=title)
        axes.grid(alpha=0.3)
    left.set_xscale("symlog", linthresh=10)
    left.set_xlim(left=0)
    left.set_yticks(range(len(rows)), [row["left out"] for row in rows])
    left.invert_yaxis()
    left.set_ylabel("left out of the simulation that it was trained in")
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=2)
