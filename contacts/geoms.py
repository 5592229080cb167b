"""Convert MuJoCo's geoms to convex shapes of the native kernel."""

from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.contacts._contacts import Scene
from tauguard.contacts.checker import geom_kinds
from tauguard.contacts.frames import frame_on_mover
from tauguard.findings import ArgumentError
from tauguard.rigid.imports import hull_rows

#: Numbers of the native kinds of bodies (``rigid/include/tauguard/rigid/bodies.hpp``) of geoms.
NATIVE_KINDS = {
    "plane": 5, "sphere": 6, "capsule": 7, "ellipsoid": 8, "cylinder": 9, "box": 1, "mesh": 3,
}  # fmt: skip
#: Kinds of geoms with a native shape.
CONVEX = tuple(NATIVE_KINDS)
_NONE = np.zeros((0, 3))


def native_scene(model: Any, geoms: Iterable[int], checker: str) -> Scene:
    """Make a native scene of ``geoms``; their positions in the list are their native numbers.

    Args:
        model: MjModel.
        geoms: Ids of the geoms.
        checker: Name of the checker, for error messages.

    Raises:
        ArgumentError: a geom of a kind that has no convex shape (the message names the geom).
    """
    scene = Scene()
    kinds = geom_kinds(model)
    for geom in geoms:
        kind = kinds[int(geom)]
        if kind not in NATIVE_KINDS:
            raise ArgumentError(
                f"{checker}: geom {geom_name(model, int(geom))} is a {kind}; this checker handles "
                f"{', '.join(CONVEX)} (skip=({kind!r},) excludes this kind)"
            )
        _add(scene, model, int(geom), kind)
    return scene


def geom_name(model: Any, geom: int) -> str:
    """The geom's name in quotes, or its number and body if it has no name."""
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom)
    if name:
        return repr(name)
    body = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, int(model.geom_bodyid[geom]))
    return f"{geom} (of body {body!r})"


def hull_vertices(model: Any, geom: int) -> Array:
    """Vertices of a mesh geom's convex hull, in the geom's frame. Shape (V, 3), m."""
    rows = hull_rows(model, int(model.geom_dataid[geom]))
    return np.asarray(model.mesh_vert[rows], dtype=np.float64)


def _add(scene: Scene, model: Any, geom: int, kind: str) -> None:
    size = model.geom_size[geom].astype(np.float64)
    radius = float(size[0]) if kind in ("sphere", "capsule") else 0.0
    mover, pos, mat = frame_on_mover(model, geom)
    vertices = normals = edges = _NONE
    if kind == "mesh":
        vertices = np.ascontiguousarray(hull_vertices(model, geom))
    elif kind == "box":
        normals = edges = np.eye(3)
    scene.add(
        NATIVE_KINDS[kind],
        size,
        radius,
        mover,
        pos,
        mat,
        vertices,
        normals,
        edges,
    )
