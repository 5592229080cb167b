"""Convex bodies from objects of MuJoCo, coal and trimesh."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.findings import ArgumentError
from tauguard.rigid.curved import Cones, Cylinders, Ellipsoids, HalfSpaces
from tauguard.rigid.rounded import Capsules, Spheres
from tauguard.rigid.shapes import Boxes, Hulls, Shape


def hulls(clouds: Sequence[ArrayLike]) -> Hulls:
    """One hull for each (M, 3) array of points."""
    points = [np.asarray(cloud, dtype=np.float64).reshape(-1, 3) for cloud in clouds]
    return Hulls(np.concatenate(points), np.cumsum([0, *map(len, points)]))


def from_trimesh(meshes: Any) -> Hulls:
    """See :meth:`Shape.from_trimesh`."""
    given: Sequence[Any] = meshes if isinstance(meshes, list | tuple) else [meshes]
    for row, mesh in enumerate(given):
        if not (hasattr(mesh, "vertices") and hasattr(mesh, "faces")):
            raise ArgumentError(
                f"meshes: row {row} is a {type(mesh).__name__}, expected a trimesh.Trimesh"
            )
    # The hull's own vertices are fewer; trimesh finds them with SciPy.
    return hulls([mesh.convex_hull.vertices for mesh in given])


def from_coal(shapes: Any) -> Shape:
    """See :meth:`Shape.from_coal`."""
    given = shapes if isinstance(shapes, list | tuple) else [shapes]
    names = {type(shape).__name__ for shape in given}
    if len(names) != 1:
        raise ArgumentError(
            f"shapes: {', '.join(sorted(names)) or 'none'}; a batch has bodies of one class"
        )
    name, (zero, n) = names.pop(), (np.zeros((len(given), 3)), len(given))

    def of(attribute: str) -> NDArray[np.float64]:
        return np.array([getattr(shape, attribute) for shape in given], dtype=np.float64)

    if name == "Box":
        return Boxes(zero, of("halfSide"))
    if name == "Sphere":
        return Spheres(zero, of("radius"))
    if name == "Capsule":
        end = np.zeros((n, 3))
        end[:, 2] = of("halfLength")
        return Capsules(-end, end, of("radius"))
    if name == "Cylinder":
        return Cylinders(zero, of("radius"), of("halfLength"))
    if name == "Cone":
        return Cones(zero, of("radius"), of("halfLength"))
    if name == "Ellipsoid":
        return Ellipsoids(zero, of("radii"))
    if name == "Halfspace":
        return HalfSpaces(of("n"), of("d"))
    if name.startswith("Convex"):
        return hulls([np.array(shape.points()) for shape in given])
    if name == "TriangleP":
        return hulls([np.array([shape.a, shape.b, shape.c]) for shape in given])
    raise ArgumentError(
        f"shapes: {name}, expected Box, Sphere, Capsule, Cylinder, Cone, Ellipsoid, Halfspace, "
        "Convex or TriangleP; a BVHModel is a MeshTree of its vertices and triangles"
    )


def from_mujoco(model: Any, geoms: Any) -> Shape:
    """See :meth:`Shape.from_mujoco`."""
    import mujoco

    given = [geoms] if isinstance(geoms, str | int | np.integer) else list(geoms)
    ids = [_geom_id(mujoco, model, geom) for geom in given]
    names = {mujoco.mjtGeom(int(model.geom_type[i])).name for i in ids}
    if len(names) != 1:
        raise ArgumentError(
            f"geoms: {', '.join(sorted(names)) or 'none'}; a batch has bodies of one type"
        )
    name, size = names.pop(), np.asarray(model.geom_size[ids], dtype=np.float64)
    place = np.asarray(model.geom_pos[ids], dtype=np.float64)
    flat = np.zeros((len(ids), 9))
    for row, i in enumerate(ids):
        mujoco.mju_quat2Mat(flat[row], model.geom_quat[i])
    turn = flat.reshape(-1, 3, 3)
    axis = turn[:, :, 2]
    if name == "mjGEOM_BOX":
        return Boxes(place, size, turn)
    if name == "mjGEOM_SPHERE":
        return Spheres(place, size[:, 0])
    if name == "mjGEOM_CAPSULE":
        along = size[:, 1:2] * axis
        return Capsules(place - along, place + along, size[:, 0])
    if name == "mjGEOM_CYLINDER":
        return Cylinders(place, size[:, 0], size[:, 1], turn)
    if name == "mjGEOM_ELLIPSOID":
        return Ellipsoids(place, size, turn)
    if name == "mjGEOM_PLANE":
        return HalfSpaces(axis, np.einsum("ij,ij->i", axis, place))
    if name == "mjGEOM_MESH":
        rows = [hull_rows(model, int(model.geom_dataid[i])) for i in ids]
        return hulls(
            [
                np.asarray(model.mesh_vert[r], dtype=np.float64) @ turn[k].T + place[k]
                for k, r in enumerate(rows)
            ]
        )
    raise ArgumentError(
        f"geoms: {name}, expected box, sphere, capsule, cylinder, ellipsoid, plane or mesh"
    )


def _geom_id(mujoco: Any, model: Any, geom: Any) -> int:
    if isinstance(geom, str):
        number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, geom)
        if number < 0:
            named = [model.geom(i).name for i in range(model.ngeom) if model.geom(i).name]
            raise ArgumentError(f"geoms: no geom {geom!r}; the model has {', '.join(named)}")
        return int(number)
    number = int(geom)
    if not 0 <= number < model.ngeom:
        raise ArgumentError(f"geoms: {number}, expected 0 to {model.ngeom - 1}")
    return number


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
