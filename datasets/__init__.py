"""Generation of labelled episodes, and loaders of real logs."""

from tauguard.datasets.columns import PRESETS, ColumnMap
from tauguard.datasets.demo import SPEEDS, DemoPlan, demo_plan
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
    "SPEEDS",
    "TRAINING_PAYLOADS",
    "ColumnMap",
    "DemoPlan",
    "Log",
    "collision_plans",
    "demo_plan",
    "free_episodes",
    "read_log",
    "simulate_all",
    "struck_episodes",
    "write_dataset",
]
