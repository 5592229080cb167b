"""What a picture of a scene needs beside it: sky, floor, lamp, and an OpenGL that starts."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco

#: Colours of the sky above and at the horizon, and of the floor.
SKY, FLOOR_COLOUR = ((0.93, 0.95, 0.97), (0.78, 0.83, 0.90)), (0.80, 0.82, 0.85, 1.0)
#: Half extents of the floor and its grid [m].
FLOOR = (8.0, 8.0, 1.0)
#: The lamp that throws the shadows: where it stands [m], shining down, and how bright.
LAMP, LAMP_COLOUR = (0.0, 0.0, 3.0), 0.35
#: Light of the camera: from everywhere, and from in front.
AMBIENT, DIFFUSE = 0.35, 0.4


def staged(spec: mujoco.MjSpec, floor: float) -> mujoco.MjModel:
    """The model of ``spec`` with sky, lamp and a floor at a height [m], which only show."""
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
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=FLOOR,
        pos=[0, 0, floor],
        rgba=FLOOR_COLOUR,
        contype=0,
        conaffinity=0,
    )
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=LAMP,
        dir=[0, 0, -1],
        diffuse=[LAMP_COLOUR] * 3,
        castshadow=True,
    )
    model = spec.compile()
    model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = AMBIENT, DIFFUSE
    model.vis.quality.offsamples, model.vis.quality.shadowsize = 8, 2048
    return model


@contextmanager
def opengl() -> Iterator[None]:
    """Turn an error of OpenGL's start into one line.

    Raises:
        RuntimeError: the line, with what to install or to set.
    """
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="glfw")
            yield
    except Exception as error:
        said = " ".join(str(error).split())[:200]
        raise RuntimeError(
            "no picture: MuJoCo finds no OpenGL; without a display set MUJOCO_GL=egl (library "
            "libegl1) or MUJOCO_GL=osmesa (libosmesa6) before Python starts, and use "
            f"render_mode='rgb_array' ({type(error).__name__}: {said})"
        ) from error
