"""coal's GJK, pair by pair: an independent peer of the kernels."""

from __future__ import annotations

import time
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from tauguard.rigid.rounded import Capsules, Rounded, Solid, Spheres
from tauguard.rigid.shapes import Bodies, Boxes, Hulls, Parallelepipeds, Tetrahedra

_TETRAHEDRON_FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
_BLOCK_FACES = (
    *((0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4)),
    *((2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5)),
)


def coal_module() -> Any:
    """The module ``coal`` (it comes with ``pin``).

    Raises:
        ValueError: it is not installed.
    """
    try:
        import coal
    except ImportError as error:
        raise ValueError(
            f"coal comes with the package pin: it is not installed ({error})"
        ) from None
    return coal


def collide(a: Bodies, b: Bodies, count: int) -> NDArray[np.bool_]:
    """coal's boolean answer of ``count`` rows. Its tolerance is coal's own (1e-6 and the like)."""
    left, right = geometries(a), geometries(b)
    left, right = (side * count if len(side) == 1 else side for side in (left, right))
    return np.array(collide_all(left, right)[0], dtype=np.bool_)


def collide_all(
    left: list[tuple[Any, Any]], right: list[tuple[Any, Any]]
) -> tuple[list[bool], float]:
    """Boolean answers of prepared pairs, and the processor seconds of the bare loop."""
    coal = coal_module()
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    request.enable_contact = False
    collide, clear = coal.collide, result.clear
    hit = []
    start = time.process_time()
    for (ga, ta), (gb, tb) in zip(left, right, strict=True):
        clear()
        hit.append(collide(ga, ta, gb, tb, request, result) > 0)
    return hit, time.process_time() - start


def geometries(bodies: Solid) -> list[tuple[Any, Any]]:
    """coal's shape and pose of each body."""
    coal = coal_module()
    if isinstance(bodies, Spheres):
        pairs = zip(bodies.center, bodies.radius, strict=True)
        return [(coal.Sphere(r), coal.Transform3s(np.eye(3), c)) for c, r in pairs]
    if isinstance(bodies, Capsules):
        rows = zip(bodies.start, bodies.end, bodies.radius, strict=True)
        return [_capsule(coal, start, end, radius) for start, end, radius in rows]
    if isinstance(bodies, Rounded):
        found = geometries(bodies.core)
        for (shape, _), radius in zip(found, bodies.radius, strict=True):
            shape.setSweptSphereRadius(radius)
        return found
    if isinstance(bodies, Boxes):
        return [
            (coal.Box(2 * half), coal.Transform3s(rotation, center))
            for center, half, rotation in zip(
                bodies.center, bodies.half_extents, bodies.rotation, strict=True
            )
        ]
    return [
        (_convex(coal, points, faces), coal.Transform3s.Identity())
        for points, faces in _hulls(cast(Bodies, bodies))
    ]


def _capsule(
    coal: Any, start: NDArray[np.float64], end: NDArray[np.float64], radius: float
) -> tuple[Any, Any]:
    """coal's capsules lie along z."""
    way = end - start
    length = float(np.linalg.norm(way))
    z = way / length if length > 0 else np.array([0.0, 0.0, 1.0])
    x = np.eye(3)[np.abs(z).argmin()]
    x = x - z * (z @ x)
    x /= np.linalg.norm(x)
    turn = np.stack([x, np.cross(z, x), z], axis=1)
    return coal.Capsule(radius, length), coal.Transform3s(turn, 0.5 * (start + end))


def _hulls(bodies: Bodies) -> list[tuple[NDArray[np.float64], Any]]:
    if isinstance(bodies, Tetrahedra):
        return [(points, _TETRAHEDRON_FACES) for points in bodies.vertices]
    if isinstance(bodies, Parallelepipeds):
        corners = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)], dtype=np.float64)
        points = bodies.origin[:, None] + corners @ bodies.edges
        return [(p, _BLOCK_FACES) for p in points]
    if isinstance(bodies, Hulls):
        ranges = zip(bodies.offsets, bodies.offsets[1:], strict=False)
        clouds = [bodies.vertices[i:j] for i, j in ranges]
        for row, cloud in enumerate(clouds):
            # coal's own hull of flat points ends the process.
            if np.linalg.matrix_rank(cloud - cloud[0]) < 3:
                raise ValueError(f"hull {row} is flat: coal needs volume")
        return [(cloud, None) for cloud in clouds]
    raise ValueError(f"coal knows no {type(bodies).__name__}")


def _convex(coal: Any, points: NDArray[np.float64], faces: Any) -> Any:
    cloud = coal.StdVec_Vec3s()
    for p in points:
        cloud.append(p)
    if faces is None:
        return coal.Convex.convexHull(cloud, False, None)
    triangles = coal.StdVec_Triangle()
    for face in faces:
        triangles.append(coal.Triangle(*face))
    return coal.Convex(cloud, triangles)


def mesh(vertices: NDArray[np.float64], faces: NDArray[np.integer[Any]]) -> tuple[Any, float]:
    """coal's OBBRSS model of a mesh, and the processor seconds of its construction."""
    coal = coal_module()
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for p in vertices:
        points.append(p)
    for face in faces.tolist():
        triangles.append(coal.Triangle(*face))
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(faces), len(vertices))
    start = time.process_time()
    model.addSubModel(points, triangles)
    model.endModel()
    return model, time.process_time() - start


def collide_mesh(
    model: Any, other: Any, poses: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """First hit of two models, the other one posed: answers and seconds of every single call."""
    coal = coal_module()
    here = coal.Transform3s.Identity()
    there = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in poses]
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    request.enable_contact = False
    hit, seconds = np.empty(len(poses), dtype=np.bool_), np.empty(len(poses))
    for i, pose in enumerate(there):
        result.clear()
        start = time.perf_counter()
        hit[i] = coal.collide(model, here, other, pose, request, result) > 0
        seconds[i] = time.perf_counter() - start
    return hit, seconds


def distance_all(
    left: list[tuple[Any, Any]], right: list[tuple[Any, Any]]
) -> tuple[NDArray[np.float64], float]:
    """Signed distances of prepared pairs, and the processor seconds of the bare loop."""
    coal = coal_module()
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.enable_signed_distance = True
    ask, clear = coal.distance, result.clear
    found = []
    start = time.process_time()
    for (ga, ta), (gb, tb) in zip(left, right, strict=True):
        clear()
        found.append(ask(ga, ta, gb, tb, request, result))
    return np.array(found), time.process_time() - start
