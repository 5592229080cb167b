"""From the dissertation's setting to ours, one change at a time.

The dissertation's form (``srq-svr-plain``: residuals of a plain observer, labels 0/1) starts on an
arm that its observer knows exactly, without friction, with payloads that training held, at the
CURA6's 23.8 Hz and with thresholds as specific as the dissertation's at 1.6 A. Every row changes
one thing more. First the setting becomes ours; then the form becomes ``srq-svr``.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from studies.detection.fleet import CALIBRATE, TEST, Training, stream
from studies.detection.judge import Tally, judge_free, judge_struck, merged
from studies.detection.pool import (
    PAYLOADS,
    SPEEDS,
    Conditions,
    Struck,
    free_pool,
    struck_pool,
)
from studies.detection.rows import DISSERTATION, delays, found
from studies.detection.thresholds import (
    HOURLY,
    POINTS,
    Operated,
    at_share,
    free_scores,
    joined,
    operated,
)
from studies.detection.variations import CURA6_STRIDE, every
from studies.framework import JobCache, Workers
from tauguard.datasets.plans import TRAINING_PAYLOADS
from tauguard.detectors import (
    CollisionAlarm,
    Detector,
    FittedDetector,
    FreeScores,
    SrqSvr,
    poisson_rate,
)
from tauguard.detectors.calibration.nominal import nominal_design
from tauguard.detectors.evaluation.metrics import HEADLINE
from tauguard.detectors.features.front_end import FrontEnd, FrontEndSettings
from tauguard.detectors.features.scaling import Scaling
from tauguard.report import Row
from tauguard.report import rate as wilson
from tauguard.report.charts import errorbars
from tauguard.traces import Trace

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

NOTES = {
    "ladder": "each row changes one thing more than the row above. from 32, 16, 4 N m: share of "
    "the collisions found whose largest external torque is so high; specificity: share of cases of "
    "2 s without a collision that raise no alarm; delay: median from 16 N m up [ms].",
}
#: Found shares are given for collisions from these torques on [N m].
LEAST = (32.0, 16.0, 4.0)
#: False alarms per hour that the last operating point aims at, over all speeds.
PER_HOUR = 0.25


@dataclass(frozen=True)
class Form(SrqSvr):
    """A form between the dissertation's and ours."""

    envelope: bool = True  #: residuals over their envelope, compressed; else in N m

    def bare(self, traces: Sequence[Trace], front: FrontEnd) -> Scaling:
        """The scaling before its factor."""
        return super().bare(traces, front) if self.envelope else Scaling(front.joints)


def _form(parts: int, mined: int, windows: int) -> Form:
    """The form that has the first ``parts`` of ours, each with the settings that go with it."""
    graded, calibrate, adapt, envelope, mining = (parts > k for k in range(5))
    return Form(
        windows=windows,
        mined=mined if mining else 0,
        distance=SrqSvr.distance if envelope else SrqSvr.sigma,
        vectors=SrqSvr.vectors if mining else 0,
        front=FrontEndSettings(adapt=adapt, settle=3.0 if adapt else 0.5, calibrate=calibrate),
        graded=graded,
        envelope=envelope,
    )


@dataclass(frozen=True)
class Rung:
    """One row."""

    change: str
    form: int  #: how many parts of ours the form has, 0 to 5
    scene: int  #: how many of the simulation's difficulties are there, 0 to 3
    stride: int = 1  #: samples of a kilohertz to one
    point: str = HOURLY


#: The simulation, from the easiest to the study's.
SCENES = (
    Conditions(TRAINING_PAYLOADS, scale=0.0, without=("friction",)),
    Conditions(TRAINING_PAYLOADS, without=("friction",)),
    Conditions(TRAINING_PAYLOADS),
    Conditions(PAYLOADS),
)
RUNGS = (
    Rung("the dissertation's setting, exact model, no friction", 0, 0, CURA6_STRIDE, "1.6"),
    Rung("masses, gains wrong as in ours", 0, 1, CURA6_STRIDE, "1.6"),
    Rung("friction", 0, 2, CURA6_STRIDE, "1.6"),
    Rung("payloads that training did not hold", 0, 3, CURA6_STRIDE, "1.6"),
    Rung("a kilohertz", 0, 3, 1, "1.6"),
    Rung("as specific as at 2.0 A", 0, 3, 1, "2.0"),
    Rung("0.25 false alarms per hour", 0, 3),
    Rung("labels that grow with the torque", 1, 3),
    Rung("friction, masses, gains identified", 2, 3),
    Rung("payload, friction errors, offsets estimated", 3, 3),
    Rung("residual over its envelope", 4, 3),
    Rung("collision-free peaks mined: srq-svr", 5, 3),
)


@dataclass(frozen=True)
class Size:
    """How much is simulated."""

    arms: int
    speeds: tuple[float, ...]  #: of the evaluation [%]
    per_stratum: int  #: collisions an arm and speed
    hours: float  #: collision-free, an arm and speed, for thresholds and again for the evaluation
    training: Training = field(default_factory=Training)
    windows: int = SrqSvr.windows
    mined: int = SrqSvr.mined

    def form(self, parts: int) -> Detector:
        """The form that has the first ``parts`` of ours."""
        return _form(parts, self.mined, self.windows)


FULL = Size(3, SPEEDS[::2], 4, 0.1)
QUICK = Size(1, (30.0,), 1, 0.015, Training(slices=4, free=4, free_seconds=15.0), 600, 60)

