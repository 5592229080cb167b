"""Generation of labelled episodes, and loaders of real logs."""

from tauguard.datasets.generate import simulate_all, write_dataset
from tauguard.datasets.plans import (
    TRAINING_PAYLOADS,
    collision_plans,
    free_episodes,
    struck_episodes,
)

__all__ = [
    "TRAINING_PAYLOADS",
    "collision_plans",
    "free_episodes",
    "simulate_all",
    "struck_episodes",
    "write_dataset",
]
