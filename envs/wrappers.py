"""The wrappers in one place."""

from tauguard.envs.detecting import DetectorObservation
from tauguard.envs.reactions import REACTIONS, TRIGGERS, Reaction
from tauguard.envs.recording import RecordMcap
from tauguard.envs.separation import SpeedAndSeparation

__all__ = [
    "REACTIONS",
    "TRIGGERS",
    "DetectorObservation",
    "Reaction",
    "RecordMcap",
    "SpeedAndSeparation",
]
