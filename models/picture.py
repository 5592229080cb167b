"""Sky, floor, lamp and markers for pictures of a scene, and the choice and check of OpenGL."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from tauguard.models.obstacles import add_ground

#: Colours of the sky above and at the horizon.
SKY = ((0.93, 0.95, 0.97), (0.78, 0.83, 0.90))
#: The lamp that throws the shadows: where it stands [m], its direction and how bright it is. From
#: straight above, the floor would throw thin shadows on itself.
LAMP, DOWN, LAMP_COLOUR = (0.0, 0.0, 3.0), (0.06, 0.04, -1.0), 0.35
#: Ambient and diffuse light of the camera.
AMBIENT, DIFFUSE = 0.35, 0.4
#: Radius [m] and colour of the ball that marks a target; width [m] and colour of an arrow.
MARK, MARK_COLOUR = 0.03, (0.1, 0.8, 0.3, 0.7)
ARROW_WIDTH, ARROW_COLOUR = 0.012, (0.85, 0.1, 0.1, 1.0)


def staged(spec: mujoco.MjSpec, floor: float, bases: Sequence[ArrayLike] = ()) -> mujoco.MjModel:
    """The model of ``spec`` with sky, lamp and a floor at a height [m], all visual only.

    Arms at ``bases`` [m] get a pedestal where the floor is below them. A scene that has a floor
    keeps it.
    """
    if spec.geom("ground") is None:
        add_ground(spec, floor, bases, touchable=False)
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
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=LAMP,
        dir=DOWN,
        diffuse=[LAMP_COLOUR] * 3,
        castshadow=True,
    )
    model = spec.compile()
    model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = AMBIENT, DIFFUSE
    model.vis.quality.offsamples, model.vis.quality.shadowsize = 8, 2048
    return model


def _next(scene: Any, kind: Any, rgba: Any) -> Any:
    """The next free geom of a ``MjvScene``; None if the scene is full."""
    if scene.ngeom >= scene.maxgeom:
        return None
    shape, scene.ngeom = scene.geoms[scene.ngeom], scene.ngeom + 1
    colour = np.array(rgba, dtype=np.float32)
    mujoco.mjv_initGeom(shape, kind, np.full(3, MARK), np.zeros(3), np.eye(3).ravel(), colour)
    return shape


def mark(scene: Any, targets: ArrayLike) -> None:
    """Add a ball at each target to a ``MjvScene``; shape (arms, 3) [m]."""
    for target in np.asarray(targets, dtype=float):
        if (ball := _next(scene, mujoco.mjtGeom.mjGEOM_SPHERE, MARK_COLOUR)) is not None:
            ball.pos[:] = target


def point_at(scene: Any, point: ArrayLike, vector: ArrayLike) -> None:
    """Add an arrow [m] that ends at a point [m] to a ``MjvScene``."""
    end, kind = np.asarray(point, dtype=float), mujoco.mjtGeom.mjGEOM_ARROW
    if (arrow := _next(scene, kind, ARROW_COLOUR)) is not None:
        mujoco.mjv_connector(arrow, kind, ARROW_WIDTH, end - np.asarray(vector, dtype=float), end)


def check_opengl() -> None:
    """Check that an OpenGL context can be created.

    Raises:
        RuntimeError: as :func:`opengl`.
    """
    with opengl():
        mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 8, 8).close()


def _choose_opengl() -> None:
    """If there is no display and MUJOCO_GL is not set, choose EGL, else OSMesa."""
    chosen = ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY")
    if sys.platform != "linux" or any(os.environ.get(name) for name in chosen):
        return
    contexts: Any = vars(sys.modules[mujoco.Renderer.__module__])["gl_context"]
    platform = os.environ.get("PYOPENGL_PLATFORM")
    for name in ("egl", "osmesa"):
        with suppress(Exception):  # PyOpenGL raises several kinds where a library is missing
            contexts.GLContext = import_module(f"mujoco.{name}").GLContext
            return
        os.environ.pop("PYOPENGL_PLATFORM", None)
    if platform is not None:
        os.environ["PYOPENGL_PLATFORM"] = platform


@contextmanager
def opengl() -> Iterator[None]:
    """Context for drawing: chooses an OpenGL, and turns any error into one line.

    Raises:
        RuntimeError: one line that says what to install or to set.
    """
    _choose_opengl()
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="glfw")
            yield
    except Exception as error:
        said = " ".join(str(error).split())[:200]
        raise RuntimeError(
            "no picture: MuJoCo finds no OpenGL; without a display install libegl1 or libosmesa6 "
            "and use render_mode='rgb_array'; MUJOCO_GL=egl, osmesa or glfw chooses one "
            f"({type(error).__name__}: {said})"
        ) from error
