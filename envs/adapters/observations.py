"""Wrappers that add camera images, or a detector's residual and alarm, to the observation."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs

from tauguard.arrays import Array
from tauguard.envs.gym.base import arm_env
from tauguard.envs.gym.rendering import Camera
from tauguard.envs.gym.settings import DETECTORS, one_of
from tauguard.findings import ArgumentError

#: Bound of the residual in the observation [N m].
RESIDUAL_BOUND = 1e4
#: Largest depth of a picture [m].
FARTHEST = 10.0
MODES = ("rgb", "depth", "rgbd")


class CameraObservation(gymnasium.ObservationWrapper[Any, Any, Any], RecordConstructorArgs):
    """The observation becomes a dictionary of ``state``, ``rgb`` and ``depth``.

    | key | shape | type | unit |
    |---|---|---|---|
    | state | as in the environment | float64 | see the environment's table |
    | rgb | (height, width, 3) | uint8 | |
    | depth | (height, width, 1) | float32 | m along the optical axis, at most 10 |

    It needs OpenGL. Without a display, install the library libegl1 or libosmesa6. The pixels depend
    on the renderer, so they can differ between machines.
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
            height: height of the pictures [px].
            width: width of the pictures [px].

        Raises:
            ArgumentError: an unknown mode, or a height or width below 1.
            RuntimeError: OpenGL cannot start; the message suggests what to change.
        """
        RecordConstructorArgs.__init__(self, mode=mode, height=height, width=width)
        gymnasium.ObservationWrapper.__init__(self, env)
        one_of("mode", mode, MODES)
        if min(height, width) < 1:
            raise ArgumentError(f"height {height}, width {width}: expected 1 or more pixels")
        self._arm = arm_env(env)
        self._shape, self._mode = (height, width), mode
        self._camera = Camera(self._arm.compiled, self._arm.batch.datas[0], height, width)
        state = env.observation_space
        parts: dict[str, spaces.Space[Any]] = {"state": state}
        if mode != "depth":
            parts["rgb"] = spaces.Box(0, 255, (height, width, 3), np.uint8)
        if mode != "rgb":
            parts["depth"] = spaces.Box(0.0, FARTHEST, (height, width, 1), np.float32)
        self.observation_space = spaces.Dict(parts)

    def close(self) -> None:
        """Close the camera."""
        self._camera.close()
        super().close()

    def observation(self, observation: Array) -> dict[str, Any]:
        """The observation with the pictures of the present state."""
        seen: dict[str, Any] = {"state": observation}
        target = self._arm.batch.target[0]
        if self._mode != "depth":
            seen["rgb"] = self._camera.show(target)
        if self._mode != "rgb":
            depth = np.clip(self._camera.depths(target), 0.0, FARTHEST)
            seen["depth"] = depth[..., None].astype(np.float32)
        return seen


class DetectorObservation(gymnasium.ObservationWrapper[Array, Array, Array], RecordConstructorArgs):
    """Appends the detector's residual [N m], shape (n,), and its alarm (0 or 1).

    ``info["residual"]`` and ``info["alarm"]`` come from the same detector.
    """

    def __init__(self, env: gymnasium.Env[Array, Array], detector: Any = None) -> None:
        """Put the detector into the loop.

        Args:
            env: an environment of tauguard.
            detector: as the keyword ``detector`` of environments; ``None``: the environment's own.

        Raises:
            ArgumentError: there is no detector, or it was trained on another arm or sample rate.
        """
        RecordConstructorArgs.__init__(self, detector=detector)
        gymnasium.ObservationWrapper.__init__(self, env)
        self._arm = inner = arm_env(env)
        if detector is not None:
            inner.batch.attach(detector)
        elif inner.compiled.settings.detector is None:
            raise ArgumentError(
                "detector: the environment has none; give one to the wrapper or gymnasium.make: "
                f"{', '.join(DETECTORS)}, or the path of a trained detector"
            )
        n = len(inner.compiled.scene.joint_names)
        box = env.observation_space
        assert isinstance(box, spaces.Box)
        bound = np.append(np.full(n, RESIDUAL_BOUND), 1.0)
        self.observation_space = spaces.Box(
            np.concatenate([box.low, np.append(-bound[:-1], 0.0)]),
            np.concatenate([box.high, bound]),
            dtype=np.float64,
        )

    def observation(self, observation: Array) -> Array:
        """The observation with residual and alarm of the last action."""
        batch = self._arm.batch
        residual = np.clip(batch.residual[0], -RESIDUAL_BOUND, RESIDUAL_BOUND)
        return np.concatenate([observation, residual, [float(batch.alarm[0])]])
