"""Contact certified or excluded by floating-point numbers whose errors are bounded, in NumPy.

A referee of the narrow phase that shares nothing with it. *Clear*: on each piece of a subdivision
of the step a plane through the origin has all differences of points of the two features on one
side; a difference is linear in time, so both ends of a piece tell the whole piece. *Hit*: the
volume of the four points has certainly opposite signs at both ends of a short interval, throughout
which the barycentric weights are certainly positive. Whatever is neither is left open.

Every axis is first scaled by a power of two of its own; contact does not change under such a map.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Half the distance from 1 to the next double: the relative error of one rounding.
UNIT = 2.0**-53
#: More than all that underflow takes from one operation and from its radius.
TINY = 2.0**-1060


class Ball(NamedTuple):
    """Real numbers within ``radius`` of ``middle``; every operation encloses its true results.

    The factor 1 + 2^-49 is more than the roundings of the radius itself (fewer than eight).
    """

    middle: Floats
    radius: Floats

    def __add__(self, other: Ball) -> Ball:  # type: ignore[override]
        middle = self.middle + other.middle
        return Ball(middle, _above(self.radius + other.radius + UNIT * np.abs(middle)))

    def __sub__(self, other: Ball) -> Ball:
        return self + Ball(-other.middle, other.radius)

    def __mul__(self, other: Ball) -> Ball:  # type: ignore[override]
        middle = self.middle * other.middle
        radius = (
            np.abs(self.middle) * other.radius
            + self.radius * (np.abs(other.middle) + other.radius)
            + UNIT * np.abs(middle)
        )
        return Ball(middle, _above(radius))

    def sign(self) -> NDArray[np.int8]:
        """1 or -1 where it is certain, else 0 (also where anything overflowed)."""
        return (self.middle > self.radius).astype(np.int8) - (-self.middle > self.radius)


class Certificate(NamedTuple):
    """What is certain of N queries; where both are False nothing is."""

    clear: Mask
    hit: Mask
    by: Floats  # a time until which a certain hit has happened; else NaN


def certify(x: Floats, vertex: bool, depth: int = 6) -> Certificate:
    """Decide what can be decided with certainty.

    Args:
        x: Positions (N, 2, 4, 3) at both ends of the step; rows as in ``tauguard.cloth``:
            vertex and face, or the ends of two edges. Finite.
        vertex: Vertex against face, else edge against edge.
        depth: Halvings of the step after which a query is no longer tried.
    """
    with np.errstate(all="ignore"):
        by = _hits(x, vertex)
        open_ = np.flatnonzero(np.isnan(by))
        clear = np.zeros(len(x), dtype=bool)
        clear[open_] = _clear(_differences(x[open_], vertex), depth)
    return Certificate(clear, ~np.isnan(by), by)


def _above(radius: Floats) -> Floats:
    return np.asarray(radius * (1 + 2.0**-49) + TINY)


def _scaled(d: Floats) -> Floats:
    """Differences (N, 2, k, 3), each axis of a query by a power of two to at most 1."""
    _, exponent = np.frexp(np.abs(d).max(axis=(1, 2), keepdims=True))
    return np.asarray(np.ldexp(d, -exponent))


# Clear ------------------------------------------------------------------------------------------


def _differences(x: Floats, vertex: bool) -> Floats:
    """(N, 2, k, 3): points of one feature minus points of the other, rounded once."""
    if vertex:
        return _scaled(x[:, :, :1] - x[:, :, 1:])
    return _scaled((x[:, :, :2, None] - x[:, :, None, 2:]).reshape(len(x), 2, 4, 3))


def _clear(d: Floats, depth: int) -> Mask:
    """Queries whose convex hull of differences leaves out the origin throughout [0, 1]."""
    open_ = np.zeros(len(d), dtype=bool)
    query, start, width = np.arange(len(d)), np.zeros(len(d)), 1.0
    for level in range(depth + 1):
        apart = np.concatenate(
            [
                _separated(d[query[part]], start[part], width)
                for part in np.array_split(np.arange(len(query)), 1 + len(query) // 4096)
            ]
        )
        query, start = query[~apart], start[~apart]
        if level == depth:
            break
        width /= 2
        query, start = np.repeat(query, 2), np.repeat(start, 2)
        start[1::2] += width
    open_[query] = True
    return ~open_


def _separated(d: Floats, start: Floats, width: float) -> Mask:
    """A plane that certainly separates during [start, start + width], multiples of 2^-20."""
    ends = np.stack([start, start + width], axis=1)[:, :, None, None]
    part, rest = ends * d[:, 1:], (1 - ends) * d[:, :1]
    k = 2 * d.shape[2]
    points = (part + rest).reshape(-1, k, 3)
    sizes = (np.abs(part) + np.abs(rest)).reshape(-1, k, 3)
    normal = _normal(points)
    # A term of the sum below is off by six roundings of its own size at most: the difference, its
    # product with the time, the sum of both ends, the product, and (twice) the sum. The error's own
    # sum, of terms that are rounded alike, is short by fewer: 16 is more than twice what is needed.
    # What underflows is less than 2^-1070 a term: the scaling, the products.
    value = np.einsum("npk,nk->np", points, normal)
    error = 16 * UNIT * np.einsum("npk,nk->np", sizes, np.abs(normal)) + 2.0**-900
    return np.asarray((value > error).all(axis=1))


def _normal(points: Floats, rounds: int = 24) -> Floats:
    """The point of the hull next to the origin, nearly (Gilbert 1966): the widest gap's normal."""
    at = points.mean(axis=1)
    for _ in range(rounds):
        lowest = np.einsum("npk,nk->np", points, at).argmin(axis=1)
        step = points[np.arange(len(points)), lowest] - at
        length = (step * step).sum(axis=1)
        share = -(at * step).sum(axis=1) / np.where(length > 0, length, 1)
        at = at + np.clip(share, 0, 1)[:, None] * step
    return np.asarray(at)


