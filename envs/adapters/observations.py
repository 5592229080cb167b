"""Wrappers that add camera images, or a detector's residual and alarm, to the observation."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AutoresetMode, VectorEnv, VectorObservationWrapper, VectorWrapper
from gymnasium.vector.utils import batch_space

from tauguard.arrays import Array
from tauguard.envs.gym.base import arm_env
from tauguard.envs.gym.batch import Batch
from tauguard.envs.gym.rendering import Camera
from tauguard.envs.gym.settings import DETECTORS, one_of
from tauguard.envs.gym.vector import vector_arm_env
from tauguard.findings import ArgumentError

#: Bound of the residual in the observation [N m].
RESIDUAL_BOUND = 1e4
#: Largest depth of a picture [m].
FARTHEST = 10.0
#: Modes of a camera and the pictures that they give.
MODES = {
    "rgb": ("rgb",),
    "depth": ("depth",),
    "rgbd": ("rgb", "depth"),
    "segmentation": ("bodies",),
}


class CameraObservation(gymnasium.ObservationWrapper[Any, Any, Any], RecordConstructorArgs):
    """The observation becomes a dictionary of ``state`` and pictures.

    | key | shape | type | unit |
    |---|---|---|---|
    | state | as in the environment | float64 | see the environment's table |
    | rgb | (height, width, 3) | uint8 | |
    | depth | (height, width, 1) | float32 | m along the optical axis, at most 10 |
    | bodies | (height, width, 1) | int32 | id of the body; 0: world, -1: sky, cloth |

    It needs OpenGL. Without a display, install the library libegl1 or libosmesa6. The pixels depend
    on the renderer, so they can differ between machines.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        mode: str = "rgbd",
        height: int = 64,
        width: int = 64,
        view: str | None = None,
    ) -> None:
        """Open the camera.

        Args:
            env: an environment of tauguard.
            mode: "rgb", "depth", "rgbd" or "segmentation".
            height: height of the pictures [px].
            width: width of the pictures [px].
            view: as the keyword ``view`` of environments, such as the name of a camera in the
                robot's or an object's MJCF.

        Raises:
            ArgumentError: an unknown mode or view, or a height or width below 1.
            RuntimeError: OpenGL cannot start; the message suggests what to change.
        """
        RecordConstructorArgs.__init__(self, mode=mode, height=height, width=width, view=view)
        gymnasium.ObservationWrapper.__init__(self, env)
        self._eye = Eye(arm_env(env).batch, mode, (height, width), view)
        self.observation_space = spaces.Dict({"state": env.observation_space, **self._eye.spaces})

    def close(self) -> None:
        """Close the camera."""
        self._eye.camera.close()
        super().close()

    def observation(self, observation: Any) -> dict[str, Any]:
        """The observation with the pictures of the present state."""
        return {"state": observation, **self._eye.see(0)}


