"""The truth of signed distances of convex bodies: rational arithmetic over all features of both."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations
from math import isqrt, lcm

import numpy as np
from numpy.typing import NDArray

from oracles.convex_overlap import Vector, Vectors, cross, dot, exact_vertices, sub
from tauguard.rigid.rounded import Solid, parts


def root(x: Fraction) -> float:
    """The square root of a fraction to a double's precision, whatever its size."""
    if x <= 0:
        return 0.0
    shift = max(0, 160 - x.numerator.bit_length() + x.denominator.bit_length())
    shift += shift % 2
    return float(Fraction(isqrt((x.numerator << shift) // x.denominator), 1 << (shift // 2)))


def exact_distance(a: Solid, b: Solid, i: int) -> float:
    """The signed distance of row i, rounded once (twice where there are radii)."""
    pa, ea, pb, eb, scale = _in_integers(a, b, i)
    radii = _radii(a, b, i)
    square = squared_distance(pa, pb) / (scale * scale)
    if square > 0:
        return root(square) - float(radii) if radii else root(square)
    return -root(squared_depth(pa, ea, pb, eb) / (scale * scale)) - float(radii)


def exactly_meet(a: Solid, b: Solid, i: int) -> bool:
    """Is the squared distance of the cores of row i at most the squared sum of the radii?"""
    pa, _, pb, _, scale = _in_integers(a, b, i)
    return bool(squared_distance(pa, pb) <= (_radii(a, b, i) * scale) ** 2)


def _in_integers(a: Solid, b: Solid, i: int) -> tuple[Vectors, Vectors, Vectors, Vectors, int]:
    """Vertices and edges of the core of a, those of b, and by how much all are scaled."""
    rows = [*exact_vertices(parts(a)[0], i), *exact_vertices(parts(b)[0], i)]
    scale = lcm(*(x.denominator for row in rows for v in row for x in v))
    pa, ea, pb, eb = ([tuple(int(x * scale) for x in v) for v in row] for row in rows)
    return pa, ea, pb, eb, scale


def _radii(a: Solid, b: Solid, i: int) -> Fraction:
    """The sum of the radii of row i."""
    both = (parts(a)[1], parts(b)[1])
    return sum((Fraction(float(r[i if len(r) > 1 else 0])) for r in both), Fraction(0))


def squared_distance(pa: Vectors, pb: Vectors) -> Fraction:
    """The least squared distance between points of both hulls.

    The minimum lies on a simplex of at most four vertices of the Minkowski difference, and is the
    point of that simplex nearest to the origin. All simplices are tried: the others give points of
    the hulls too, none of them nearer.
    """
    y = list({sub(q, p) for p in pa for q in pb})
    best = Fraction(min(dot(v, v) for v in y))
    for size in (2, 3, 4):
        for face in combinations(y, size):
            square = carried(face)
            if square is not None and square < best:
                best = square
    return best


def carried(y: tuple[Vector, ...]) -> Fraction | None:
    """Squared distance of a simplex from the origin, None if the nearest point is on its rim."""
    e = [sub(v, y[0]) for v in y[1:]]
    if len(e) == 1:
        det = dot(e[0], e[0])
        weights = [-dot(e[0], y[0])]
    elif len(e) == 2:
        aa, ab, bb = dot(e[0], e[0]), dot(e[0], e[1]), dot(e[1], e[1])
        det = aa * bb - ab * ab
        x, z = -dot(e[0], y[0]), -dot(e[1], y[0])
        weights = [x * bb - z * ab, z * aa - x * ab]
    else:
        det = dot(e[0], cross(e[1], e[2]))
        o = tuple(-x for x in y[0])
        weights = [
            dot(o, cross(e[1], e[2])),
            dot(o, cross(e[2], e[0])),
            dot(o, cross(e[0], e[1])),
        ]
        if det < 0:
            det, weights = -det, [-w for w in weights]
    if det == 0 or any(w < 0 for w in weights) or sum(weights) > det:
        return None
    if len(e) == 3:
        return Fraction(0)
    v = tuple(
        y[0][k] * det + sum(w * u[k] for w, u in zip(weights, e, strict=True)) for k in range(3)
    )
    return Fraction(dot(v, v), det * det)


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
