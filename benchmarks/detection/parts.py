"""What each part of the detector brings: it is left out, everything else stays.

Every form of the detector is trained on the same slices, gets its threshold from the same motion by
the same law, and is judged on the same fresh motion and collisions.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tauguard.benchmarks.detection.arm_scores import Arm, Extent, scored
from tauguard.benchmarks.detection.fleet import TEST, Training, stream
from tauguard.benchmarks.detection.pool import free_pool
from tauguard.benchmarks.detection.threshold_laws import judged, price_row, rate_row
from tauguard.benchmarks.kept import Kept
from tauguard.benchmarks.workers import Workers
from tauguard.detectors import ArmModel, FittedDetector, SrqSvr
from tauguard.detectors.calibration.nominal import nominal_design
from tauguard.detectors.estimation.estimator import Estimator, Unknowns
from tauguard.detectors.features.envelope import Envelope
from tauguard.detectors.features.front_end import FrontEnd, FrontEndSettings
from tauguard.envs import simulate
from tauguard.report import Row
from tauguard.traces import Trace

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

#: What the columns of the table mean.
NOTES = {
    "parts": "SVR-SRQ without one of its parts, thresholds for asked false alarms per hour. found: "
    "in the fresh motion of all arms, with its exact 95 % interval; kept: arms whose interval "
    "reaches down to asked. sensitivity from 16 N m up and of all from 4 N m up; the delay of the "
    "former [ms]. us: of a sample in the stream, Python included, least of the arms.",
}
WHOLE, LEVELS = "nothing", "speed levels"
#: Parts of the state that is estimated with the residual, by what is left out.
UNKNOWNS: dict[str, dict[str, float]] = {
    "payload tracking": {"payload": 0.0, "moment": 0.0},
    "friction errors": {"viscous": 0.0, "coulomb": 0.0},
    "torque offsets": {"offset": 0.0},
    "weight of an uncertain payload": {"payload_weight": 0.0},
}
#: Samples of a timing, and how often it is repeated.
TIMED, REPEATS = 3000, 3


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
QUICK = Size(
    1, 30.0, Extent(tuple(forms()), Training(slices=3, free=4, free_seconds=12.0), 0.02, 0.02, 0)
)


def run(quick: bool, seed: int, keep: str | None = None) -> list[Row]:
    """Rows ``parts``: one for every part that is left out."""
    size = QUICK if quick else FULL
    kept = Kept.of(keep, "detection_parts", seed, size)
    jobs = [(size.extent, seed, 61_000 + 100 * seed + k) for k in range(size.arms)]
    with Workers() as each:
        found = list(kept.over(each, "arm")(of_arm, jobs))
    arms = [arm for arm, _ in found]
    cases = [(name, name, True) for name in size.extent.names] + [(LEVELS, WHOLE, False)]
    rows = []
    for part, name, normalised in cases:
        case = judged(arms, name, "expected", size.asked, normalised)
        price = price_row(case, "all", case.arms) or {}
        row = {**rate_row(case, "all", case.arms), **price, "study": "parts"}
        for column in ("detector", "law", "arms", "inside", "stated", "by_arm"):
            del row[column]
        us = min(times[name] for _, times in found)
        rows.append({"study": "parts", "without": part, **row, "us": us})
    return rows


def of_arm(job: tuple[Extent, int, int]) -> tuple[Arm, dict[str, float]]:
    """Scores of every form on one arm, and microseconds of a sample."""
    extent, seed, arm = job
    traces, robot = extent.training.traces(seed, arm), nominal_design()
    fitted: dict[str, FittedDetector] = {n: d.fit(traces, robot) for n, d in forms().items()}
    (_, episode), *_ = free_pool(stream(seed, TEST, 11), 30.0, (arm,), 1e-4, seconds=5.0)
    times = microseconds(fitted, simulate(episode))
    return scored(extent, seed, arm, fitted), times


def microseconds(detectors: dict[str, FittedDetector], trace: Trace) -> dict[str, float]:
    """The least time of a sample in the stream, the forms taken in turn [us]."""
    least = dict.fromkeys(detectors, np.inf)
    for _ in range(REPEATS):
        for name, detector in detectors.items():
            step, begun = detector.stream().step, time.process_time()
            for row in zip(trace.q[:TIMED], trace.qd[:TIMED], trace.current[:TIMED], strict=True):
                step(*row)
            took = 1e6 * (time.process_time() - begun) / min(TIMED, len(trace.t))
            least[name] = min(least[name], took)
    return least


def draw(rows: list[Row], figure: Figure) -> None:
    """False alarms found, and microseconds, without each part."""
    left, right = figure.subplots(1, 2, sharey=True)
    names = [row["without"] for row in rows]
    at = np.arange(len(rows))[::-1]
    rates = [row["found_per_hour"] for row in rows]
    value = np.array([rate["value"] for rate in rates])
    errors = [value - [r["low"] for r in rates], np.array([r["high"] for r in rates]) - value]
    left.errorbar(value, at, xerr=errors, fmt="o", capsize=3)
    left.axvline(rows[0]["asked"], color="k", linestyle="--")
    left.set_yticks(at, names)
    left.set(xlabel="false alarms per hour (dashed: asked for)", title="Without ...")
    right.barh(at, [row["us"] for row in rows])
    right.set(xlabel="us a sample, Python included")
