"""The wrappers in one place."""

from tauguard.envs.budget import CostBudget, CostStep
from tauguard.envs.camera import CameraObservation
from tauguard.envs.detecting import DetectorObservation
from tauguard.envs.reactions import REACTIONS, TRIGGERS, Reaction
from tauguard.envs.recording import RecordMcap
from tauguard.envs.separation import SpeedAndSeparation

__all__ = [
    "REACTIONS",
    "TRIGGERS",
    "CameraObservation",
    "CostBudget",
    "CostStep",
    "DetectorObservation",
    "Reaction",
    "RecordMcap",
    "SpeedAndSeparation",
]
