"""One arm's scores, free and struck: whatever a threshold law needs to be judged afterwards."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from studies.detection.fleet import CALIBRATE, TEST, Training, stream, train
from studies.detection.pool import SPEEDS, Conditions, Struck, free_pool, struck_pool
from studies.detection.thresholds import free_scores, joined
from tauguard.arrays import Array
from tauguard.datasets.plans import TRAINING_PAYLOADS
from tauguard.detectors import CollisionAlarm, FittedDetector, FreeScores, find_alarms
from tauguard.detectors.evaluation.events import MERGE_GAP, detection_window
from tauguard.detectors.thresholds.speed_levels import SpeedLevels, recent_speed
from tauguard.envs import simulate

Free = dict[str, list[FreeScores]]


@dataclass(frozen=True)
class Extent:
    """How much of one arm is simulated."""

    names: tuple[str, ...]  #: of the detectors
    training: Training
    calibration_hours: float
    hours: float  #: fresh, free of collisions
    per_stratum: int  #: judged collisions of a stratum at one speed
    under: Conditions = field(default_factory=Conditions)


@dataclass(frozen=True)
class Blow:
    """One detector around one collision."""

    peak_tau: float  #: [N m]
    t: Array  #: since the touch [s], from a merge gap before it on, shape (T,)
    level: Array  #: sustained score, shape (T,)
    speed: Array  #: recent speed [rad/s], shape (T,)

    def delay(self, levels: SpeedLevels, threshold: float) -> float | None:
        """When the alarm comes [s]; ``None``: missed, or up already at the touch."""
        alarms = find_alarms(self.t, levels(self.level, self.speed) > threshold)
        before = any(alarm.start < 0 <= alarm.end for alarm in alarms)
        hits = [alarm.start for alarm in alarms if alarm.start >= 0]
        return None if before or not hits else hits[0]


@dataclass(frozen=True)
class Arm:
    """The scores of one arm's detectors, by their names."""

    seed: int
    calibration: Free
    fresh: Free
    struck: dict[str, list[Blow]]


def arm_scores(job: tuple[Extent, int, int]) -> Arm:
    """Train, simulate and score the arm ``job[2]`` of the study's seed ``job[1]``."""
    extent, seed, arm = job
    return scored(extent, seed, arm, train(seed, arm, extent.names, extent.training, extent.under))


def scored(extent: Extent, seed: int, arm: int, detectors: dict[str, FittedDetector]) -> Arm:
    """Simulate and score detectors that are trained already."""
    payloads = tuple(sorted(map(float, set(TRAINING_PAYLOADS))))
    known, under = replace(extent.under, payloads=payloads), extent.under
    return Arm(
        arm,
        _free(detectors, stream(seed, CALIBRATE, 9), arm, extent.calibration_hours, known),
        _free(detectors, stream(seed, TEST, 9), arm, extent.hours, under),
        _struck(detectors, stream(seed, TEST, 10, arm), arm, extent.per_stratum, under),
    )


def _free(
    detectors: dict[str, FittedDetector],
    seed: int,
    arm: int,
    hours: float,
    under: Conditions,
) -> Free:
    """Episode by episode, speed by speed."""
    pools = [free_pool(seed, speed, (arm,), hours / len(SPEEDS), under) for speed in SPEEDS]
    return joined(
        [free_scores(detectors, simulate(episode)) for pool in pools for _, episode in pool]
    )


def _struck(
    detectors: dict[str, FittedDetector],
    seed: int,
    arm: int,
    per_stratum: int,
    under: Conditions,
) -> dict[str, list[Blow]]:
    found: dict[str, list[Blow]] = {name: [] for name in detectors}
    for k, speed in enumerate(SPEEDS if per_stratum else ()):
        for struck in struck_pool(seed, speed, (arm,), per_stratum, conditions=under, first=k):
            for name, detector in detectors.items():
                found[name] += _blows(detector, struck)
    return found


def _blows(detector: FittedDetector, struck: Struck) -> list[Blow]:
    trace, truth = struck.trace, struck.trace.truth
    assert truth is not None
    level = CollisionAlarm(detector, np.inf).sustained(trace)
    speed = recent_speed(trace.qd, trace.dt)
    found = []
    for collision, kept in zip(truth.collisions, struck.kept, strict=True):
        begin, end = detection_window(collision)
        rows = (trace.t >= begin - MERGE_GAP) & (trace.t <= end)
        if kept:
            t = trace.t[rows] - collision.onset
            found.append(Blow(collision.peak_tau, t, level[rows], speed[rows]))
    return found
