"""Generation of labelled episodes, and loaders of real logs."""

from tauguard.datasets.columns import PRESETS, ColumnMap
from tauguard.datasets.generate import simulate_all, write_dataset
from tauguard.datasets.logs import Log, read_log
from tauguard.datasets.plans import (
    TRAINING_PAYLOADS,
    collision_plans,
    free_episodes,
    struck_episodes,
)

__all__ = [
    "PRESETS",
    "TRAINING_PAYLOADS",
    "ColumnMap",
    "Log",
    "collision_plans",
    "free_episodes",
    "read_log",
    "simulate_all",
    "struck_episodes",
    "write_dataset",
]