# Hit --------------------------------------------------------------------------------------------

Vector = tuple[Ball, Ball, Ball]


def _hits(x: Floats, vertex: bool) -> Floats:
    """Per query the end of an interval in which contact certainly begins or lasts, or NaN."""
    # p leads from one feature to the other, q and r span the plane that both must share.
    p, q, r = ((0, 1), (2, 1), (3, 1)) if vertex else ((2, 0), (1, 0), (3, 2))
    d = _scaled(np.stack([x[:, :, i] - x[:, :, j] for i, j in (p, q, r)], axis=2))
    found = np.full(len(x), np.nan)
    query, time = _crossings(d)
    for width in (2.0**-8, 2.0**-18, 2.0**-28, 2.0**-38):
        low, high = np.maximum(time - width, 0), np.minimum(time + width, 1)
        known = _crosses(d[query], low, high) & _inside(d[query], low, high, vertex)
        np.fmin.at(found, query[known], high[known])
    return found


def _crossings(d: Floats, samples: int = 16) -> tuple[NDArray[np.int64], Floats]:
    """Queries and times, not certain, at which the volume changes its sign between samples."""
    times = np.linspace(0, 1, samples + 1)
    below = np.stack([_volume(d, np.full(len(d), t)) < 0 for t in times], axis=1)
    query, sample = np.nonzero(below[:, 1:] != below[:, :-1])
    before = below[query, sample]
    low, high = times[sample], times[sample + 1]
    for _ in range(45):
        middle = (low + high) / 2
        left = (_volume(d[query], middle) < 0) == before
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    return query, (low + high) / 2


def _volume(d: Floats, t: Floats) -> Floats:
    now = d[:, 0] + t[:, None, None] * (d[:, 1] - d[:, 0])
    return np.asarray((now[:, 0] * np.cross(now[:, 1], now[:, 2])).sum(axis=1))


def _during(d: Floats, low: Floats, high: Floats) -> tuple[Vector, Vector, Vector]:
    """p, q and r at all times of an interval."""
    middle = (low + high) / 2
    time = Ball(middle, _above(np.maximum(high - middle, middle - low) + UNIT))
    if np.array_equal(low, high):
        time = Ball(low, np.zeros_like(low))
    vectors = []
    for i in range(3):
        start, end = ([_rounded(c) for c in d[:, e, i].T] for e in (0, 1))
        vectors.append(tuple(a + time * (b - a) for a, b in zip(start, end, strict=True)))
    p, q, r = vectors
    return p, q, r  # type: ignore[return-value]


def _rounded(difference: Floats) -> Ball:
    return Ball(difference, _above(2 * UNIT * np.abs(difference)))


def _cross(a: Vector, b: Vector) -> Vector:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def _dot(a: Vector, b: Vector) -> Ball:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _crosses(d: Floats, low: Floats, high: Floats) -> Mask:
    """The volume has certainly opposite signs at both times, so that it is zero in between."""
    signs = []
    for time in (low, high):
        p, q, r = _during(d, time, time)
        signs.append(_dot(p, _cross(q, r)).sign())
    return np.asarray(signs[0] * signs[1] == -1)


def _inside(d: Floats, low: Floats, high: Floats, vertex: bool) -> Mask:
    """Wherever in the interval the points share a plane, the features meet in it.

    Vertex and face: p = a q + b r with a, b >= 0 and a + b <= 1. Edges: p + b r = a q with a and
    b in [0, 1]. Both by products with n = q x r, which is not zero.
    """
    p, q, r = _during(d, low, high)
    n = _cross(q, r)
    whole = _dot(n, n)
    a = _dot(_cross(p, r), n)
    b = _dot(_cross(q, p) if vertex else _cross(p, q), n)
    rest = [whole - (a + b)] if vertex else [whole - a, whole - b]
    return np.asarray(np.all([w.sign() == 1 for w in (whole, a, b, *rest)], axis=0))
