"""The truth of overlap: separating axes in scaled integers, complete for degenerate bodies too.

A floating-point pass with wide margins settles what it can; the rest is decided exactly.
"""

from fractions import Fraction
from itertools import combinations
from math import lcm
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.rigid import Boxes, Hulls, Parallelepipeds, Tetrahedra
from tauguard.rigid.shapes import Bodies

TETRAHEDRON_EDGES = list(combinations(range(4), 2))
Vector = tuple[Any, ...]  # three fractions or integers
Vectors = list[Vector]

ROWS = 4096  # a pass of the floating-point reference: its arrays stay in the cache
CORNERS = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)])


def cross(u: Vector, v: Vector) -> Vector:
    """Cross product in the arithmetic of its entries."""
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


def dot(u: Any, v: Any) -> Any:
    """Scalar product of vectors, or of arrays with the coordinates first."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def sub(u: Vector, v: Vector) -> Vector:
    """Difference."""
    return (u[0] - v[0], u[1] - v[1], u[2] - v[2])


def exact_vertices(bodies: Bodies, i: int) -> tuple[Vectors, Vectors]:
    """Vertices and edge directions of body i as fractions."""
    i = 0 if len(bodies) == 1 else i
    f = Fraction
    if isinstance(bodies, Tetrahedra | Hulls):
        if isinstance(bodies, Tetrahedra):
            points = bodies.vertices[i]
        else:
            points = bodies.vertices[bodies.offsets[i] : bodies.offsets[i + 1]]
        p = [tuple(f(float(x)) for x in v) for v in points]
        return p, [sub(p[k], p[j]) for j, k in combinations(range(len(p)), 2)]
    if isinstance(bodies, Boxes):
        r, h = bodies.rotation[i], bodies.half_extents[i]
        g = [tuple(f(float(r[k, a])) * f(float(h[a])) for k in range(3)) for a in range(3)]
        low = bodies.center[i]
        origin = [f(float(low[k])) - sum(g[a][k] for a in range(3)) for k in range(3)]
        g = [tuple(2 * x for x in e) for e in g]
    else:
        assert isinstance(bodies, Parallelepipeds)
        g = [tuple(f(float(x)) for x in e) for e in bodies.edges[i]]
        origin = [f(float(x)) for x in bodies.origin[i]]
    points = [
        tuple(origin[k] + sum(int(c[a]) * g[a][k] for a in range(3)) for k in range(3))
        for c in CORNERS
    ]
    return points, g


def integers(*lists: Vectors) -> list[Vectors]:
    """The same vectors with a common denominator removed."""
    scale = lcm(*(x.denominator for vectors in lists for v in vectors for x in v))
    return [[tuple(int(x * scale) for x in v) for v in vectors] for vectors in lists]


def apart(axis: Vector, pa: Vectors, pb: Vectors) -> bool:
    """Do the projections on the axis leave a gap?"""
    a = [dot(axis, p) for p in pa]
    b = [dot(axis, p) for p in pb]
    return bool(max(a) < min(b) or max(b) < min(a))


def exact_hit(a: Bodies, b: Bodies, i: int) -> bool:
    """Exact answer of row i."""
    pa, ea = exact_vertices(a, i)
    pb, eb = exact_vertices(b, i)
    pa, ea, pb, eb = integers(pa, ea, pb, eb)
    directions = [e for e in ea + eb if any(e)]
    normals = [n for n in (cross(u, v) for u, v in combinations(directions, 2)) if any(n)]
    if any(apart(n, pa, pb) for n in normals):
        return False
    between = sub(pa[0], pb[0])
    if not directions:
        return not any(between)
    if not normals:
        e = directions[0]
        return not any(cross(e, between)) and not apart(e, pa, pb)
    if not any(dot(normals[0], e) for e in directions):  # all in parallel planes
        if dot(normals[0], between):
            return False
        return not any(apart(cross(normals[0], e), pa, pb) for e in directions)
    return True


def float_bodies(bodies: Bodies, n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Vertices (n, V, 3) and edge directions (n, E, 3) in floating point."""
    if isinstance(bodies, Tetrahedra):
        v = bodies.vertices
        e = np.stack([v[:, k] - v[:, j] for j, k in TETRAHEDRON_EDGES], axis=1)
    elif isinstance(bodies, Boxes):
        e = 2 * (bodies.rotation * bodies.half_extents[:, None, :]).transpose(0, 2, 1)
        v = bodies.center[:, None] - e.sum(axis=1, keepdims=True) / 2 + CORNERS @ e
    elif isinstance(bodies, Parallelepipeds):
        e = bodies.edges
        v = bodies.origin[:, None] + CORNERS @ e
    return np.broadcast_to(v, (n, *v.shape[1:])), np.broadcast_to(e, (n, *e.shape[1:]))


