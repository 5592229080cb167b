"""Goal-conditioned observations and rewards, in the form that hindsight experience replay needs."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike

from tauguard.arrays import Array
from tauguard.envs.gym.actions import DISTANCE_BOUND
from tauguard.envs.gym.batch import Batch
from tauguard.envs.gym.task import Task
from tauguard.findings import ArgumentError


class Goals:
    """The dictionary observation of ``goal=True``.

    ``observation`` lacks the entries that depend on the goal, because a learner exchanges goals
    afterwards. ``achieved_goal`` and ``desired_goal`` have the shape (g,), and (rows, g) in a
    vector environment.
    """

    def __init__(self, batch: Batch, task: Task) -> None:
        """Find the columns without the goal."""
        self._batch, self._task = batch, task
        self._columns = [k for k, entry in enumerate(batch.observations) if not entry.goal]
        size = len(task.desired(0))
        if len(task.achieved(0)) != size:
            raise ArgumentError(
                f"task {type(task).__name__}: achieved and desired have {len(task.achieved(0))} "
                f"and {size} numbers; expected the same number"
            )
        rows = [batch.observations[k] for k in self._columns]
        low, high = (np.array([getattr(row, end) for row in rows]) for end in ("low", "high"))
        goal = spaces.Box(-DISTANCE_BOUND, DISTANCE_BOUND, (size,), np.float64)
        self.space = spaces.Dict(
            {
                "observation": spaces.Box(low, high, dtype=np.float64),
                "achieved_goal": goal,
                "desired_goal": goal,
            }
        )

    def one(self, i: int) -> dict[str, Array]:
        """The observation of copy ``i``."""
        task, bound = self._task, DISTANCE_BOUND
        return {
            "observation": self._batch.observation[i, self._columns],
            "achieved_goal": np.clip(task.achieved(i), -bound, bound),
            "desired_goal": np.array(task.desired(i), dtype=np.float64),
        }

    def all(self) -> dict[str, Array]:
        """The observations of all copies, one row per copy."""
        rows = [self.one(i) for i in range(self._batch.rows)]
        return {key: np.array([row[key] for row in rows]) for key in self.space.spaces}


def goal_reward(task: Task, achieved: ArrayLike, desired: ArrayLike, info: Any) -> Any:
    """The task's reward of goals, shapes (g,) or (N, g), with a check of the shapes."""
    reached, wanted = np.asarray(achieved, dtype=float), np.asarray(desired, dtype=float)
    if reached.shape != wanted.shape:
        raise ArgumentError(
            f"achieved_goal {reached.shape}, desired_goal {wanted.shape}: expected one shape"
        )
    return task.goal_reward(reached, wanted, info)