#: By row of the ladder, then by speed.
Found = dict[str, dict[float, Tally]]


def measure(quick: bool, seed: int, keep: str | None = None) -> list[Row]:
    """Rows ``ladder``: one a rung, all arms and speeds together."""
    size = QUICK if quick else FULL
    kept = JobCache.of(keep, "detection_ladder", seed, (size, RUNGS))
    seeds = [71_000 + 100 * seed + k for k in range(size.arms)]
    jobs = [(size, seed, arm, scene) for arm in seeds for scene in range(len(SCENES))]
    with Workers() as each:
        parts = list(kept.over(each, "scene")(evaluated, jobs))
    return [_row(rung, [part for part in parts if rung.change in part]) for rung in RUNGS]


def evaluated(job: tuple[Size, int, int, int]) -> Found:
    """One arm in one simulation: the rungs that are played there."""
    size, seed, arm, scene = job
    under = SCENES[scene]
    slices = size.training.traces(seed, arm, under)
    threshold, free = (
        {v: _free(under, own, v, arm, size.hours) for v in size.speeds}
        for own in (stream(seed, CALIBRATE, 17), stream(seed, TEST, 17))
    )
    struck = {
        v: list(struck_pool(stream(seed, TEST, 17), v, (arm,), size.per_stratum, conditions=under))
        for v in size.speeds
    }
    detectors: dict[tuple[int, int], FittedDetector] = {}
    tallies: Found = {}
    for rung in (rung for rung in RUNGS if rung.scene == scene):
        key = rung.form, rung.stride
        if key not in detectors:
            thin = [every(trace, rung.stride) for trace in slices]
            detectors[key] = size.form(rung.form).fit(thin, nominal_design())
        scores = {v: _scores(detectors[key], rung, traces) for v, traces in threshold.items()}
        alarms = _alarms(detectors[key], rung, scores)
        tallies[rung.change] = {v: _tally(alarms[v], rung, struck[v], free[v]) for v in size.speeds}
    return tallies


def _free(under: Conditions, seed: int, speed: float, arm: int, hours: float) -> list[Trace]:
    """Collision-free motion."""
    pool = free_pool(seed, speed, (arm,), hours, under)
    return [under.simulated(episode) for _, episode in pool]


def _scores(detector: FittedDetector, rung: Rung, traces: Sequence[Trace]) -> list[FreeScores]:
    """What the detector says of collision-free motion."""
    thin = (every(trace, rung.stride) for trace in traces)
    return joined([free_scores({"": detector}, trace) for trace in thin])[""]


def _alarms(
    detector: FittedDetector, rung: Rung, scores: dict[float, list[FreeScores]]
) -> dict[float, CollisionAlarm]:
    """The alarm at every speed: as specific as the dissertation's, or one for a rate."""
    if rung.point == HOURLY:
        free = {speed: {"": own} for speed, own in scores.items()}
        alarm = operated({"": detector}, free, None, PER_HOUR)[""].alarms[HOURLY]
        return dict.fromkeys(scores, alarm)
    cell = 2 * POINTS.index(rung.point)
    return {
        speed: CollisionAlarm(detector, at_share(own, 1 - specificity(*DISSERTATION[speed][cell])))
        for speed, own in scores.items()
    }


def specificity(tp: int, fn: int, fp: int, tn: int) -> float:
    """Of a confusion matrix."""
    return tn / (tn + fp)


def _tally(
    alarm: CollisionAlarm, rung: Rung, struck: Sequence[Struck], free: Sequence[Trace]
) -> Tally:
    """What the alarm does at one speed."""
    fleet = {"": Operated(alarm.detector, {rung.point: alarm})}
    thin = [replace(one, trace=every(one.trace, rung.stride)) for one in struck]
    parts = [judge_struck(fleet, one) for one in thin]
    parts += [judge_free(fleet, every(trace, rung.stride)) for trace in free]
    return merged(parts)["", rung.point]


def _row(rung: Rung, parts: Sequence[Found]) -> Row:
    """All arms and speeds of one rung."""
    whole = Tally()
    for part in parts:
        for tally in part[rung.change].values():
            whole.add(tally)
    shares = {
        f"from {least:g} N m": found([o for o in whole.outcomes if o.collision.peak_tau >= least])
        for least in LEAST
    }
    hard = [o for o in whole.outcomes if o.collision.peak_tau >= HEADLINE]
    return {
        "study": "ladder",
        "change": rung.change,
        **shares,
        "specificity": wilson(whole.cases - whole.false_cases, whole.cases),
        "per_hour": poisson_rate(whole.false_alarms, whole.free_seconds / 3600),
        "delay": delays(hard)["median"],
    }


def draw(rows: list[Row], figure: Figure) -> None:
    """What is found, rung by rung."""
    axes = figure.subplots()
    at = np.arange(len(rows))[::-1]
    for marker, shift, least in zip("o^s", (0.15, 0.0, -0.15), LEAST, strict=True):
        shares = (row[f"from {least:g} N m"] for row in rows)
        errorbars(
            axes, at + shift, shares, across=True, fmt=marker, capsize=2, label=f"{least:g} N m"
        )
    axes.set_yticks(at, [row["change"] for row in rows])
    axes.set(xlabel="share of the collisions found", xlim=(-0.02, 1.02))
    axes.grid(alpha=0.3)
    axes.legend(title="collisions from")
