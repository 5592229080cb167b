"""Tasks of one's own: the interface, and the registration with Gymnasium."""

from typing import Any

from tauguard.envs.gym.actions import Entry
from tauguard.envs.gym.base import ArmEnv
from tauguard.envs.gym.batch import Batch, StepMetrics
from tauguard.envs.gym.cloth_reach import ClothReach
from tauguard.envs.gym.compiled import CompiledScene, tool_position
from tauguard.envs.gym.reach import CarefulReach, Reach
from tauguard.envs.gym.react import React
from tauguard.envs.gym.task import Outcome, Task, task_of
from tauguard.envs.gym.two_arms import TwoArms
from tauguard.envs.gym.vector import VectorArmEnv

__all__ = [
    "ArmEnv", "Batch", "CarefulReach", "ClothReach", "CompiledScene", "Entry", "Outcome", "Reach",
    "React", "StepMetrics", "Task", "TwoArms", "VectorArmEnv", "register", "tool_position",
]  # fmt: skip


def register(
    name: str, task: type[Task] | str, max_episode_steps: int | None = None, **keywords: Any
) -> None:
    """Register a task with Gymnasium, for ``gymnasium.make`` and the native ``make_vec``.

    Args:
        name: id of the environment, such as "mine/Pick-v0".
        task: a subclass of :class:`Task`, or "module:Name".
        max_episode_steps: number of actions after which an episode is truncated.
        **keywords: defaults of the environment's keywords.

    Raises:
        ArgumentError: ``task`` is no task.
    """
    import gymnasium

    task_of(task, Task)
    gymnasium.register(
        id=name,
        entry_point=ArmEnv,
        vector_entry_point=VectorArmEnv,
        max_episode_steps=max_episode_steps,
        kwargs={"task": task, **keywords},
    )
