"""MuJoCo: distances of convex meshes, and steps with and without speculative contacts."""

import contextlib
import os
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np


def start(mjcf: str, flags: int = 0) -> tuple[Any, Any]:
    """The compiled scene at its first keyframe, if it has one."""
    model = mujoco.MjModel.from_xml_string(mjcf)
    model.opt.enableflags |= flags
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    return model, data


def answer(model: Any, data: Any) -> float:
    """Return the last value of the sensor ``answer`` in the present state."""
    mujoco.mj_forward(model, data)
    return float(data.sensor("answer").data[-1])


@contextlib.contextmanager
def _quiet_library() -> Iterator[None]:
    """Silence standard error, on which Qhull inside MuJoCo warns of narrow hulls."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


class MuJoCo:
    """``mj_step`` and ``mj_geomDistance`` with their defaults."""

    name = "mujoco"
    flags = 0

    def convex_overlap(self, a: Any, b: Any) -> bool:
        """Whether the distance of two mesh geoms is at most 0."""
        spec = mujoco.MjSpec()
        for name, points in (("a", a), ("b", b)):
            mesh = spec.add_mesh(name=name, uservert=np.array(points, dtype=float).ravel())
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
            body = spec.worldbody.add_body(name=name)
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name)
        with _quiet_library():
            model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        return bool(mujoco.mj_geomDistance(model, data, 0, 1, 1e300, None) <= 0.0)

    def scene(self, mjcf: str, seconds: float) -> float:
        """Call ``mj_step`` up to the given time."""
        model, data = start(mjcf, self.flags)
        while data.time < seconds - model.opt.timestep / 2:
            mujoco.mj_step(model, data)
        return answer(model, data)


class Speculative:
    """Steps of MuJoCo with speculative contacts, its mode for fast bodies."""

    name = "mujoco-speculative"

    def scene(self, mjcf: str, seconds: float) -> float:
        """Call ``mj_step`` with the flag ``speculative`` up to the given time."""
        plain = MuJoCo()
        plain.flags = int(mujoco.mjtEnableBit.mjENBL_SPECULATIVE)
        return plain.scene(mjcf, seconds)
