"""What the detection study changes one at a time: training size, sigma, conditions, sample rate.

Every row gives sensitivity from 16 N m up, delay and false alarms per hour. Conditions have the
thresholds of the third operating point; what is trained anew has one for 0.5 an hour from fifteen
minutes of collision-free motion.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from studies.detection.fleet import (
    CALIBRATE,
    TEST,
    TRAINING_SPEEDS,
    Training,
    stream,
)
from studies.detection.judge import Tally, judge_free, judge_struck, merged
from studies.detection.pool import Conditions, Struck, free_pool, struck_pool
from studies.detection.rows import headline
from studies.detection.thresholds import (
    HOURLY,
    Fleet,
    Operated,
    free_scores,
    joined,
    operated,
)
from tauguard.detectors import FittedDetector, PlainSrqSvr, SrqSvr
from tauguard.detectors.calibration.nominal import nominal_design
from tauguard.detectors.registry import make_detector
from tauguard.envs import PayloadPick, simulate
from tauguard.report import Row
from tauguard.traces import Trace

#: Speed of the variations, percent of the maximum, and one outside the training range.
SPEED, FAST = 40.0, 80.0
#: Collisions a training slice has, of 15 slices, and sigmas of the SRQ kernel.
TRAINING_COLLISIONS, SIGMAS = (1, 2, 5, 10), (0.3, 1.0, 2.0, 3.0, 5.0, 10.0, 30.0)
#: Every so many samples of a kilohertz make the CURA6's 10,000 samples in 7 minutes.
CURA6_STRIDE = 42


@dataclass(frozen=True)
class Extent:
    """How much is judged for one row."""

    per_stratum: int = 5
    hours: float = 0.1
    calibration_hours: float = 0.25
    target: float = 0.5  #: false alarms per hour that thresholds aim at


Pools = tuple[list[Struck], list[Trace]]


def pools(seed: int, speed: float, arms: Sequence[int], extent: Extent, under: Conditions) -> Pools:
    """Judged collisions and free motion under some conditions; seeds of their own."""
    own = stream(seed, TEST, 7)
    struck = list(struck_pool(own, speed, arms, extent.per_stratum, conditions=under))
    free = [simulate(e) for _, e in free_pool(own, speed, arms, extent.hours, under)]
    return struck, free


def tallies_of(fleet: Fleet, both: Pools) -> dict[str, Tally]:
    """Tallies at the third operating point, by detector."""
    struck, free = both
    parts = [judge_struck(fleet, s) for s in struck]
    parts += [judge_free(fleet, trace) for trace in free]
    return {name: t for (name, point), t in merged(parts).items() if point == HOURLY}


def own_thresholds(
    detectors: dict[str, FittedDetector], calibration: Iterable[Trace], target: float
) -> dict[str, Operated]:
    """Detectors that are not in the table, with their third operating point."""
    found = joined([free_scores(detectors, trace) for trace in calibration])
    return operated(detectors, {0.0: found}, None, target)


def conditions(fleet: Fleet, arm: int, seed: int, extent: Extent) -> list[Row]:
    """``conditions``: payload, temperature, arm and speed outside of what was trained on."""
    cases: dict[str, tuple[float, Conditions]] = {
        "as trained": (SPEED, Conditions()),
        "payload 4.5 kg": (SPEED, Conditions(payloads=(4500.0,))),
        "payload 6 kg": (SPEED, Conditions(payloads=(6000.0,))),
        "gears at 10 degC": (SPEED, Conditions(temperature=10.0)),
        "gears at 60 degC": (SPEED, Conditions(temperature=60.0)),
        "mismatch doubled since training": (SPEED, Conditions(scale=2.0)),
        "speed 80 %": (FAST, Conditions()),
    }
    rows = []
    for name, (speed, under) in cases.items():
        both = pools(seed, speed, [arm], extent, under)
        tallies = tallies_of(fleet, both)
        rows += [_row("conditions", {"condition": name}, d, t) for d, t in tallies.items()]
    rows += _picks(fleet, arm, seed, extent)
    return rows


def _picks(fleet: Fleet, arm: int, seed: int, extent: Extent) -> list[Row]:
    """A payload taken up half-way: whatever alarm it raises is false."""
    pool = free_pool(stream(seed, TEST, 8), SPEED, [arm], extent.hours)
    parts = []
    for k, (_, episode) in enumerate(pool):
        pick = PayloadPick(episode.seconds / 2, (1500.0, 2500.0, 3500.0)[k % 3])
        trace = simulate(replace(episode, payload_g=0.0, picks=(pick,)))
        parts.append(judge_free(fleet, trace))
    tallies = {n: t for (n, point), t in merged(parts).items() if point == HOURLY}
    case = {"condition": f"payload taken up, {len(pool)} times"}
    return [_row("conditions", case, d, t) for d, t in tallies.items()]


def _row(study: str, case: Row, detector: str, tally: Tally, **more: Any) -> Row:
    return {"study": study, **case, "detector": detector, **headline(tally), **more}


@dataclass(frozen=True)
class Bench:
    """One arm's traces, kept for detectors that are trained again and again."""

    seed: int
    arm: int
    extent: Extent

    def training(self, training: Training) -> list[Trace]:
        """The arm's slices."""
        return training.traces(self.seed, self.arm)

    def calibration(self) -> list[Trace]:
        """Collision-free motion for thresholds, at the training speeds."""
        hours = self.extent.calibration_hours / len(TRAINING_SPEEDS)
        own = stream(self.seed, CALIBRATE, 7)
        pool = [e for s in TRAINING_SPEEDS for _, e in free_pool(own, s, [self.arm], hours)]
        return [simulate(episode) for episode in pool]

    def pools(self) -> Pools:
        """What is judged, at the variations' speed."""
        return pools(self.seed, SPEED, [self.arm], self.extent, Conditions())


