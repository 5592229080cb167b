"""Distances of flex elements (triangles) from geoms: closed forms, or GJK of the library coal."""

from typing import Any

import coal
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array


def point_triangle(point: Array, corners: Array) -> Array:
    """Distance of points (K, 3) from triangles (K, 3, 3) [m]."""
    edges = np.roll(corners, -1, axis=1) - corners
    best = np.full(len(point), np.inf)
    for k in range(3):
        along = point - corners[:, k]
        t = _dot(along, edges[:, k]) / np.maximum(_dot(edges[:, k], edges[:, k]), 1e-300)
        foot = along - np.clip(t, 0, 1)[:, None] * edges[:, k]
        best = np.minimum(best, _dot(foot, foot))
    normal = _cross(edges[:, 0], edges[:, 1])
    inside = np.ones(len(point), dtype=bool)
    for k in range(3):
        side = _dot(_cross(normal, edges[:, k]), point - corners[:, k])
        inside &= side >= 0
    square = _dot(normal, normal)
    inside &= square > 0
    height = _dot(point - corners[:, 0], normal) ** 2 / np.where(inside, square, 1.0)
    return np.asarray(np.sqrt(np.where(inside, np.minimum(best, height), best)))


def segment_triangle(start: Array, stop: Array, corners: Array) -> Array:
    """Distance of segments with ends (K, 3) from triangles (K, 3, 3) [m]; 0 if they cross."""
    best = np.minimum(point_triangle(start, corners), point_triangle(stop, corners))
    for k in range(3):
        other = segment_segment(start, stop, corners[:, k], corners[:, (k + 1) % 3])
        best = np.minimum(best, other)
    normal = _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height_0 = _dot(start - corners[:, 0], normal)
    height_1 = _dot(stop - corners[:, 0], normal)
    across = height_0 * height_1 < 0
    t = height_0 / np.where(across, height_0 - height_1, 1.0)
    piercing = start + t[:, None] * (stop - start)
    return np.where(across & (point_triangle(piercing, corners) < 1e-12), 0.0, best)


def segment_segment(p0: Array, p1: Array, q0: Array, q1: Array) -> Array:
    """Distance of two segments with ends (K, 3) [m]."""
    u, v, w = p1 - p0, q1 - q0, p0 - q0
    uu, uv, vv, uw, vw = _dot(u, u), _dot(u, v), _dot(v, v), _dot(u, w), _dot(v, w)
    det = uu * vv - uv * uv
    skew = det > 1e-14 * uu * vv
    s = np.where(skew, np.clip((uv * vw - vv * uw) / np.where(skew, det, 1.0), 0, 1), 0.0)
    best = np.full(len(p0), np.inf)
    # Either both nearest points are inside the segments, or one is an end.
    for s_try in (s, np.zeros_like(s), np.ones_like(s)):
        t = np.clip((vw + s_try * uv) / np.maximum(vv, 1e-300), 0, 1)
        s_best = np.clip((t * uv - uw) / np.maximum(uu, 1e-300), 0, 1)
        apart = w + s_best[:, None] * u - t[:, None] * v
        best = np.minimum(best, _dot(apart, apart))
    return np.asarray(np.sqrt(best))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b).sum(axis=1))


def _cross(a: Array, b: Array) -> Array:
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


class HullDistance:
    """Distance of a triangle to a box, cylinder, ellipsoid or mesh hull, by coal's GJK."""

    def __init__(self, model: Any, geom: int, kind: str) -> None:
        """Make coal's shape of ``geom``."""
        from scipy.spatial import ConvexHull

        size = model.geom_size[geom]
        if kind == "box":
            self._shape = coal.Box(*(2 * size))
        elif kind == "cylinder":
            self._shape = coal.Cylinder(size[0], 2 * size[1])
        elif kind == "ellipsoid":
            self._shape = coal.Ellipsoid(*size)
        else:
            mesh = model.mesh(model.geom_dataid[geom])
            begin, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
            points = model.mesh_vert[begin : begin + count].astype(np.float64)
            hull = ConvexHull(points)
            self._shape = _convex(points, hull.simplices)
        self._request, self._result = coal.DistanceRequest(), coal.DistanceResult()

    def __call__(self, center: Array, xmat: Array, corners: Array) -> Array:
        """Distances [m] at poses (K, 3), (K, 3, 3) from triangles (K, 3, 3); 0 for overlap."""
        out = np.empty(len(center))
        for k in range(len(center)):
            self._result.clear()
            middle = corners[k].mean(axis=0)
            triangle = _convex(corners[k] - middle, np.array([[0, 1, 2]]))
            place = coal.Transform3s(np.eye(3), middle)
            pose = coal.Transform3s(xmat[k], center[k])
            d = coal.distance(triangle, place, self._shape, pose, self._request, self._result)
            out[k] = max(d, 0.0)
        return out


def _convex(points: Array, faces: NDArray[Any]) -> Any:
    cloud, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for point in points:
        cloud.append(point)
    for face in faces:
        triangles.append(coal.Triangle(*(int(k) for k in face)))
    return coal.Convex(cloud, triangles)
