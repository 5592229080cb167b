"""A wrapper that puts a detector into the loop and its say into the observation."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs

from tauguard.arrays import Array
from tauguard.envs.base import ArmEnv
from tauguard.envs.settings import DETECTORS

#: Bound of the residual in the observation [N m].
RESIDUAL_BOUND = 1e4


def arm_env(env: gymnasium.Env[Any, Any]) -> ArmEnv:
    """The arm environment inside ``env``.

    Raises:
        ValueError: there is none.
    """
    inner = env.unwrapped
    if not isinstance(inner, ArmEnv):
        raise ValueError(f"{inner}: expected an environment of tauguard, such as tauguard/Reach-v0")
    return inner


class DetectorObservation(gymnasium.Wrapper[Array, Array, Array, Array], RecordConstructorArgs):
    """Appends the detector's residual [N m], shape (n,), and its alarm (0 or 1).

    ``info["residual"]`` and ``info["alarm"]`` are the detector's, too.
    """

    def __init__(self, env: gymnasium.Env[Array, Array], detector: Any = None) -> None:
        """Put the detector into the loop.

        Args:
            env: an environment of tauguard.
            detector: a name, a model file or an object as of the keyword ``detector``; ``None``
                takes the environment's own.

        Raises:
            ValueError: no detector, or one that does not fit.
        """
        RecordConstructorArgs.__init__(self, detector=detector)
        gymnasium.Wrapper.__init__(self, env)
        inner = arm_env(env)
        if detector is not None:
            inner.cell.attach(detector)
        elif inner.world.settings.detector is None:
            raise ValueError(
                "detector: the environment has none; give one to the wrapper or to make: "
                f"{', '.join(DETECTORS)}, or the path of a trained detector"
            )
        n = len(inner.world.scene.joint_names)
        box = env.observation_space
        assert isinstance(box, spaces.Box)
        bound = np.append(np.full(n, RESIDUAL_BOUND), 1.0)
        self.observation_space = spaces.Box(
            np.concatenate([box.low, np.append(-bound[:-1], 0.0)]),
            np.concatenate([box.high, bound]),
            dtype=np.float64,
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._joined(observation, info), info

    def step(self, action: Array) -> tuple[Array, Any, bool, bool, dict[str, Any]]:
        """Act."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._joined(observation, info), reward, terminated, truncated, info

    def _joined(self, observation: Array, info: dict[str, Any]) -> Array:
        residual = np.clip(info["residual"], -RESIDUAL_BOUND, RESIDUAL_BOUND)
        return np.concatenate([observation, residual, [float(info["alarm"])]])
