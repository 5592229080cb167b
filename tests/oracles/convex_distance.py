"""The truth of signed distances of convex bodies: rational arithmetic over all features of both."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations
from math import isqrt, lcm
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from oracles.convex_overlap import (
    Vector,
    Vectors,
    cross,
    dot,
    exact_hit,
    exact_vertices,
    sub,
)
from tauguard.rigid import Boxes, Parallelepipeds
from tauguard.rigid.rounded import Solid, parts
from tauguard.rigid.shapes import Bodies


def root(x: Fraction) -> float:
    """The square root of a fraction to a double's precision, whatever its size."""
    if x <= 0:
        return 0.0
    shift = max(0, 160 - x.numerator.bit_length() + x.denominator.bit_length())
    shift += shift % 2
    return float(Fraction(isqrt((x.numerator << shift) // x.denominator), 1 << (shift // 2)))


def exact_distance(a: Solid, b: Solid, i: int) -> float:
    """The signed distance of row i, rounded once (twice where there are radii)."""
    first, second, scale = _in_integers(a, b, i)
    radii = _radii(a, b, i)
    if exact_hit(parts(a)[0], parts(b)[0], i):
        depth = squared_depth(first.points, first.edges, second.points, second.edges)
        return -root(depth / (scale * scale)) - float(radii)
    square = squared_gap(first, second) / (scale * scale)
    return _less(square, radii) if radii else root(square)


def _less(square: Fraction, radius: Fraction) -> float:
    """The square root of ``square`` less ``radius``, without cancellation."""
    off = square - radius * radius
    return float(off / (Fraction(root(square)) + radius))


def exactly_meet(a: Solid, b: Solid, i: int) -> bool:
    """Is the squared distance of the cores of row i at most the squared sum of the radii?"""
    if exact_hit(parts(a)[0], parts(b)[0], i):
        return True
    first, second, scale = _in_integers(a, b, i)
    return bool(squared_gap(first, second) <= (_radii(a, b, i) * scale) ** 2)


#: Corner, spanning vectors, and whether they span a triangle (else a segment or parallelogram).
Cell = tuple[Vector, tuple[Vector, ...], bool]


class Features(NamedTuple):
    """A body in integers: its points, the directions of its edges, and all its faces by size."""

    points: Vectors
    edges: Vectors
    cells: tuple[list[Cell], list[Cell], list[Cell]]


def _features(core: Bodies, points: Vectors, edges: Vectors) -> Features:
    zero: list[Cell] = [(p, (), False) for p in points]
    if isinstance(core, Boxes | Parallelepipeds):
        lines, faces = (
            [
                (points[k], tuple(edges[axis] for axis in axes), False)
                for axes in combinations(range(3), size)
                for k in range(8)
                if not any(k >> axis & 1 for axis in axes)
            ]
            for size in (1, 2)
        )
        return Features(points, edges, (zero, lines, faces))
    lines = [(p, (sub(q, p),), False) for p, q in combinations(points, 2)]
    faces = [(p, (sub(q, p), sub(r, p)), True) for p, q, r in combinations(points, 3)]
    return Features(points, edges, (zero, lines, faces))


def _in_integers(a: Solid, b: Solid, i: int) -> tuple[Features, Features, int]:
    """The cores of a and b in integers, and by how much they are scaled."""
    cores = [parts(solid)[0] for solid in (a, b)]
    rows = [exact_vertices(core, i) for core in cores]
    scale = lcm(*(x.denominator for row in rows for part in row for v in part for x in v))
    whole = [[[tuple(int(x * scale) for x in v) for v in part] for part in row] for row in rows]
    first, second = (_features(core, *part) for core, part in zip(cores, whole, strict=True))
    return first, second, scale


def _radii(a: Solid, b: Solid, i: int) -> Fraction:
    """The sum of the radii of row i."""
    both = (parts(a)[1], parts(b)[1])
    return sum((Fraction(float(r[i if len(r) > 1 else 0])) for r in both), Fraction(0))


def squared_gap(a: Features, b: Features) -> Fraction:
    """The least squared distance between points of two bodies that share none.

    The nearest points lie inside one face of each body, of dimensions that add up to two at most:
    both faces are at right angles to the way between them. All such pairs of faces are tried; each
    gives points of both bodies, so none can be too near.
    """
    best: tuple[Any, Any] | None = None
    for size_a, size_b in ((0, 0), (0, 1), (1, 0), (0, 2), (1, 1), (2, 0)):
        for p, along_a, triangle_a in a.cells[size_a]:
            back = tuple(_negative(e) for e in along_a)
            for q, along_b, triangle_b in b.cells[size_b]:
                square = _squared_height(sub(q, p), (*back, *along_b), triangle_a or triangle_b)
                if square and (best is None or square[0] * best[1] < best[0] * square[1]):
                    best = square
    assert best is not None
    return Fraction(*best)


def _negative(v: Vector) -> Vector:
    return (-v[0], -v[1], -v[2])


def _squared_height(
    corner: Vector, spans: tuple[Vector, ...], triangle: bool
) -> tuple[Any, Any] | None:
    """Squared distance of the origin from a face, a quotient; None where its foot is outside."""
    if not spans:
        return dot(corner, corner), 1
    u = spans[0]
    x, uu = -dot(u, corner), dot(u, u)
    if len(spans) == 1:
        if uu == 0 or not 0 <= x <= uu:
            return None
        across = cross(u, corner)
        return dot(across, across), uu
    v = spans[1]
    y, uv, vv = -dot(v, corner), dot(u, v), dot(v, v)
    det = uu * vv - uv * uv
    s, t = x * vv - y * uv, y * uu - x * uv
    if det == 0 or s < 0 or t < 0 or (s + t > det if triangle else max(s, t) > det):
        return None
    volume = dot(corner, cross(u, v))
    return volume * volume, det


def squared_depth(pa: Vectors, ea: Vectors, pb: Vectors, eb: Vectors) -> Fraction:
    """The squared penetration depth, over the facet normals of the difference; 0 if it is flat."""
    edges = [e for e in ea + eb if any(e)]
    normals = [n for n in (cross(u, v) for u, v in combinations(edges, 2)) if any(n)]
    if not normals or not any(dot(normals[0], e) for e in edges):
        return Fraction(0)
    best: Fraction | None = None
    for n in normals:
        a, b = [dot(n, p) for p in pa], [dot(n, p) for p in pb]
        shift = min(max(a) - min(b), max(b) - min(a))
        square = Fraction(shift * shift) / dot(n, n)
        best = square if best is None or square < best else best
    assert best is not None
    return best


def extent(a: Solid, b: Solid, i: int) -> float:
    """The size of the pair [m], radii included: errors are given as a fraction of it."""
    points = [*exact_vertices(parts(a)[0], i)[0], *exact_vertices(parts(b)[0], i)[0]]
    span = [float(max(p[k] for p in points) - min(p[k] for p in points)) for k in range(3)]
    return float(np.linalg.norm(span)) + float(_radii(a, b, i))


def relative_error(
    got: NDArray[np.float64], truth: NDArray[np.float64], size: NDArray[np.float64]
) -> float | None:
    """The largest error as a fraction of the pair's size, None where no truth is known.

    Two points at one place have no size: an error between them is infinite.
    """
    if not len(truth):
        return None
    off = np.abs(got[: len(truth)] - truth)
    return float(np.divide(off, size, out=np.where(off > 0, np.inf, 0.0), where=size > 0).max())
