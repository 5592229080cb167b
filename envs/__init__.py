"""How it runs: the simulation loop, motions, injected collisions and environments."""

from tauguard.envs.episode import CollisionPlan, Episode, PayloadPick
from tauguard.envs.loop import Rollout, SimulationDiverged, SimulationLoop
from tauguard.envs.motions import Motion, Workspace, point_to_point, random_motion
from tauguard.envs.plant import Gains
from tauguard.envs.simulate import Simulation, simulate

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
