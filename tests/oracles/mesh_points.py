"""Points, rays and distances of triangle meshes by brute force, exact where fractions allow."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Long = NDArray[np.longdouble]


def _exact(x: Array) -> list[Fraction]:
    return [Fraction(float(v)) for v in x]


def _minus(a: list[Fraction], b: list[Fraction]) -> list[Fraction]:
    return [x - y for x, y in zip(a, b, strict=True)]


def _dot(a: list[Fraction], b: list[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction())


def _cross(a: list[Fraction], b: list[Fraction]) -> list[Fraction]:
    return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]


def meets_at(origin: Array, direction: Array, triangle: Array) -> Fraction | None:
    """Where the ray meets a closed triangle that is not parallel to it, as a rational multiple."""
    o, d = _exact(origin), _exact(direction)
    a, b, c = (_exact(v) for v in triangle)
    e, f = _minus(b, a), _minus(c, a)
    n = _cross(e, f)
    along = _dot(n, d)
    if along == 0:
        return None
    t = _dot(n, _minus(a, o)) / along
    q = _minus([x + t * y for x, y in zip(o, d, strict=True)], a)
    nn = _dot(n, n)
    u, v = _dot(_cross(q, f), n) / nn, _dot(_cross(e, q), n) / nn
    return t if t >= 0 and u >= 0 and v >= 0 and u + v <= 1 else None


def square_distance(point: Array, triangle: Array) -> Fraction:
    """The squared distance of a point from a triangle, by all its corners, edges and its plane."""
    p = _exact(point)
    corners = [_exact(v) for v in triangle]
    best = min(_dot(g, g) for g in (_minus(p, c) for c in corners))
    for i, j in ((0, 1), (1, 2), (2, 0)):
        e, g = _minus(corners[j], corners[i]), _minus(p, corners[i])
        ee = _dot(e, e)
        s = _dot(g, e) / ee if ee else Fraction()
        if 0 < s < 1:
            best = min(best, _dot(g, g) - s * s * ee)
    e, f = _minus(corners[1], corners[0]), _minus(corners[2], corners[0])
    n, g = _cross(e, f), _minus(p, corners[0])
    nn = _dot(n, n)
    if nn:
        u, v = _dot(_cross(g, f), n) / nn, _dot(_cross(e, g), n) / nn
        if u >= 0 and v >= 0 and u + v <= 1:
            best = min(best, _dot(g, n) ** 2 / nn)
    return best


def solid_angle_winding(points: Array, triangles: Array) -> Array:
    """Winding numbers of points off the surface, by solid angles (Van Oosterom, Strackee 1983)."""
    r = triangles[None] - points[:, None, None]
    length = np.linalg.norm(r, axis=3)
    a, b, c = np.moveaxis(r, 2, 0)
    x, y, z = np.moveaxis(length, 2, 0)
    det = np.einsum("nmj,nmj->nm", a, np.cross(b, c))
    dots = [np.einsum("nmj,nmj->nm", p, q) for p, q in ((a, b), (b, c), (c, a))]
    below = x * y * z + dots[0] * z + dots[1] * x + dots[2] * y
    return np.asarray(np.arctan2(det, below).sum(axis=1) / (2 * np.pi))


def distance_of_triangles(one: Array, other: Array) -> float:
    """The distance of two triangles that are apart, by dense candidates in long double."""
    a, b = one.astype(np.longdouble), other.astype(np.longdouble)
    best = min(_point_triangle(p, b) for p in a)
    best = min(best, min(_point_triangle(p, a) for p in b))
    for i, j in product(range(3), range(3)):
        best = min(best, _segments(a[i - 1], a[i], b[j - 1], b[j]))
    return float(best)


def _point_triangle(p: Long, t: Long) -> np.longdouble:
    e, f, g = t[1] - t[0], t[2] - t[0], p - t[0]
    n = np.cross(e, f)
    nn = n @ n
    best = min(_point_segment(p, t[i - 1], t[i]) for i in range(3))
    if nn > 0:
        u, v = np.cross(g, f) @ n / nn, np.cross(e, g) @ n / nn
        if u >= 0 and v >= 0 and u + v <= 1:
            best = min(best, abs(g @ n) / np.sqrt(nn))
    return best


def _point_segment(p: Long, a: Long, b: Long) -> np.longdouble:
    e = b - a
    s = np.clip((p - a) @ e / (e @ e), 0, 1) if e @ e > 0 else np.longdouble(0)
    g = p - a - s * e
    return np.longdouble(np.sqrt(g @ g))


def _segments(a: Long, b: Long, c: Long, d: Long) -> np.longdouble:
    ends = [(a, c, d), (b, c, d), (c, a, b), (d, a, b)]
    best = min(_point_segment(*end) for end in ends)
    u, v, r = b - a, d - c, a - c
    det = (u @ u) * (v @ v) - (u @ v) ** 2
    if det > 0:
        s = ((u @ v) * (v @ r) - (u @ r) * (v @ v)) / det
        t = ((u @ u) * (v @ r) - (u @ v) * (u @ r)) / det
        if 0 <= s <= 1 and 0 <= t <= 1:
            g = r + s * u - t * v
            best = min(best, np.sqrt(g @ g))
    return best
