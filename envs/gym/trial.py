"""Try an arm in every environment: overlaps, forces and divergences of episodes."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any

import gymnasium
import mujoco
import numpy as np
from numpy.typing import NDArray

import tauguard  # noqa: F401  (registers the environments)
from tauguard.models import Robot

#: Number of actions in an episode; the first half are zero, the others random.
ACTIONS = 60


@dataclass(frozen=True)
class ArmTrial:
    """The results of the episodes in one environment."""

    environment: str
    episodes: int
    overlaps: int  #: episodes that began in contact
    force: float  #: largest force on a link [N]
    bound: float  #: largest force that the arm can exert [N]
    diverged: int  #: episodes that diverged
    still: int  #: episodes in which an arm that stands still succeeds
    moved: dict[str, float]  #: things placed farther from the arm, and how far [m]
    refused: str = ""  #: why the environment cannot be made with this arm

    @property
    def passed(self) -> bool:
        """Whether nothing is wrong."""
        return not (self.refused or self.overlaps or self.diverged) and self.force <= self.bound


def try_arm(robot: str | Robot, episodes: int = 10, seed: int = 0) -> list[ArmTrial]:
    """Run episodes of every environment with an arm.

    Args:
        robot: as the keyword ``robot`` of an environment.
        episodes: number of episodes in each environment.
        seed: seed of the first episode.

    Raises:
        ValueError, FileNotFoundError: ``robot`` is not an arm.
    """
    names = [name for name in gymnasium.registry if name.startswith("tauguard/")]
    return [_tried(name, robot, episodes, seed) for name in names]


def _tried(name: str, robot: str | Robot, episodes: int, seed: int) -> ArmTrial:
    try:
        env: Any = _made(name, robot)
    except ValueError as error:
        return ArmTrial(name, 0, 0, 0.0, 0.0, 0, 0, {}, " ".join(str(error).split()))
    overlaps = diverged = succeeded = 0
    force = 0.0
    rng = np.random.default_rng(seed)
    still = np.zeros(env.action_space.shape)
    for episode in range(episodes):
        env.reset(seed=seed + episode)
        overlaps += _inside(env)
        reached = False
        for step in range(ACTIONS):
            random = rng.uniform(-1, 1, still.shape)
            *_, ended, cut, info = env.step(still if step < ACTIONS // 2 else random)
            force = max(force, info["force"])
            diverged += info["reason"].startswith("diverged")
            reached |= info["success"] and step < ACTIONS // 2
            if ended or cut:
                break
        succeeded += reached
    compiled = env.compiled
    env.close()
    bound, moved = compiled.force_bound.total, dict(compiled.layout.moved)
    return ArmTrial(name, episodes, overlaps, force, bound, diverged, succeeded, moved)


def _inside(env: Any) -> bool:
    """Whether a link of an arm overlaps anything, by MuJoCo's contacts."""
    model, data = env.model, copy.copy(env.data)
    mujoco.mj_fwdPosition(model, data)
    links = np.flatnonzero(np.isin(model.geom_bodyid, env.scene.link_bodies))
    touching = np.isin(data.contact.geom, links).any(axis=1)
    return bool((data.contact.dist[touching] < 0).any())


def first_picture(name: str, robot: str | Robot, seed: int = 0) -> NDArray[np.uint8]:
    """The beginning of an episode, shape (480, 640, 3).

    Raises:
        ValueError: the environment cannot be made with this arm.
        RuntimeError: OpenGL cannot start.
    """
    env = _made(name, robot, render_mode="rgb_array")
    env.reset(seed=seed)
    shown: NDArray[np.uint8] = env.render()
    env.close()
    return shown


def _made(name: str, robot: str | Robot, **keywords: Any) -> Any:
    return gymnasium.make(name, robot=robot, disable_env_checker=True, **keywords).unwrapped