def training_size(bench: Bench, names: Sequence[str]) -> list[Row]:
    """``training_size``: how the number of training collisions changes what is found."""
    calibration, both = bench.calibration(), bench.pools()
    rows = []
    for count in TRAINING_COLLISIONS:
        traces = bench.training(Training(collisions=count))
        for name in names:
            fitted = make_detector(name).fit(traces, nominal_design())
            own: dict[str, FittedDetector] = {name: fitted}
            fleet = own_thresholds(own, calibration, bench.extent.target)
            tally = tallies_of(fleet, both)[name]
            rows.append(_row("training_size", {"collisions": 15 * count}, name, tally))
    return rows


def sigmas(bench: Bench) -> list[Row]:
    """``sigma``: the length of the SRQ kernel; the plain form with and without its one factor."""
    calibration, both = bench.calibration(), bench.pools()
    traces = bench.training(Training())
    rows = []
    cases = [("srq-svr", SrqSvr(sigma=sigma)) for sigma in SIGMAS]
    cases += [
        ("srq-svr-plain", PlainSrqSvr()),
        ("srq-svr-plain, residuals in N m", PlainSrqSvr(distance=0.0)),
    ]
    for name, settings in cases:
        own: dict[str, FittedDetector] = {name: settings.fit(traces, nominal_design())}
        fleet = own_thresholds(own, calibration, bench.extent.target)
        tally = tallies_of(fleet, both)[name]
        rows.append(_row("sigma", {"sigma": settings.sigma}, name, tally))
    return rows


def sample_rate(bench: Bench) -> list[Row]:
    """``sample_rate``: a kilohertz beside the CURA6's 23.8 Hz: 11 samples a window, t_c of one."""
    calibration, both = bench.calibration(), bench.pools()
    traces = bench.training(Training())
    rows = []
    for stride in (1, CURA6_STRIDE):
        detector = SrqSvr().fit([every(t, stride) for t in traces], nominal_design())
        own: dict[str, FittedDetector] = {"srq-svr": detector}
        fleet = own_thresholds(own, [every(t, stride) for t in calibration], bench.extent.target)
        struck = [replace(s, trace=every(s.trace, stride)) for s in both[0]]
        free = [every(t, stride) for t in both[1]]
        tally = tallies_of(fleet, (struck, free))["srq-svr"]
        rows.append(_row("sample_rate", {"hz": 1000 / stride}, "srq-svr", tally))
    return rows


def every(trace: Trace, stride: int) -> Trace:
    """Each ``stride``-th sample of a trace; the truth's collisions stay as they were."""
    if stride == 1:
        return trace
    thin = slice(None, None, stride)
    truth = trace.truth
    if truth is not None:
        names = ["tau_ext", "contact_force", "payload", "contact_link", "contact_point"]
        names += ["contact_vector", "obstacle_poses"]
        truth = replace(truth, **{name: getattr(truth, name)[thin] for name in names})
    signals = {name: getattr(trace, name)[thin] for name in ("t", "q", "qd", "current")}
    return replace(trace, **signals, q_des=None, qd_des=None, qdd_des=None, truth=truth)
