"""Single queries: contact of a moving vertex and face, or of two moving edges.

There are also queries of points with edges and points, which the kernels treat as faces
without area.

ab2pf takes the given doubles as exact. A query is a hit if and only if there is a contact at
some time of the step in exact arithmetic. ``toi`` is at most 1e-9 of the step before the first
such time. The cost of a query is bounded. First its cubic is split three times, into at most three
pieces with one root each, which take 40 Newton steps each. Undecided queries are split into at
most 124 intervals, with 20 separating directions each. A fixed number of signs decides the rest:
signs of polynomials of degree 3, in integers of fixed width and then of any length. Most queries
take some 20 ns, and those that need the fixed width 3 us. The worst take 200 us for positions of
similar magnitude, and 0.2 s if magnitudes within one query span 10^600, the widest range of
doubles. A query with a minimum distance takes at most 4001 cuts, uses no exact arithmetic and is
conservative.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.cloth import _mesh
from tauguard.geometry import finite

#: Methods of the narrow phase by name; both are correct for all finite doubles. "exact" uses exact
#: arithmetic throughout (some 100 us a query) and is the reference of "ab2pf".
METHODS: dict[str, int] = {"ab2pf": 0, "exact": 1}


@dataclass(frozen=True, eq=False)
class Impacts:
    """First contacts, one per row.

    Attributes:
        hit: Shape (N,).
        toi: Time of impact in [0, 1] of the step, never late; inf without a hit. Shape (N,).
        point: The point of contact at that time; NaN without a hit. Shape (N, 3).
        normal: Unit normal at that time: of the face by its winding, (f1 - f0) x (f2 - f0), or of
            both edges, (ea1 - ea0) x (eb1 - eb0). Its sign does not tell from which side the
            features approach, and with a ``min_distance`` it is not the direction between them. It
            is zero for a face without area or parallel edges, and NaN without a hit. Shape (N, 3).
        weights: Weights of a row's four vertices: (1, w, w, w) of the vertex and the face's
            vertices, or (1 - s, s, 1 - t, t) of the two edges' ends. Shape (N, 4); (N, 3) of a
            point and an edge's ends, (N, 2) of two points.

    If coordinates exceed 1e75 or are all below 1e-60, normal and weights can be zero or NaN.
    """

    hit: NDArray[np.bool_]
    toi: NDArray[np.float64]
    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    weights: NDArray[np.float64]


def vertex_face(
    x_t0: ArrayLike, x_t1: ArrayLike, method: str = "ab2pf", min_distance: float = 0.0
) -> Impacts:
    """First contact of a vertex with a face, all four vertices moving linearly.

    Args:
        x_t0: Positions at the start of the step [any unit]: vertex, three of the face. (N, 4, 3).
        x_t1: At its end. Shape (N, 4, 3).
        method: One of :data:`tauguard.cloth.METHODS`.
        min_distance: Counts as contact, in the unit of the positions; conservative there. Only
            ab2pf has one.

    Raises:
        ValueError: wrong shapes, entries that are not finite, no such method, a negative distance.
    """
    return _solve(True, x_t0, x_t1, method, min_distance)


def edge_edge(
    x_t0: ArrayLike, x_t1: ArrayLike, method: str = "ab2pf", min_distance: float = 0.0
) -> Impacts:
    """First contact of two edges (two ends each, four rows a query); see :func:`vertex_face`."""
    return _solve(False, x_t0, x_t1, method, min_distance)


def point_edge(
    x_t0: ArrayLike, x_t1: ArrayLike, method: str = "ab2pf", min_distance: float = 0.0
) -> Impacts:
    """First contact of a point with an edge, all moving linearly; as exact as the others.

    Args:
        x_t0: Positions at the start of the step [any unit]: point, both ends. Shape (N, 3, 3).
        x_t1: At its end. Shape (N, 3, 3).
        method: One of :data:`tauguard.cloth.METHODS`.
        min_distance: Counts as contact, in the unit of the positions; conservative there.

    Returns:
        Impacts with weights of the point and the ends, shape (N, 3), and zeros for normals.

    Raises:
        ValueError: as :func:`vertex_face`, or another method.
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
    """The number of a method; ``ValueError`` with the known names for another name."""
    if not isinstance(method, str) or method not in methods:
        raise ValueError(
            f"method {method!r}: expected one of {', '.join(methods)}; the methods that "
            "tauguard.cloth.comparators has are for comparison only"
        )
    return methods[method]


def checked_distance(min_distance: float, method: str) -> float:
    """A finite distance of at least 0 (0 unless the method is ab2pf); ``ValueError`` otherwise."""
    distance = np.nan
    try:
        array = np.asarray(min_distance)
        value = array.item() if array.ndim == 0 else None
        if isinstance(value, int | float | np.floating) and not isinstance(value, bool):
            distance = float(value)
    except (ValueError, OverflowError):  # lists of different lengths, a number beyond the doubles
        pass
    if distance > 0 and method != "ab2pf":
        raise ValueError(
            f"min_distance: {min_distance} with method {method!r}: only ab2pf takes one"
        )
    if not (np.isfinite(distance) and distance >= 0):
        raise ValueError(f"min_distance: {min_distance!r:.40}, expected a finite number >= 0")
    return distance


def _solve(
    vertex: bool, x_t0: ArrayLike, x_t1: ArrayLike, method: str, min_distance: float
) -> Impacts:
    start = finite("x_t0", x_t0, (None, 4, 3))
    end = finite("x_t1", x_t1, (None, 4, 3))
    if len(start) != len(end):
        raise ValueError(f"x_t1: {len(end)} queries, but x_t0 has {len(start)}")
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
