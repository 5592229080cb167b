"""The detectors of one arm: its training set, their training, the motion for their thresholds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from studies.detection.pool import Conditions, free_pool
from studies.detection.thresholds import free_scores, joined
from tauguard.datasets.plans import TRAINING_PAYLOADS, free_episodes, struck_episodes
from tauguard.detectors import Detector, FittedDetector, FreeScores
from tauguard.detectors.calibration.nominal import nominal_design
from tauguard.detectors.registry import make_detector
from tauguard.envs import simulate
from tauguard.traces import Trace

#: Percent of the maximum speed in the training slices.
TRAINING_SPEEDS = (10.0, 30.0, 60.0, 20.0, 45.0)
#: The current-predicting network, whose specificity sets everybody's first two thresholds.
NETWORK = "current-network"
#: Streams of seeds: training, thresholds, judged motions.
TRAIN, CALIBRATE, TEST = 11, 12, 13


def stream(seed: int, *key: int) -> int:
    """A seed of its own for every purpose, so that judged motions are never trained on."""
    return int(np.random.SeedSequence([seed, *key]).generate_state(1)[0])


@dataclass(frozen=True)
class Training:
    """How much one arm's detectors are trained with."""

    slices: int = 15  #: with collisions, through the dissertation's payloads
    collisions: int = 5  #: a slice
    free: int = 20  #: collision-free slices
    free_seconds: float = 40.0  #: of each

    def traces(self, seed: int, arm: int, conditions: Conditions | None = None) -> list[Trace]:
        """The slices of one arm."""
        under = conditions or Conditions()
        own, mismatch = stream(seed, TRAIN, arm), under.arm(arm)
        payloads = TRAINING_PAYLOADS
        struck = struck_episodes(
            own, self.slices, self.collisions, TRAINING_SPEEDS, payloads, mismatch
        )
        free = free_episodes(
            own, self.free, self.free_seconds, TRAINING_SPEEDS, payloads[::2], mismatch
        )
        return [under.simulated(episode) for episode in [*struck, *free]]


def training_groups(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Detectors that are trained together; neighbours of the registry share their front end."""
    half = -(-len(names) // 2)
    return [group for group in (tuple(names[:half]), tuple(names[half:])) if group]


def train(
    seed: int,
    arm: int,
    names: Sequence[str],
    training: Training,
    conditions: Conditions | None = None,
) -> dict[str, FittedDetector]:
    """The detectors of one arm, trained on its slices."""
    detectors = {name: make_detector(name) for name in names}
    return fitted(seed, arm, detectors, training, conditions)


def fitted(
    seed: int,
    arm: int,
    detectors: Mapping[str, Detector],
    training: Training,
    conditions: Conditions | None = None,
) -> dict[str, FittedDetector]:
    """The same for detectors that need not be in the registry."""
    under = conditions or Conditions()
    traces, robot = training.traces(seed, arm, under), nominal_design(under.robot)
    return {name: detector.fit(traces, robot) for name, detector in detectors.items()}


def calibration_scores(
    seed: int, arm: int, detectors: dict[str, FittedDetector], speed: float, hours: float
) -> dict[str, list[FreeScores]]:
    """What detectors say of the arm's collision-free motion with the training payloads."""
    under = Conditions(payloads=tuple(sorted(map(float, set(TRAINING_PAYLOADS)))))
    pool = free_pool(stream(seed, CALIBRATE), speed, (arm,), hours, under)
    return joined([free_scores(detectors, simulate(episode)) for _, episode in pool])
