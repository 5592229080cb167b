"""What each part of the detector brings: it is left out, everything else stays.

Every form of the detector is trained on the same slices, gets its threshold from the same motion by
the same law, and is judged on the same fresh motion and collisions.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.detection.arm_scores import Arm, Extent, scored
from studies.detection.fleet import TEST, Training, fitted, stream
from studies.detection.pool import free_pool
from studies.detection.threshold_laws import judged, price_row, rate_row
from studies.framework import JobCache, Workers, time_in_turn
from tauguard.arrays import Array
from tauguard.detectors import ArmModel, FittedDetector, SrqSvr
from tauguard.detectors.estimation.estimator import Estimator, Unknowns
from tauguard.detectors.features.envelope import Envelope
from tauguard.detectors.features.front_end import FrontEnd, FrontEndSettings
from tauguard.envs import simulate
from tauguard.report import Row
from tauguard.report.charts import errorbars
from tauguard.traces import Trace

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

#: What the columns of the table mean.
NOTES = {
    "parts": "SVR-SRQ without one of its parts, thresholds for asked false alarms per hour. found: "
    "in the fresh motion of all arms, with its exact 95 % interval; kept: share of the arms whose "
    "interval reaches down to asked. sensitivity from 16 N m up and of all from 4 N m up; the "
    "delay of the former [ms]. time: of a sample in the stream, Python included, over the "
    "median of the whole detector's (first row: its own spread), the forms in turn on "
    "the first arm.",
}
WHOLE, LEVELS = "nothing", "speed levels"
#: Parts of the state that is estimated with the residual, by what is left out.
UNKNOWNS: dict[str, dict[str, Any]] = {
    "payload tracking": {"payload": 0.0, "moment": 0.0},
    "friction errors": {"viscous": 0.0, "coulomb": 0.0},
    "torque offsets": {"offset": 0.0},
    "errors that last": {"lasting": 1.0},
    "error of changing friction": {"transition": 0.0},
    "weight of what is uncertain": {"weighted": False},
}
#: Columns of the laws that say nothing of the parts.
LEFT_OUT = ("detector", "law", "arms", "inside", "stated_low", "stated_high", "alarms_an_arm")
#: Samples of a timing, and how often it is repeated.
TIMED, REPEATS = 3000, 7


Forms = dict[str, FittedDetector]


@dataclass(frozen=True, eq=False)
class PartialFrontEnd(FrontEnd):
    """A front end whose estimator knows less."""

    without: str = WHOLE

    def estimator(self) -> Estimator:
        """Without a part of its state."""
        known = replace(Unknowns.for_detection(), **UNKNOWNS[self.without])
        return Estimator(self.arm, self.gain, self.dt, known)


@dataclass(frozen=True)
class PartialSettings(FrontEndSettings):
    """Settings of such a front end."""

    without: str = WHOLE

    def bare(self, joints: tuple[int, ...], arm: ArmModel, dt: float) -> FrontEnd:
        """Before its envelope is known."""
        return PartialFrontEnd(self.gain, self.adapt, self.settle, joints, arm, dt, self.without)


@dataclass(frozen=True)
class ConstantEnvelope(FrontEndSettings):
    """The envelope is the same at every speed."""

    def fit(self, traces: Sequence[Trace], arm: ArmModel) -> FrontEnd:
        """The standard deviation of all collision-free motion."""
        found = super().fit(traces, arm)
        assert found.arm.noise is not None
        return replace(found, arm=replace(found.arm, envelope=Envelope.constant(found.arm.noise)))


def forms() -> dict[str, SrqSvr]:
    """The detector, and what is left of it without each part."""
    fewer = {name: SrqSvr(front=PartialSettings(without=name)) for name in UNKNOWNS}
    return {
        WHOLE: SrqSvr(),
        **fewer,
        "envelope over the speed": SrqSvr(front=ConstantEnvelope()),
        "mined negatives": SrqSvr(mined=0),
    }


@dataclass(frozen=True)
class Size:
    """How much is simulated."""

    arms: int
    asked: float  #: false alarms per hour
    extent: Extent  #: of each arm


FULL = Size(3, 1.0, Extent(tuple(forms()), Training(), 0.4, 0.6, 1))
FEW = (WHOLE, "payload tracking")
QUICK = Size(1, 30.0, Extent(FEW, Training(slices=2, free=4, free_seconds=12.0), 0.02, 0.02, 0))


def measure(quick: bool, seed: int, keep: str | None = None) -> list[Row]:
    """Rows ``parts``: one for every part that is left out."""
    size = QUICK if quick else FULL
    kept = JobCache.of(keep, "detection_parts", seed, size)
    seeds = [61_000 + 100 * seed + k for k in range(size.arms)]
    with Workers() as each:
        training = [(size.extent, seed, arm) for arm in seeds]
        detectors = list(kept.over(each, "train")(trained, training))
        jobs = [(size.extent, seed, *one) for one in zip(seeds, detectors, strict=True)]
        arms = list(kept.over(each, "arm")(of_arm, jobs))
    times = timing(seed, seeds[0], detectors[0])
    cases = [(name, name, True) for name in size.extent.names] + [(LEVELS, WHOLE, False)]
    rows = []
    for part, name, normalised in cases:
        case = judged(arms, name, "usual tail", size.asked, normalised)
        price = price_row(case, "all", case.arms) or {}
        row = {**rate_row(case, "all", case.arms), **price, "study": "parts"}
        for column in LEFT_OUT:
            del row[column]
        # The levels are a table's look-up: no form of the detector is without them.
        own = None if part == LEVELS else times[name]
        rows.append({"study": "parts", "without": part, **row, "time": own})
    return rows


def trained(job: tuple[Extent, int, int]) -> Forms:
    """The forms of the extent, trained for one arm."""
    extent, seed, arm = job
    every = forms()
    return fitted(seed, arm, {name: every[name] for name in extent.names}, extent.training)


def of_arm(job: tuple[Extent, int, int, Forms]) -> Arm:
    """Scores of every form on one arm."""
    return scored(*job)


def timing(seed: int, arm: int, detectors: Forms) -> dict[str, dict[str, float]]:
    """Time of a sample of each form on one arm, relative to the whole detector's."""
    (_, episode), *_ = free_pool(stream(seed, TEST, 11), 30.0, (arm,), 1e-4, seconds=5.0)
    return relative(detectors, simulate(episode))


