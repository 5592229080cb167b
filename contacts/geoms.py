"""Convert MuJoCo's geoms to convex shapes of the native kernel."""

from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.contacts._contacts import Scene
from tauguard.contacts.checker import geom_kinds
from tauguard.findings import ArgumentError

#: Native numbers of shapes, by kind of geom.
_CORES = {"plane": 0, "sphere": 1, "capsule": 2, "ellipsoid": 3, "cylinder": 4, "box": 5, "mesh": 6}
#: Kinds of geoms with a native shape.
CONVEX = tuple(_CORES)
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
        if kind not in _CORES:
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


def hull_rows(model: Any, mesh: int) -> NDArray[np.int64]:
    """Rows of ``mjModel.mesh_vert`` that are vertices of the convex hull of a mesh.

    MuJoCo stores the graph of the hull in ``mjModel.mesh_graph``. For a mesh without a graph the
    rows of all its vertices are returned; they have the same hull.
    """
    start, graph = int(model.mesh_vertadr[mesh]), int(model.mesh_graphadr[mesh])
    if graph < 0:
        return np.arange(start, start + int(model.mesh_vertnum[mesh]))
    number = int(model.mesh_graph[graph])
    local = model.mesh_graph[graph + 2 + number : graph + 2 + 2 * number]
    return start + np.asarray(local, dtype=np.int64)


def _add(scene: Scene, model: Any, geom: int, kind: str) -> None:
    size = model.geom_size[geom].astype(np.float64)
    radius = float(size[0]) if kind in ("sphere", "capsule") else 0.0
    mat = np.zeros(9)
    mujoco.mju_quat2Mat(mat, model.geom_quat[geom])
    vertices = normals = edges = _NONE
    if kind == "mesh":
        vertices = np.ascontiguousarray(hull_vertices(model, geom))
    elif kind == "box":
        normals = edges = np.eye(3)
    scene.add(
        _CORES[kind],
        size,
        radius,
        int(model.geom_bodyid[geom]),
        np.ascontiguousarray(model.geom_pos[geom], dtype=np.float64),
        mat,
        vertices,
        normals,
        edges,
    )
