"""How it runs: the simulation loop, motions, injected collisions and environments."""

from tauguard.envs.episodes.episode import CollisionPlan, Episode, PayloadPick
from tauguard.envs.episodes.loop import Rollout, SimulationDiverged, SimulationLoop
from tauguard.envs.episodes.motions import Motion, Workspace, point_to_point, random_motion
from tauguard.envs.episodes.simulate import Simulation, simulate
from tauguard.envs.plant import Gains

__all__ = [
    "CollisionPlan",
    "Episode",
    "Gains",
    "Motion",
    "PayloadPick",
    "Rollout",
    "Simulation",
    "SimulationDiverged",
    "SimulationLoop",
    "Workspace",
    "point_to_point",
    "random_motion",
    "simulate",
]
