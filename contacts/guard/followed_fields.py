"""Fields of a model that a guard copies or derives from; it reads all others at each step."""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.contacts.checker import geom_kinds

#: Which pairs there are.
_PAIRS = (
    *("geom_type", "geom_contype", "geom_conaffinity", "geom_bodyid", "geom_dataid"),
    *("flex_contype", "flex_conaffinity", "flex_selfcollide", "flex_rigid", "flex_dim"),
    *("body_weldid", "body_parentid", "body_dofnum", "exclude_signature"),
    *("pair_geom1", "pair_geom2"),
)
#: Shapes, and where they are on their bodies.
_SHAPES = (
    *("geom_size", "geom_pos", "geom_quat", "geom_sameframe", "body_ipos", "body_iquat"),
    *("flex_radius", "flex_elem", "flex_vertbodyid"),
)
#: Stiffness of elastic flexes, and what turns or is carried by mocap bodies.
_MOTION = (
    *("flex_stiffness", "flexedge_length0", "jnt_type", "eq_type", "eq_objtype"),
    *("eq_obj1id", "eq_obj2id", "body_mocapid", "site_bodyid"),
)
#: Of these each row must be finite.
_FINITE = ("geom_size", "geom_pos", "geom_quat", "body_ipos", "body_iquat", "flex_radius")
#: MuJoCo normalizes quaternions when it compiles, and takes them for unit ones afterwards.
_UNIT = 1e-6

Regions = list[tuple[int, int]]


def followed_fields(model: Any, options: Regions) -> Regions:
    """Addresses and sizes in bytes of the fields that a guard of this model depends on.

    Args:
        model: MjModel.
        options: of fields that are no arrays.
    """
    out = list(options)
    for name in (*_PAIRS, *_SHAPES, *_MOTION):
        array = getattr(model, name)
        if array.size:
            out.append((array.ctypes.data, array.nbytes))
    vertices = model.mesh_vert
    for row in hull_rows(model).tolist():
        out.append((vertices[row].ctypes.data, vertices[row].nbytes))
    return out


def hull_rows(model: Any) -> NDArray[np.int64]:
    """Vertices of the hulls of all meshes that are geoms: rows of ``mesh_vert``, in order."""
    rows = []
    kinds = np.array(geom_kinds(model))
    for mesh in np.unique(model.geom_dataid[kinds == "mesh"]).tolist():
        start, graph = int(model.mesh_vertadr[mesh]), int(model.mesh_graphadr[mesh])
        local = np.arange(int(model.mesh_vertnum[mesh]))
        if graph >= 0:
            number = int(model.mesh_graph[graph])
            local = model.mesh_graph[graph + 2 + number : graph + 2 + 2 * number]
        rows.append(start + np.unique(local).astype(np.int64))
    return np.concatenate(rows) if rows else np.zeros(0, dtype=np.int64)


def refuse_shapes(model: Any) -> None:
    """Refuse shapes with which no guard can work.

    Raises:
        ValueError: a number that is not finite, a negative size or a quaternion that is not of
            unit length (field and row).
    """
    for name in _FINITE:
        rows = getattr(model, name)
        rows = rows[:, None] if rows.ndim == 1 else rows
        for row in np.flatnonzero(~np.isfinite(rows).all(axis=1)).tolist():
            raise ValueError(f"{name}: row {row} is {rows[row].tolist()}, not finite")
    for name in ("geom_quat", "body_iquat"):
        rows = getattr(model, name)
        for row in np.flatnonzero(np.abs(np.linalg.norm(rows, axis=1) - 1) > _UNIT).tolist():
            raise ValueError(f"{name}: row {row} is {rows[row].tolist()}, not of unit length")
    plane = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    for row in np.flatnonzero((model.geom_size < 0).any(axis=1) & ~plane).tolist():
        raise ValueError(f"geom_size: row {row} is {model.geom_size[row].tolist()}, negative")
    for row in np.flatnonzero(model.flex_radius < 0).tolist():
        raise ValueError(f"flex_radius: row {row} is {model.flex_radius[row]}, negative")
    hulls = hull_rows(model)
    for row in hulls[~np.isfinite(model.mesh_vert[hulls]).all(axis=1)].tolist():
        raise ValueError(f"mesh_vert: row {row} is {model.mesh_vert[row].tolist()}, not finite")
