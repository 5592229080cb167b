"""Costs in the form that libraries of constrained reinforcement learning expect."""

from typing import Any

import gymnasium
from gymnasium.utils import RecordConstructorArgs

from tauguard.arrays import Array
from tauguard.envs.gym.base import arm_env
from tauguard.envs.gym.settings import positive


class CostBudget(gymnasium.Wrapper[Array, Array, Array, Array], RecordConstructorArgs):
    """Ends an episode once the sum of its costs exceeds a budget.

    ``info["cost_left"]`` is the rest of the budget; it is below 0 once the budget is exceeded.
    """

    def __init__(self, env: gymnasium.Env[Array, Array], limit: float) -> None:
        """Set the budget.

        Args:
            env: an environment of tauguard.
            limit: largest sum of ``info["cost"]`` in an episode [N s]; 0 allows no cost.

        Raises:
            ValueError: the limit is below 0 or not finite.
        """
        RecordConstructorArgs.__init__(self, limit=limit)
        gymnasium.Wrapper.__init__(self, env)
        arm_env(env)
        if limit != 0:
            positive("limit", limit)
        self._limit = float(limit)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode with the full budget."""
        observation, info = self.env.reset(seed=seed, options=options)
        return observation, info | {"cost_left": self._limit}

    def step(self, action: Array) -> tuple[Array, Any, bool, bool, dict[str, Any]]:
        """Apply the action; the episode is terminated once the budget is exceeded."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        left = self._limit - info["cost_sum"]
        return observation, reward, terminated or left < 0, truncated, info | {"cost_left": left}


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
