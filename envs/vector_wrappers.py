"""The wrappers of :mod:`tauguard.envs.wrappers` for vector environments, under the same names.

Other wrappers of vector environments are those of ``gymnasium.wrappers.vector`` and one's own
subclasses of ``gymnasium.vector.VectorWrapper``.
"""

from tauguard.envs.adapters.budget import VectorCostBudget as CostBudget
from tauguard.envs.adapters.observations import VectorCameraObservation as CameraObservation
from tauguard.envs.adapters.observations import VectorDetectorObservation as DetectorObservation
from tauguard.envs.adapters.reactions import VectorReaction as Reaction
from tauguard.envs.adapters.separation import VectorSpeedAndSeparation as SpeedAndSeparation

__all__ = [
    "CameraObservation", "CostBudget", "DetectorObservation", "Reaction", "SpeedAndSeparation",
]  # fmt: skip
