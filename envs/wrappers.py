"""All Gymnasium wrappers of tauguard, to import from one module."""

from tauguard.envs.adapters.budget import CostBudget, CostStep
from tauguard.envs.adapters.observations import CameraObservation, DetectorObservation
from tauguard.envs.adapters.reactions import REACTIONS, TRIGGERS, Reaction
from tauguard.envs.adapters.recording import RecordMcap
from tauguard.envs.adapters.separation import SpeedAndSeparation

__all__ = [
    "REACTIONS", "TRIGGERS", "CameraObservation", "CostBudget", "CostStep", "DetectorObservation",
    "Reaction", "RecordMcap", "SpeedAndSeparation",
]  # fmt: skip