def relative(detectors: Forms, trace: Trace) -> dict[str, dict[str, float]]:
    """Processor time of each detector's stream over the median of the whole one's.

    Returns:
        Per name ``{"median", "low", "high"}`` over the repeats, the detectors taken in turn.
    """
    samples = list(zip(trace.q[:TIMED], trace.qd[:TIMED], trace.current[:TIMED], strict=True))
    calls = {name: partial(_stream, one, samples) for name, one in detectors.items()}
    found = time_in_turn(calls, REPEATS, time.process_time)
    whole = found[WHOLE]["median"]
    return {name: {k: v / whole for k, v in own.items()} for name, own in found.items()}


def _stream(detector: FittedDetector, samples: Sequence[tuple[Array, Array, Array]]) -> None:
    step = detector.stream().step
    for sample in samples:
        step(*sample)


def draw(rows: list[Row], figure: Figure) -> None:
    """False alarms found, and the time of a sample, without each part."""
    left, right = figure.subplots(1, 2, sharey=True)
    names = [row["without"] for row in rows]
    at = np.arange(len(rows))[::-1]
    errorbars(left, at, (row["found_per_hour"] for row in rows), across=True, fmt="o", capsize=3)
    left.axvline(rows[0]["asked"], color="k", linestyle="--")
    left.set_yticks(at, names)
    left.set(xlabel="false alarms per hour (dashed: asked for)", title="Without ...")
    timed = [(y, row["time"]) for y, row in zip(at, rows, strict=True) if row["time"]]
    places, ratios = zip(*timed, strict=True)
    errorbars(right, places, ratios, across=True, fmt="o", capsize=3)
    right.axvline(1.0, color="k", linestyle="--")
    right.set(xlabel="time of a sample over the whole detector's")
