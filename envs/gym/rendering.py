"""Pictures of an environment; this module is only imported when the first picture is drawn."""

from __future__ import annotations

import os
import sys
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.envs.gym.compiled import CompiledScene
from tauguard.envs.gym.second_arm import APART
from tauguard.models.obstacles import FLOOR_HEIGHT
from tauguard.models.picture import mark, opengl, staged

#: Size of a picture [px].
HEIGHT, WIDTH = 480, 640
#: Geom groups that are shown: bodies, obstacles, and the arm's visual shapes. The arm's collision
#: shapes are not shown.
SHOWN = (0, 1, 2)
#: Shadows are drawn within this distance of the middle of the scene [m].
SHADOW_REACH = 3.0


def _need_display() -> None:
    """Raise an error on Linux without a display, where opening a window would end the process."""
    if sys.platform == "linux" and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise RuntimeError(
            "render_mode 'human' needs a display and there is none; use 'rgb_array' or "
            "`tauguard watch`"
        )


def _staged(compiled: CompiledScene) -> mujoco.MjModel:
    """The scene with a floor, a sky and a lamp, which are only drawn."""
    spec = mujoco.MjSpec.from_string(compiled.scene.xml)
    person = compiled.person
    floor = FLOOR_HEIGHT if person is None else person.floor
    return staged(spec, floor, _bases(compiled))


def _bases(compiled: CompiledScene) -> list[NDArray[np.float64]]:
    """Positions of the arms' bases [m]."""
    model = compiled.scene.model
    return [model.body_pos[model.body_rootid[body]] for _, body, _ in compiled.tools]


class Stage:
    """The scene that is drawn. It has its own state, which follows the simulated state."""

    def __init__(self, compiled: CompiledScene, data: mujoco.MjData) -> None:
        """Set the lights and place the camera."""
        self._world, self._data = compiled, data
        self.model = _staged(compiled)
        self.drawn = mujoco.MjData(self.model)
        self.model.vis.map.shadowclip = SHADOW_REACH / self.model.stat.extent

    def look(self, camera: Any) -> None:
        """Place the camera: in front of a single arm, or at the side of two arms or of people."""
        compiled, layout = self._world, self._world.layout
        reach = layout.reach
        if compiled.person is not None:
            places = np.array([*_bases(compiled), [*compiled.person.position, 0.0]])
            x, y = places[:, :2].mean(axis=0)
            camera.lookat[:] = (x, y, compiled.person.floor + 0.5 * compiled.person.stature)
            camera.distance, camera.azimuth, camera.elevation = 3.3, 102.0, -12.0
        elif compiled.arms == 1:
            camera.lookat[:] = layout.at((0.35 * reach, 0.0, 0.4 * reach))
            camera.distance, camera.azimuth, camera.elevation = 1.9 * reach, 140.0, -20.0
        else:
            camera.lookat[:] = layout.at((layout.apart(APART) / 2, 0.0, 0.35 * reach))
            camera.distance, camera.azimuth, camera.elevation = 2.4 * reach, 100.0, -20.0
        camera.azimuth += np.degrees(layout.yaw)

    def follow(self) -> None:
        """Copy the simulated state."""
        model, drawn = self.model, self.drawn
        for name in ("qpos", "qvel", "mocap_pos", "mocap_quat"):
            getattr(drawn, name)[:] = getattr(self._data, name)
        drawn.time = self._data.time
        for place in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_flex):
            place(model, drawn)


class Camera(Stage):
    """An off-screen camera that draws one copy of a compiled scene."""

    def __init__(
        self, compiled: CompiledScene, data: mujoco.MjData, height: int = HEIGHT, width: int = WIDTH
    ) -> None:
        """Open the camera.

        Raises:
            RuntimeError: OpenGL cannot start; the message suggests what to change.
        """
        super().__init__(compiled, data)
        size = self.model.vis.global_
        size.offwidth, size.offheight = max(size.offwidth, width), max(size.offheight, height)
        self._camera = mujoco.MjvCamera()
        self.look(self._camera)
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = [int(group in SHOWN) for group in range(6)]
        with opengl():
            self._renderer = mujoco.Renderer(self.model, height, width)

    def show(self, targets: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Draw the state and a ball at each target, shape (arms, 3).

        Returns:
            RGB image, shape (height, width, 3).
        """
        pixels: NDArray[np.uint8] = self._render(targets)
        return pixels

    def depths(self, targets: NDArray[np.float64]) -> NDArray[np.float32]:
        """Distance of each pixel along the optical axis [m], shape (height, width)."""
        self._renderer.enable_depth_rendering()
        try:
            depth: NDArray[np.float32] = self._render(targets)
        finally:
            self._renderer.disable_depth_rendering()
        return depth

    def _render(self, targets: NDArray[np.float64]) -> Any:
        self.follow()
        self._renderer.update_scene(self.drawn, self._camera, self._options)
        mark(self._renderer.scene, targets)
        return self._renderer.render()

    def close(self) -> None:
        """Close the renderer."""
        self._renderer.close()


class Window(Stage):
    """A window that shows one copy of a compiled scene."""

    def __init__(self, compiled: CompiledScene, data: mujoco.MjData) -> None:
        """Open the window.

        Raises:
            RuntimeError: there is no display, or OpenGL cannot start.
        """
        super().__init__(compiled, data)
        _need_display()
        with opengl():
            from mujoco import viewer

            self._window: Any = viewer.launch_passive(
                self.model, self.drawn, show_left_ui=False, show_right_ui=False
            )
            self.look(self._window.cam)

    def show(self, targets: NDArray[np.float64]) -> None:
        """Draw the state and a ball at each target, shape (arms, 3)."""
        with self._window.lock():
            self.follow()
            scene = self._window.user_scn
            scene.ngeom = 0
            mark(scene, targets)
        self._window.sync()

    def close(self) -> None:
        """Close the window."""
        self._window.close()


def open_view(compiled: CompiledScene, data: mujoco.MjData, mode: str) -> Any:
    """The view behind ``render``: a window if ``mode`` is "human", else a camera."""
    return (Window if mode == "human" else Camera)(compiled, data)
