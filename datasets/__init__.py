"""Labelled datasets (description, generation, inspection, reading) and loaders of real logs."""

from typing import TYPE_CHECKING

from tauguard.lazy import on_demand

if TYPE_CHECKING:
    from tauguard.datasets.alarm_files import judged_alarms
    from tauguard.datasets.arm_logs import read_log, read_logs, simulated
    from tauguard.datasets.columns import AS_IS, PRESETS, ColumnMap, Reading
    from tauguard.datasets.configuration import Configuration, Split
    from tauguard.datasets.configuration import load as load_configuration
    from tauguard.datasets.generation import generate_dataset
    from tauguard.datasets.plans import (
        SPEEDS,
        TRAINING_PAYLOADS,
        DemoPlan,
        collision_plans,
        demo_plan,
        free_episodes,
        struck_episodes,
    )
    from tauguard.datasets.reader import episodes_of_splits, read
    from tauguard.datasets.recordings import simulate_all, write_dataset
    from tauguard.datasets.twin_episodes import TwinEpisodes, twin_contacts

__all__ = [
    "AS_IS", "PRESETS", "SPEEDS", "TRAINING_PAYLOADS", "ColumnMap", "Configuration", "DemoPlan",
    "Reading", "Split", "TwinEpisodes", "collision_plans", "demo_plan", "episodes_of_splits",
    "free_episodes", "generate_dataset", "judged_alarms", "load_configuration", "read", "read_log",
    "read_logs", "simulate_all", "simulated", "struck_episodes", "twin_contacts", "write_dataset",
]  # fmt: skip

__getattr__ = on_demand(__name__)
