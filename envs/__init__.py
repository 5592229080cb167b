"""Simulation: the simulation loop, motions, injected collisions and Gymnasium environments.

``gymnasium.make("tauguard/Reach-v0")`` makes an environment. The modules ``wrappers``,
``controllers`` and ``policies`` work with environments.
"""

import importlib
from typing import Any

from tauguard.envs.episodes.episode import CollisionPlan, Episode, PayloadPick
from tauguard.envs.episodes.loop import Rollout, SimulationDiverged, SimulationLoop
from tauguard.envs.episodes.motions import Motion, Workspace, point_to_point, random_motion
from tauguard.envs.episodes.simulate import Simulation, simulate
from tauguard.envs.plant import Gains

__all__ = [
    "CollisionPlan", "Episode", "Gains", "Motion", "PayloadPick", "Rollout", "Simulation",
    "SimulationDiverged", "SimulationLoop", "Workspace", "first_picture", "point_to_point",
    "random_motion", "simulate", "try_arm",
]  # fmt: skip

#: Modules that are loaded at their first use.
_MODULES = ("controllers", "policies", "wrappers")


def __getattr__(name: str) -> Any:
    """Load one of ``_MODULES``, or a name of the trial of an arm."""
    if name in ("first_picture", "try_arm"):
        return getattr(importlib.import_module(f"{__name__}.gym.trial"), name)
    if name in _MODULES:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """All public names, loaded or not."""
    return sorted({*globals(), *_MODULES, *__all__} - {"Any", "importlib"})
