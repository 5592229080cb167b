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
from tauguard.envs.gym.settings import one_of
from tauguard.findings import ArgumentError
from tauguard.models.obstacles import FLOOR_HEIGHT
from tauguard.models.picture import mark, opengl, staged

#: Size of a picture [px].
HEIGHT, WIDTH = 480, 640
#: Geom groups that are shown: bodies, obstacles, and the arm's visual shapes. The arm's collision
#: shapes are not shown.
SHOWN = (0, 1, 2)
#: Modes of ``render``, and the methods of :class:`Camera` that draw them.
METHODS = {"rgb_array": "show", "depth_array": "depths", "segmentation_array": "bodies"}
#: Shadows are drawn within this distance of the middle of the scene [m].
SHADOW_REACH = 3.0
#: Views by name: azimuth from the direction that the arm faces, and elevation [deg].
VIEWS = {
    "front": (180.0, -15.0),
    "left": (90.0, -15.0),
    "right": (-90.0, -15.0),
    "top": (0.0, -89.0),
}


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

    def look(self, camera: Any, view: str | None = None) -> None:
        """Place the camera: in front of a single arm, or at the side of two arms or of people.

        Args:
            camera: it is changed.
            view: one of :data:`VIEWS`, or the name of a camera of the scene.

        Raises:
            ArgumentError: no such view.
        """
        cameras = [self.model.camera(k).name for k in range(self.model.ncam)]
        if view in cameras:
            camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
            camera.fixedcamid = cameras.index(view)
            return
        self._stand(camera)
        if view is not None:
            one_of("view", view, (*VIEWS, *cameras))
            azimuth, camera.elevation = VIEWS[view]
            camera.azimuth = azimuth + np.degrees(self._world.layout.yaw)

    def _stand(self, camera: Any) -> None:
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

    def follow(self, data: mujoco.MjData | None = None) -> None:
        """Copy the simulated state; default: of the copy that was given first."""
        model, drawn, source = self.model, self.drawn, data or self._data
        for name in ("qpos", "qvel", "mocap_pos", "mocap_quat"):
            getattr(drawn, name)[:] = getattr(source, name)
        drawn.time = source.time
        for place in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_flex):
            place(model, drawn)


class Camera(Stage):
    """An off-screen camera that draws one copy of a compiled scene."""

    def __init__(
        self,
        compiled: CompiledScene,
        data: mujoco.MjData,
        height: int = HEIGHT,
        width: int = WIDTH,
        view: str | None = None,
    ) -> None:
        """Open the camera.

        Raises:
            ArgumentError: no such view, or a size below 1.
            RuntimeError: OpenGL cannot start; the message suggests what to change.
        """
        if min(height, width) < 1:
            raise ArgumentError(f"height {height}, width {width}: expected 1 or more pixels")
        super().__init__(compiled, data)
        size = self.model.vis.global_
        size.offwidth, size.offheight = max(size.offwidth, width), max(size.offheight, height)
        self._camera = mujoco.MjvCamera()
        self.look(self._camera, view)
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = [int(group in SHOWN) for group in range(6)]
        with opengl():
            self._renderer = mujoco.Renderer(self.model, height, width)

    def show(self, targets: NDArray[np.float64], data: mujoco.MjData | None = None) -> Any:
        """Draw the state and a ball at each target, shape (arms, 3).

        Returns:
            RGB image, shape (height, width, 3).
        """
        self._update(data)
        mark(self._renderer.scene, targets)
        return self._renderer.render()

    def depths(
        self, targets: NDArray[np.float64], data: mujoco.MjData | None = None
    ) -> NDArray[np.float32]:
        """Distance of each pixel along the optical axis [m], shape (height, width)."""
        self._update(data)
        mark(self._renderer.scene, targets)
        self._renderer.enable_depth_rendering()
        try:
            depth: NDArray[np.float32] = self._renderer.render()
        finally:
            self._renderer.disable_depth_rendering()
        return depth

    def bodies(
        self, targets: NDArray[np.float64], data: mujoco.MjData | None = None
    ) -> NDArray[np.int32]:
        """Id of the body at each pixel; 0: world, -1: sky, cloth. Shape (height, width)."""
        self._update(data)
        self._renderer.enable_segmentation_rendering()
        try:
            ids, kinds = np.moveaxis(self._renderer.render(), -1, 0)
        finally:
            self._renderer.disable_segmentation_rendering()
        geoms = (kinds == int(mujoco.mjtObj.mjOBJ_GEOM)) & (ids >= 0)
        bodies = self.model.geom_bodyid[np.where(geoms, ids, 0)]
        return np.where(geoms, bodies, -1).astype(np.int32)

    def _update(self, data: mujoco.MjData | None) -> None:
        self.follow(data)
        self._renderer.update_scene(self.drawn, self._camera, self._options)

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


class Pictures:
    """What ``render`` shows; it opens a window or a camera at its first picture."""

    def __init__(self, mode: str | None, height: int, width: int, view: str | None) -> None:
        """Check the mode.

        Raises:
            ArgumentError: an unknown mode, or a size below 1.
        """
        if mode is not None:
            one_of("render_mode", mode, (*METHODS, "human"))
        if min(height, width) < 1:
            raise ArgumentError(f"height {height}, width {width}: expected 1 or more pixels")
        self.mode, self._form = mode, (height, width, view)
        self._opened: Any = None

    def draw(
        self, compiled: CompiledScene, data: mujoco.MjData, targets: NDArray[np.float64]
    ) -> Any:
        """The picture of a copy; None in "human" mode."""
        if self.mode == "human":
            self._opened = self._opened or Window(compiled, data)
            return self._opened.show(targets)
        self._opened = self._opened or Camera(compiled, data, *self._form)
        return getattr(self._opened, METHODS[str(self.mode)])(targets, data)

    def close(self) -> None:
        """Close the window or the camera."""
        if self._opened is not None:
            self._opened.close()
            self._opened = None
