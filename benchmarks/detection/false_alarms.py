"""Whether a threshold for a rate of false alarms keeps to it, on ten arms of fresh seeds.

Every arm has its own detectors, trained as in the detection study, and thresholds from its own
collision-free motion with the training payloads. What is counted is other collision-free motion of
that arm, with payloads that were in no recording before. Nothing is struck, so the study is cheap
enough for many arms: one arm tells little of a rate, since a bad moment of one returns in all of
its motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tauguard.benchmarks.detection.fleet import CALIBRATE, TEST, Training, stream, train
from tauguard.benchmarks.detection.pool import SPEEDS, Conditions, free_pool
from tauguard.benchmarks.detection.thresholds import free_scores, joined
from tauguard.benchmarks.workers import Workers
from tauguard.datasets.plans import TRAINING_PAYLOADS
from tauguard.detectors import FittedDetector, FreeScores
from tauguard.envs import Episode, simulate

if TYPE_CHECKING:
    pass

#: Detectors of the study: the one that is shipped, and thresholds on the same residual.
NAMES = ("srq-svr", "moving-thresholds")

Each = Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[Any]]
Free = dict[str, list[FreeScores]]


@dataclass(frozen=True)
class Size:
    """How much is simulated."""

    arms: int
    asked: tuple[float, ...]  #: false alarms per hour
    training: Training
    calibration_hours: float  #: of each arm
    hours: float  #: fresh ones, of each arm


FULL = Size(10, (0.25, 1.0, 5.0), Training(), 0.75, 1.0)
QUICK = Size(2, (5.0, 30.0), Training(slices=5, free=6, free_seconds=20.0), 0.1, 0.05)


@dataclass(frozen=True)
class Arm:
    """One arm's scores without a collision, by detector."""

    seed: int
    calibration: Mapping[str, Sequence[FreeScores]]
    fresh: Mapping[str, Sequence[FreeScores]]


def arms_of(size: Size, seed: int, workers: int | None = None) -> list[Arm]:
    """Train, simulate and score; the same for any number of workers."""
    seeds = [51_000 + 100 * seed + k for k in range(size.arms)]
    with Workers(workers) as each:
        fitted = dict(zip(seeds, each(_train, [(size, seed, arm) for arm in seeds]), strict=True))
        known = Conditions(payloads=tuple(sorted(map(float, set(TRAINING_PAYLOADS)))))
        jobs: list[tuple[int, bool, dict[str, FittedDetector], list[Episode]]] = []
        for arm in seeds:
            for speed in SPEEDS:
                for fresh in (False, True):
                    hours = (size.hours if fresh else size.calibration_hours) / len(SPEEDS)
                    own = stream(seed, TEST if fresh else CALIBRATE, 9)
                    pool = free_pool(own, speed, (arm,), hours, None if fresh else known)
                    jobs.append((arm, fresh, fitted[arm], [episode for _, episode in pool]))
        parts = list(zip(jobs, each(_score, jobs), strict=True))
    found: dict[tuple[int, bool], list[Free]] = {}
    for (arm, fresh, *_), part in parts:
        found.setdefault((arm, fresh), []).append(part)
    return [Arm(arm, joined(found[arm, False]), joined(found[arm, True])) for arm in seeds]


def _train(job: tuple[Size, int, int]) -> dict[str, FittedDetector]:
    size, seed, arm = job
    return train(seed, arm, NAMES, size.training)


def _score(job: tuple[int, bool, dict[str, FittedDetector], list[Episode]]) -> Free:
    _, _, detectors, episodes = job
    return joined([free_scores(detectors, simulate(episode)) for episode in episodes])
