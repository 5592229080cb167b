"""What a camera beside the arm sees, as part of the observation."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs

from tauguard.arrays import Array
from tauguard.envs.detecting import arm_env
from tauguard.envs.rendering import Camera
from tauguard.envs.settings import one_of

Pictures = dict[str, Any]

#: Depths beyond this read as this [m].
FARTHEST = 10.0
MODES = ("rgb", "depth", "rgbd")


class CameraObservation(gymnasium.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """The observation becomes a dictionary of ``state``, ``rgb`` and ``depth``.

    | key | shape | type | unit |
    |---|---|---|---|
    | state | of the environment | float64 | as its table says |
    | rgb | (height, width, 3) | uint8 | |
    | depth | (height, width, 1) | float32 | m along the optical axis, at most 10 |

    Needs an OpenGL that MuJoCo finds (``MUJOCO_GL=egl`` without a display). The pixels depend on
    the renderer: they are the same bits on one machine only.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        mode: str = "rgbd",
        height: int = 64,
        width: int = 64,
    ) -> None:
        """Open the camera.

        Args:
            env: an environment of tauguard.
            mode: "rgb", "depth" or "rgbd".
            height: of the pictures [px].
            width: of the pictures [px].

        Raises:
            ValueError: an unknown mode or no pixels.
            RuntimeError: there is nothing to draw with; the message says what would help.
        """
        RecordConstructorArgs.__init__(self, mode=mode, height=height, width=width)
        gymnasium.Wrapper.__init__(self, env)
        one_of("mode", mode, MODES)
        if min(height, width) < 1:
            raise ValueError(f"height {height}, width {width}: expected 1 or more pixels")
        self._arm = arm_env(env)
        self._shape, self._mode = (height, width), mode
        self._camera = Camera(self._arm.world, self._arm.cell.datas[0], height, width)
        state = env.observation_space
        parts: dict[str, spaces.Space[Any]] = {"state": state}
        if mode != "depth":
            parts["rgb"] = spaces.Box(0, 255, (height, width, 3), np.uint8)
        if mode != "rgb":
            parts["depth"] = spaces.Box(0.0, FARTHEST, (height, width, 1), np.float32)
        self.observation_space = spaces.Dict(parts)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Pictures, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._seen(observation), info

    def step(self, action: Array) -> tuple[Pictures, Any, bool, bool, dict[str, Any]]:
        """Act."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._seen(observation), reward, terminated, truncated, info

    def close(self) -> None:
        """Close the camera."""
        self._camera.close()
        super().close()

    def _seen(self, observation: Array) -> Pictures:
        seen: Pictures = {"state": observation}
        target = self._arm.cell.target[0]
        if self._mode != "depth":
            seen["rgb"] = self._camera.colours(target)
        if self._mode != "rgb":
            depth = np.clip(self._camera.depths(target), 0.0, FARTHEST)
            seen["depth"] = depth[..., None].astype(np.float32)
        return seen