def truth(a: Bodies, b: Bodies, sample: tuple[int, int] | None = None) -> NDArray[np.bool_]:
    """The hit of every row; ``sample = (count, seed)`` random rows are decided exactly anyhow.

    Margins: an axis of floating-point edges carries a few dozen roundings; 1e-12 of the size of its
    terms is far above their error and far below what random bodies leave.
    """
    n = max(len(a), len(b))
    hit = np.zeros(n, dtype=bool)
    certain = np.zeros(n, dtype=bool)
    if not isinstance(a, Hulls) and not isinstance(b, Hulls):
        with np.errstate(all="ignore"):
            hit, certain = float_hit(a, b, n)
    exact = ~certain
    if sample is not None:
        count, seed = sample
        exact[np.random.default_rng(seed).choice(n, min(count, n), replace=False)] = True
    for i in np.flatnonzero(exact):
        answer = exact_hit(a, b, int(i))
        assert not certain[i] or answer == hit[i], f"reference contradicts itself in row {i}"
        hit[i] = answer
    return hit


def float_hit(a: Bodies, b: Bodies, n: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Answers and which of them are certain, from all cross products of edges."""
    sides = [*float_bodies(a, n), *float_bodies(b, n)]
    parts = [float_rows(*(x[k : k + ROWS] for x in sides)) for k in range(0, n, ROWS)]
    hit, certain = zip(*parts, strict=True) if parts else ([np.zeros(0, bool)], [np.zeros(0, bool)])
    return np.concatenate(hit), np.concatenate(certain)


def float_rows(
    va: NDArray[np.float64], ea: NDArray[np.float64], vb: Any, eb: Any
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """The same for few rows: coordinates first, and separated rows dropped on the way."""
    origin = va[:, :1]
    va, vb = va - origin, vb - origin
    given = np.abs(origin).max(axis=(1, 2)) + np.abs(vb).max(axis=(1, 2))
    size = np.maximum(np.abs(va).max(axis=(1, 2)), np.abs(vb).max(axis=(1, 2)))
    joined = np.isfinite(size) & (size < 1e90) & (size > 1e-90)
    apart_ = np.zeros(len(size), dtype=bool)
    live = np.flatnonzero(joined)
    edges = np.concatenate([ea, eb], axis=1)
    va, vb, edges = (np.ascontiguousarray(x[live].transpose(2, 1, 0)) for x in (va, vb, edges))
    length = np.sqrt(dot(edges, edges))
    for j in range(edges.shape[1] - 1):
        gone = np.zeros(len(live), dtype=bool)
        for k in range(j + 1, edges.shape[1]):
            axis = np.stack(cross(tuple(edges[:, j]), tuple(edges[:, k])))[:, None]
            pa, pb = dot(va, axis), dot(vb, axis)
            gap = np.maximum(pa.min(0) - pb.max(0), pb.min(0) - pa.max(0))
            scale = length[j] * length[k]
            margin = scale * (1e-12 * size[live] + 1e-15 * given[live])
            gone |= gap > margin
            joined[live] &= gap < -margin
        apart_[live[gone]] = True
        stay = ~gone
        live, length = live[stay], length[:, stay]
        va, vb, edges = (np.ascontiguousarray(x[..., stay]) for x in (va, vb, edges))
    return joined & ~apart_, joined | apart_
