"""Single queries: contact of a moving vertex and face, or of two moving edges.

Queries of a point with an edge or with a point are vertex-face queries with a degenerate face.

The method ``ab2pf`` treats the given doubles as exact. A query is a hit if and only if the features
touch, in exact arithmetic, at some time of the step. ``toi`` is at most 1e-9 of the step before the
first such time. The cost of a query is bounded:

1. The coplanarity cubic is cut at most three times, into at most three pieces with one root each.
   A root takes at most 40 Newton steps.
2. Undecided queries are divided into at most 124 intervals of time, each with 20 tests of a
   separating direction.
3. Queries that are still undecided are decided by a fixed number of signs of polynomials of degree
   3, in integers of fixed width or, if these are too short, of any length.

Most queries take some 20 ns; those that need integers of fixed width take 3 us. The slowest take
200 us for positions of similar magnitude, and 0.2 s if magnitudes within one query span 10^600,
the range of doubles. A query with a minimum distance is conservative: it takes at most 4001 cuts
and uses no exact arithmetic.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.arrays import in_a_line
from tauguard.cloth import _mesh
from tauguard.findings import ArgumentError
from tauguard.geometry import finite

#: Methods of the narrow phase by name; both are correct for all finite doubles. "exact" uses only
#: exact arithmetic (some 100 us per query) and is the reference for "ab2pf".
METHODS: dict[str, int] = {"ab2pf": 0, "exact": 1}


@dataclass(frozen=True, eq=False)
class Impacts:
    """First contacts, one per row.

    Attributes:
        hit: Whether there is contact within the step. Shape (N,).
        toi: Time of impact in [0, 1] of the step, never late; inf without a hit. Shape (N,).
        point: The point of contact at that time; NaN without a hit. On edges that meet along a
            segment it is the middle of this segment. Shape (N, 3).
        normal: Unit normal at that time: of the face by its winding, (f1 - f0) x (f2 - f0), or of
            both edges, (ea1 - ea0) x (eb1 - eb0). Its sign does not tell from which side the
            features approach. With a ``min_distance`` it is not the direction between the features.
            It is zero for a face without area or for parallel edges, and NaN without a hit. Shape
            (N, 3).
        weights: Barycentric weights of the contact point: (1, w0, w1, w2) for the vertex and the
            vertices of the face, or (1 - s, s, 1 - t, t) for the ends of both edges, shape (N, 4).
            For a point and the ends of an edge shape (N, 3), for two points (N, 2). Without a
            ``min_distance`` both features have their weighted point at ``point``, except for their
            movement in 1e-9 of the step and rounding.
    """

    hit: NDArray[np.bool_]
    toi: NDArray[np.float64]
    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    weights: NDArray[np.float64]

    __repr__ = in_a_line


def vertex_face(
    x_t0: ArrayLike, x_t1: ArrayLike, method: str = "ab2pf", min_distance: float = 0.0
) -> Impacts:
    """First contact of a vertex with a face; all four vertices move linearly.

    Args:
        x_t0: Positions at the start of the step [any unit]: the vertex, then the three vertices of
            the face. Shape (N, 4, 3).
        x_t1: Positions at the end of the step. Shape (N, 4, 3).
        method: One of :data:`tauguard.cloth.METHODS`.
        min_distance: Distance that counts as contact, in the unit of the positions. Above 0 the
            result is conservative, and the method must be ``ab2pf``.

    Raises:
        ArgumentError: wrong shapes, entries that are not finite, an unknown method, or a distance
            that is negative or not available with the method.
    """
    return _solve(True, x_t0, x_t1, method, min_distance)


def edge_edge(
    x_t0: ArrayLike, x_t1: ArrayLike, method: str = "ab2pf", min_distance: float = 0.0
) -> Impacts:
    """First contact of two edges, given by the ends of both; see :func:`vertex_face`."""
    return _solve(False, x_t0, x_t1, method, min_distance)


def point_edge(
    x_t0: ArrayLike, x_t1: ArrayLike, method: str = "ab2pf", min_distance: float = 0.0
) -> Impacts:
    """First contact of a point with an edge; the point and both ends move linearly.

    Args:
        x_t0: Positions at the start of the step [any unit]: the point, then both ends. Shape
            (N, 3, 3).
        x_t1: Positions at the end of the step. Shape (N, 3, 3).
        method: As for :func:`vertex_face`.
        min_distance: As for :func:`vertex_face`.

    Returns:
        Impacts with weights of the point and the ends, shape (N, 3). Normals are zero.

    Raises:
        ArgumentError: as :func:`vertex_face`.
    """
    found = _solve_points([0, 1, 2, 2], x_t0, x_t1, method, min_distance)
    weights = np.concatenate(
        [found.weights[:, :2], found.weights[:, 2:].sum(axis=1, keepdims=True)], axis=1
    )
    return Impacts(found.hit, found.toi, found.point, found.normal, weights)


def point_point(
    x_t0: ArrayLike, x_t1: ArrayLike, method: str = "ab2pf", min_distance: float = 0.0
) -> Impacts:
    """First contact of two points, shape (N, 2, 3); see :func:`point_edge`. Weights are ones."""
    found = _solve_points([0, 1, 1, 1], x_t0, x_t1, method, min_distance)
    ones = np.where(found.hit[:, None], 1.0, np.nan).repeat(2, axis=1)
    return Impacts(found.hit, found.toi, found.point, found.normal, ones)


def _solve_points(
    corners: list[int], x_t0: ArrayLike, x_t1: ArrayLike, method: str, min_distance: float
) -> Impacts:
    n = max(corners) + 1
    start = finite("x_t0", x_t0, (None, n, 3))
    end = finite("x_t1", x_t1, (None, n, 3))
    return _solve(True, start[:, corners], end[:, corners], method, min_distance)


def method_number(method: str, methods: Mapping[str, int] = METHODS) -> int:
    """The number of a method; an unknown name raises an ``ArgumentError`` with the known ones."""
    if not isinstance(method, str) or method not in methods:
        raise ArgumentError(
            f"method {method!r}: expected one of {', '.join(methods)}; more methods, for "
            "comparison only, are in tauguard.cloth.comparators"
        )
    return methods[method]


def checked_distance(min_distance: float, method: str) -> float:
    """Return the distance; ``ArgumentError`` if it is negative, not finite or not supported."""
    distance = np.nan
    try:
        array = np.asarray(min_distance)
        value = array.item() if array.ndim == 0 else None
        if isinstance(value, int | float | np.floating) and not isinstance(value, bool):
            distance = float(value)
    except (ValueError, OverflowError):  # a ragged list, or an integer too large for a double
        pass
    if distance > 0 and method != "ab2pf":
        raise ArgumentError(
            f"min_distance: {min_distance} with method {method!r}; expected 0, or method ab2pf"
        )
    if not (np.isfinite(distance) and distance >= 0):
        raise ArgumentError(f"min_distance: {min_distance!r:.40}, expected a finite number >= 0")
    return distance


def _solve(
    vertex: bool, x_t0: ArrayLike, x_t1: ArrayLike, method: str, min_distance: float
) -> Impacts:
    start = finite("x_t0", x_t0, (None, 4, 3))
    end = finite("x_t1", x_t1, (None, 4, 3))
    if len(start) != len(end):
        raise ArgumentError(f"x_t1: {len(end)} queries, but x_t0 has {len(start)}")
    n = len(start)
    hit = np.zeros(n, dtype=np.uint8)
    toi = np.full(n, np.inf)
    point, normal, weights = (np.full((n, k), np.nan) for k in (3, 3, 4))
    _mesh.solve(
        vertex,
        start.reshape(-1, 3),
        end.reshape(-1, 3),
        np.arange(4 * n, dtype=np.int32).reshape(-1, 4),
        method_number(method),
        checked_distance(min_distance, method),
        hit,
        toi,
        point,
        normal,
        weights,
    )
    return Impacts(hit.astype(bool), toi, point, normal, weights)