class VectorCameraObservation(VectorObservationWrapper):
    """:class:`CameraObservation` of every copy of a vector environment, with rows of pictures."""

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any],
        mode: str = "rgbd",
        height: int = 64,
        width: int = 64,
        view: str | None = None,
    ) -> None:
        """Open one camera for all copies; arguments as for :class:`CameraObservation`.

        Raises:
            ArgumentError: as there, or an environment that restarts copies in the same step: the
                last state of an episode cannot be drawn any more.
        """
        super().__init__(env)
        inner = vector_arm_env(env)
        if inner.autoreset_mode is AutoresetMode.SAME_STEP:
            raise ArgumentError("autoreset_mode SameStep: expected NextStep or Disabled")
        self._eye = Eye(inner.batch, mode, (height, width), view)
        parts = {"state": env.single_observation_space, **self._eye.spaces}
        self.single_observation_space: Any = spaces.Dict(parts)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the camera."""
        self._eye.camera.close()

    def observations(self, observations: Any) -> dict[str, Any]:
        """The observations with the pictures of the present states."""
        rows = [self._eye.see(i) for i in range(self.num_envs)]
        return {"state": observations} | {
            name: np.array([row[name] for row in rows]) for name in self._eye.spaces
        }


class Eye:
    """The camera of :class:`CameraObservation`, and what it sees of each copy."""

    def __init__(self, batch: Batch, mode: str, shape: tuple[int, int], view: str | None) -> None:
        """Open the camera."""
        one_of("mode", mode, tuple(MODES))
        self._batch = batch
        self.camera = Camera(batch.compiled, batch.datas[0], *shape, view)
        every: dict[str, Any] = {
            "rgb": spaces.Box(0, 255, (*shape, 3), np.uint8),
            "depth": spaces.Box(0.0, FARTHEST, (*shape, 1), np.float32),
            "bodies": spaces.Box(-1, self.camera.model.nbody - 1, (*shape, 1), np.int32),
        }
        self.spaces: dict[str, spaces.Space[Any]] = {name: every[name] for name in MODES[mode]}

    def see(self, i: int) -> dict[str, Any]:
        """The pictures of copy ``i``."""
        at, seen = (self._batch.target[i], self._batch.datas[i]), dict[str, Any]()
        for name in self.spaces:
            if name == "rgb":
                seen[name] = self.camera.show(*at)
            elif name == "depth":
                seen[name] = np.clip(self.camera.depths(*at), 0.0, FARTHEST)[..., None]
            else:
                seen[name] = self.camera.bodies(*at)[..., None]
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
        self._batch = arm_env(env).batch
        space: Any = _with_detector(self._batch, env.observation_space, detector)
        self.observation_space = space

    def observation(self, observation: Array) -> Array:
        """The observation with residual and alarm of the last action."""
        return _joined(observation, self._batch.residual[0], self._batch.alarm[0])


class VectorDetectorObservation(VectorWrapper):
    """:class:`DetectorObservation` of every copy of a vector environment."""

    def __init__(self, env: VectorEnv[Any, Any, Any], detector: Any = None) -> None:
        """Put the detector into the loop; arguments and errors as for the single environment."""
        super().__init__(env)
        self._arm = vector_arm_env(env)
        self.single_observation_space: Any = _with_detector(
            self._arm.batch, env.single_observation_space, detector
        )
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    def reset(self, **keywords: Any) -> tuple[Any, dict[str, Any]]:
        """Begin episodes."""
        observations, infos = self.env.reset(**keywords)
        return self._extended(observations, infos), infos

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Apply the actions."""
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        if "final_obs" in infos:
            final, last = infos["final_obs"], infos["final_info"]
            for i in np.flatnonzero(infos["_final_obs"]):
                final[i] = _joined(final[i], last["residual"][i], last["alarm"][i])
        return self._extended(observations, infos), rewards, terminated, truncated, infos

    def _extended(self, observations: Array, infos: dict[str, Any]) -> Array:
        rows = zip(observations, infos["residual"], infos["alarm"], strict=True)
        return np.array([_joined(*row) for row in rows])


def _with_detector(batch: Batch, box: Any, detector: Any) -> spaces.Box:
    """Put a detector into the loop; returns the space of the longer observation."""
    if not isinstance(box, spaces.Box):
        raise ArgumentError("goal=True: a detector cannot be appended to a dictionary")
    if detector is not None:
        batch.attach(detector)
    elif batch.compiled.settings.detector is None:
        raise ArgumentError(
            "detector: the environment has none; give one to the wrapper or gymnasium.make: "
            f"{', '.join(DETECTORS)}, or the path of a trained detector"
        )
    bound = np.full(len(batch.compiled.scene.joint_names), RESIDUAL_BOUND)
    low = np.concatenate([box.low, -bound, [0.0]])
    return spaces.Box(low, np.concatenate([box.high, bound, [1.0]]), dtype=np.float64)


def _joined(observation: Array, residual: Array, alarm: bool) -> Array:
    residual = np.clip(residual, -RESIDUAL_BOUND, RESIDUAL_BOUND)
    return np.concatenate([observation, residual, [float(alarm)]])
