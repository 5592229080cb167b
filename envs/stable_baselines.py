"""The vector environments for Stable-Baselines3 (extra ``learn``)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

import tauguard  # noqa: F401  (registers the environments)
from tauguard.envs.gym.vector import VectorArmEnv
from tauguard.findings import ArgumentError


class NativeVecEnv(VecEnv):  # type: ignore[misc, unused-ignore]
    """``num_envs`` natively stepped copies of an environment for Stable-Baselines3.

    A finished copy is reset in the same step. The last observation of the finished episode is in
    ``infos[i]["terminal_observation"]``. ``infos[i]["TimeLimit.truncated"]`` says whether that
    episode was truncated.
    """

    def __init__(
        self, name: str, num_envs: int, keys: Sequence[str] | None = None, **keywords: Any
    ):
        """Make the copies.

        Args:
            name: name of the environment, such as "tauguard/Reach-v0".
            num_envs: number of copies.
            keys: keys in the ``info`` of each copy; default: all. Few keys save time.
            **keywords: keywords of the environment, ``threads`` and ``max_episode_steps``.

        Raises:
            ArgumentError: not an environment of tauguard, or a keyword that the environment
                refuses.
        """
        envs = gymnasium.make_vec(
            name,
            num_envs=num_envs,
            vectorization_mode="vector_entry_point",
            autoreset_mode=AutoresetMode.SAME_STEP.value,
            **keywords,
        ).unwrapped
        if not isinstance(envs, VectorArmEnv):
            raise ArgumentError(f"{name}: expected an environment of tauguard")
        self.envs, self._keys = envs, None if keys is None else tuple(keys)
        self.render_mode = envs.render_mode
        super().__init__(num_envs, envs.single_observation_space, envs.single_action_space)
        self._actions: NDArray[Any] | None = None

    def reset(self) -> Any:
        """Begin an episode of every copy, with the seeds given to :meth:`seed`, if any."""
        known = [seed for seed in self._seeds if seed is not None]
        seeds = [None if seed is None else int(seed) for seed in self._seeds]
        observation, infos = self.envs.reset(seed=seeds if known else None)
        self.reset_infos = [self._info(infos, i) for i in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return observation

    def step_async(self, actions: NDArray[Any]) -> None:
        """Store the actions for :meth:`step_wait`."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Apply the actions; returns observations, rewards, ends of episodes, infos."""
        assert self._actions is not None
        observation, reward, terminated, truncated, infos = self.envs.step(self._actions)
        over = terminated | truncated
        final = infos.get("final_info", infos)
        each = [self._info(final if over[i] else infos, i) for i in range(self.num_envs)]
        for i in np.flatnonzero(over):
            each[i]["terminal_observation"] = infos["final_obs"][i]
            each[i]["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
        return observation, reward.astype(np.float32), over, each

    def _info(self, infos: dict[str, Any], i: int) -> dict[str, Any]:
        keys = self._keys
        if keys is None:
            keys = tuple(key for key in infos if not key.startswith(("_", "final_")))
        return {key: infos[key][i] for key in keys}

    def close(self) -> None:
        """Close all copies."""
        self.envs.close()

    def get_images(self) -> list[NDArray[np.uint8] | None]:
        """A picture of each copy."""
        return list(self.envs.render() or [None] * self.num_envs)

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The attribute of the vector environment, repeated for each chosen copy."""
        return [getattr(self.envs, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: the copies share one scene.

        Raises:
            AttributeError: always.
        """
        raise AttributeError(
            f"{attr_name}: cannot be set, all copies share one scene; give it to the constructor"
        )

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> Any:
        """Call a method of the vector environment, once for each chosen copy."""
        method = getattr(self.envs, method_name)
        return [method(*args, **kwargs) for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """False for every copy."""
        return [False for _ in self._get_indices(indices)]
