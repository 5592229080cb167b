"""A Gymnasium environment with the interface of ``dm_env``."""

from typing import Any

import dm_env
import gymnasium
import numpy as np
from dm_env import specs
from gymnasium import spaces


class DmEnvironment(dm_env.Environment):  # type: ignore[misc]
    """A Gymnasium environment with the interface of ``dm_env``.

    A truncated episode ends with discount 1, a terminated one with discount 0, as ``dm_env``
    defines it. :attr:`info` holds Gymnasium's ``info``.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], seed: int | None = None) -> None:
        """Wrap ``env``, with Box, Discrete or Dict spaces.

        Args:
            env: a Gymnasium environment.
            seed: seed of the first episode.

        Raises:
            ValueError: ``env`` has a space of another kind.
        """
        self._env, self._seed, self._over = env, seed, True
        self._observation_spec = _spec(env.observation_space, "observation")
        self._action_spec = _spec(env.action_space, "action")
        self.info: dict[str, Any] = {}

    def reset(self) -> dm_env.TimeStep:
        """Begin an episode."""
        observation, self.info = self._env.reset(seed=self._seed)
        self._seed, self._over = None, False
        return dm_env.restart(observation)

    def step(self, action: Any) -> dm_env.TimeStep:
        """Apply the action; the first step after the end of an episode resets instead."""
        if self._over:
            return self.reset()
        observation, reward, terminated, truncated, self.info = self._env.step(action)
        self._over = terminated or truncated
        if terminated:
            return dm_env.termination(float(reward), observation)
        if truncated:
            return dm_env.truncation(float(reward), observation)
        return dm_env.transition(float(reward), observation)

    def observation_spec(self) -> Any:
        """Spec of the observation: an array spec, or a dictionary of array specs."""
        return self._observation_spec

    def action_spec(self) -> Any:
        """Spec of the action."""
        return self._action_spec

    def close(self) -> None:
        """Close the wrapped environment."""
        self._env.close()


def _spec(space: gymnasium.Space[Any], name: str) -> Any:
    if isinstance(space, spaces.Dict):
        return {key: _spec(part, key) for key, part in space.spaces.items()}
    if isinstance(space, spaces.Box):
        return specs.BoundedArray(space.shape, space.dtype, space.low, space.high, name)
    if isinstance(space, spaces.Discrete):
        if space.start != 0:
            raise ValueError(f"{name}: a Discrete space from {space.start}; expected one from 0")
        return specs.DiscreteArray(int(space.n), np.int64, name)
    raise ValueError(f"{name}: a {type(space).__name__} space; expected Box, Discrete or Dict")
