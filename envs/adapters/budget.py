"""Costs in the form that libraries of constrained reinforcement learning expect."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import VectorEnv, VectorWrapper

from tauguard.arrays import Array
from tauguard.envs.gym.base import arm_env
from tauguard.envs.gym.batch import Batch
from tauguard.envs.gym.rules import Rule
from tauguard.envs.gym.settings import positive
from tauguard.envs.gym.vector import vector_arm_env


class Budget(Rule):
    """Ends an episode once the sum of its costs exceeds a limit [N s]."""

    def __init__(self, batch: Batch, limit: float) -> None:
        """Set the limit."""
        super().__init__(batch)
        if limit != 0:
            positive("limit", limit)
        self._limit = float(limit)
        self.columns["cost_left"] = np.full(batch.rows, self._limit)

    def begin(self, i: int) -> None:
        """Begin with the full budget."""
        self.columns["cost_left"][i] = self._limit

    def look(self, i: int) -> None:
        """Subtract the costs so far."""
        left = self._limit - self.batch.metrics["cost_sum"][i]
        self.columns["cost_left"][i], self.over[i] = left, left < 0


class CostBudget(gymnasium.Wrapper[Any, Array, Any, Array], RecordConstructorArgs):
    """Ends an episode once the sum of its costs exceeds a budget.

    ``info["cost_left"]`` is the rest of the budget; it is below 0 once the budget is exceeded.
    """

    def __init__(self, env: gymnasium.Env[Any, Array], limit: float) -> None:
        """Set the budget.

        Args:
            env: an environment of tauguard.
            limit: largest sum of ``info["cost"]`` in an episode [N s]; 0 allows no cost.

        Raises:
            ArgumentError: the limit is below 0 or not finite.
        """
        RecordConstructorArgs.__init__(self, limit=limit)
        gymnasium.Wrapper.__init__(self, env)
        arm_env(env).rules.add(Budget, limit=limit)


class VectorCostBudget(VectorWrapper):
    """:class:`CostBudget` of every copy of a vector environment."""

    def __init__(self, env: VectorEnv[Any, Any, Any], limit: float) -> None:
        """Set the budget; arguments and errors as for :class:`CostBudget`."""
        super().__init__(env)
        vector_arm_env(env).rules.add(Budget, limit=limit)


class CostStep(gymnasium.Wrapper[Array, Array, Array, Array], RecordConstructorArgs):
    """``step`` returns observation, reward, cost, terminated, truncated and info.

    This is the interface of Safety-Gymnasium, which OmniSafe, SafePO and others use.
    """

    def __init__(self, env: gymnasium.Env[Array, Array], scale: float = 1.0) -> None:
        """Choose the unit of the cost.

        Args:
            env: an environment whose ``info`` has a cost.
            scale: factor on the cost, for libraries whose budgets have another unit [1/(N s)].

        Raises:
            ValueError: a scale that is not above 0.
        """
        RecordConstructorArgs.__init__(self, scale=scale)
        gymnasium.Wrapper.__init__(self, env)
        positive("scale", scale)
        self._scale = float(scale)

    def step(  # type: ignore[override]
        self, action: Array
    ) -> tuple[Array, Any, float, bool, bool, dict[str, Any]]:
        """Apply the action."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        cost = self._scale * float(info["cost"])
        return observation, reward, cost, terminated, truncated, info
