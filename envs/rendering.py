"""Pictures of an environment; nothing of it is imported before the first one."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.envs.world import World

#: Of a picture [px].
HEIGHT, WIDTH = 480, 640
#: Groups that are shown: bodies and obstacles, and the arm's visual shapes; not its collision ones.
SHOWN = (0, 1, 2)
#: Lights, and what is seen where nothing is.
AMBIENT, DIFFUSE, SKY = 0.35, 0.4, ((0.93, 0.95, 0.97), (0.78, 0.83, 0.90))
#: The floor that is drawn, not simulated: half extents and grid [m], height [m] and colour.
FLOOR, FLOOR_HEIGHT, FLOOR_COLOUR = (8.0, 8.0, 1.0), -0.001, (0.80, 0.82, 0.85, 1.0)
#: What an arm stands on where people stand lower: half its extents [m] and colour.
PEDESTAL, PEDESTAL_COLOUR = (0.25, 0.3), (0.62, 0.64, 0.67, 1.0)
#: The lamp that throws the shadows: where it stands [m], shining down, and how bright.
LAMP, LAMP_COLOUR = (0.0, 0.0, 3.0), 0.35
#: Shadows fall this far from the middle of the scene [m].
SHADOW_REACH = 3.0
#: Radius [m] and colour of the ball that marks a target.
MARK, MARK_COLOUR = 0.03, (0.1, 0.8, 0.3, 0.7)


def _need_display() -> None:
    """A window on Linux without a display would end the process."""
    if sys.platform == "linux" and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise RuntimeError(
            "render_mode 'human' needs a display and there is none; use 'rgb_array' with "
            "MUJOCO_GL=egl, or `tauguard watch`"
        )


def _staged(world: World) -> mujoco.MjModel:
    """The scene with floor, sky and lamp, which are drawn and not simulated."""
    spec = mujoco.MjSpec.from_string(world.scene.xml)
    bright, blue = SKY
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=blue,
        rgb2=bright,
        width=256,
        height=256,
    )
    person = world.person
    floor = FLOOR_HEIGHT if person is None else person.floor
    _draw(spec, mujoco.mjtGeom.mjGEOM_PLANE, FLOOR, [0, 0, floor], FLOOR_COLOUR)
    if floor < FLOOR_HEIGHT:
        height = (FLOOR_HEIGHT - floor) / 2
        for base in _bases(world):
            place = [base[0], base[1], FLOOR_HEIGHT - height]
            _draw(spec, mujoco.mjtGeom.mjGEOM_BOX, [*PEDESTAL, height], place, PEDESTAL_COLOUR)
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=LAMP,
        dir=[0, 0, -1],
        diffuse=[LAMP_COLOUR] * 3,
        castshadow=True,
    )
    return spec.compile()


def _draw(
    spec: mujoco.MjSpec, kind: Any, size: Sequence[float], place: Sequence[float], rgba: Any
) -> None:
    """A shape that only shows."""
    spec.worldbody.add_geom(type=kind, size=size, pos=place, rgba=rgba, contype=0, conaffinity=0)


def _bases(world: World) -> list[NDArray[np.float64]]:
    """Where the arms stand [m]."""
    model = world.scene.model
    return [model.body_pos[model.body_rootid[body]] for _, body, _ in world.tools]


class Picture:
    """A camera on one copy of a world: off-screen, or a window."""

    def __init__(self, world: World, data: mujoco.MjData, mode: str) -> None:
        """Open it.

        Raises:
            RuntimeError: there is nothing to draw with; the message says what would help.
        """
        self._world, self._data, self._mode = world, data, mode
        #: The scene as it is shown, and its own state, which follows the simulated one.
        self._model = _staged(world)
        self._drawn = mujoco.MjData(self._model)
        self._window: Any = None
        self._renderer: Any = None
        model = self._model
        model.vis.global_.offwidth = max(model.vis.global_.offwidth, WIDTH)
        model.vis.global_.offheight = max(model.vis.global_.offheight, HEIGHT)
        model.vis.quality.offsamples = 8
        model.vis.quality.shadowsize = 2048
        model.vis.map.shadowclip = SHADOW_REACH / model.stat.extent
        model.vis.headlight.ambient[:] = AMBIENT
        model.vis.headlight.diffuse[:] = DIFFUSE
        self._camera = mujoco.MjvCamera()
        self._look(self._camera)
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = [int(group in SHOWN) for group in range(6)]
        if mode == "human":
            _need_display()
        try:
            if mode == "human":
                from mujoco import viewer

                self._window = viewer.launch_passive(
                    model, self._drawn, show_left_ui=False, show_right_ui=False
                )
                self._look(self._window.cam)
            else:
                self._renderer = mujoco.Renderer(model, HEIGHT, WIDTH)
        except Exception as error:
            raise RuntimeError(
                f"no picture: {error}; without a display use render_mode='rgb_array' and set "
                "MUJOCO_GL=egl (or osmesa) before Python starts"
            ) from error

    def _look(self, camera: Any) -> None:
        """From beside the first arm's front; two arms from the side, so that neither hides one."""
        world, reach = self._world, self._world.reach
        if world.person is not None:
            places = np.array([*_bases(world), [*world.person.position, 0.0]])
            x, y = places[:, :2].mean(axis=0)
            camera.lookat[:] = (x, y, world.person.floor + 0.5 * world.person.stature)
            camera.distance, camera.azimuth, camera.elevation = 2.9, 130.0, -12.0
        elif world.arms == 1:
            camera.lookat[:] = (0.35 * reach, 0.0, 0.4 * reach)
            camera.distance, camera.azimuth, camera.elevation = 1.9 * reach, 140.0, -20.0
        else:
            base = self._model.body_pos[self._model.body_rootid[world.tools[-1][1]]]
            camera.lookat[:] = (base[0] / 2, base[1] / 2, 0.35 * reach)
            camera.distance, camera.azimuth, camera.elevation = 2.4 * reach, 100.0, -20.0

    def show(self, targets: NDArray[np.float64]) -> NDArray[np.uint8] | None:
        """Draw the state and a ball at each target, shape (arms, 3)."""
        if self._window is not None:
            with self._window.lock():
                self._follow()
                scene = self._window.user_scn
                scene.ngeom = 0
                self._mark(scene, targets)
            self._window.sync()
            return None
        self._follow()
        self._renderer.update_scene(self._drawn, self._camera, self._options)
        self._mark(self._renderer.scene, targets)
        pixels: NDArray[np.uint8] = self._renderer.render()
        return pixels

    def _follow(self) -> None:
        model, drawn = self._model, self._drawn
        for name in ("qpos", "qvel", "mocap_pos", "mocap_quat"):
            getattr(drawn, name)[:] = getattr(self._data, name)
        drawn.time = self._data.time
        for place in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_flex):
            place(model, drawn)

    def _mark(self, scene: Any, targets: NDArray[np.float64]) -> None:
        """A ball at each target."""
        for target in targets:
            if scene.ngeom >= scene.maxgeom:
                return
            mujoco.mjv_initGeom(
                scene.geoms[scene.ngeom],
                mujoco.mjtGeom.mjGEOM_SPHERE,
                np.full(3, MARK),
                np.array(target),
                np.eye(3).ravel(),
                np.array(MARK_COLOUR, dtype=np.float32),
            )
            scene.ngeom += 1

    def close(self) -> None:
        """Close window or renderer."""
        for part in (self._window, self._renderer):
            if part is not None:
                part.close()
        self._window = self._renderer = None
