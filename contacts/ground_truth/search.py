"""Find first contact and depth along a path, from the distance and a bound on its change.

Let d(s) be the signed distance of two objects whose points move by at most L relative to each other
in the step. Then |d(s) - d(t)| <= L |s - t|, so d has no zero in [a, b] if d(a) + d(b) > L (b - a).
Intervals are halved until this holds, or a penetration is found, or the interval is shorter than
the resolution (Piyavskii 1972; conservative advancement uses the same bound).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array

#: Function (rows, s), both of shape (K,), that returns signed distances of pairs [m], shape (K,).
Distance = Callable[[NDArray[Any], Array], Array]


@dataclass(frozen=True)
class Found:
    """The result of a search for each pair; every field has shape (N,)."""

    time: Array  #: first touch (fraction of the step), late by less than resolution / L; or inf
    depth: Array  #: largest depth found [m]; 0 without penetration


def search(
    distance: Distance, bound: Array, tolerance: float = 1e-5, resolution: float = 2e-6
) -> Found:
    """Find the first touch of each pair, and whether it becomes deeper than ``tolerance``.

    Args:
        distance: Distances of pairs at given times.
        bound: Bound L of each pair [m], shape (N,).
        tolerance: Once a pair is deeper than this, greater depths are not searched for [m].
        resolution: Distance below which a pair may be reported as touching [m].
    """
    n = len(bound)
    rows = np.arange(n)
    first, deepest = np.full(n, np.inf), np.full(n, np.inf)

    def sample(pairs: NDArray[Any], s: Array) -> Array:
        d = distance(pairs, s)
        np.minimum.at(deepest, pairs, d)
        touching = d <= 0
        np.minimum.at(first, pairs[touching], s[touching])
        return d

    a, b = np.zeros(n), np.ones(n)
    da, db = sample(rows, a), sample(rows, b)
    while len(rows):
        length = bound[rows] * (b - a)
        # After the first contact only a depth above the tolerance matters.
        known = (deepest[rows] < -tolerance) | ((da + db - length) / 2 > -tolerance)
        settled = known & (a >= first[rows])
        open_ = (da + db <= length) & ~settled
        short = open_ & (length <= resolution)
        np.minimum.at(first, rows[short], b[short])
        keep = open_ & ~short
        rows, a, b, da, db = rows[keep], a[keep], b[keep], da[keep], db[keep]
        # There is no contact within d / L of either end. Split the rest in the middle.
        low = a + np.maximum(da, 0) / bound[rows]
        high = np.maximum(b - np.maximum(db, 0) / bound[rows], low)
        middle = np.clip((low + high) / 2, a + 0.05 * (b - a), b - 0.05 * (b - a))
        dm = sample(rows, middle)
        rows = np.concatenate([rows, rows])
        a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
        da, db = np.concatenate([da, dm]), np.concatenate([dm, db])
    _polish(distance, first, bound, resolution)
    return Found(first, np.maximum(-deepest, 0.0))


def _polish(distance: Distance, first: Array, bound: Array, resolution: float) -> None:
    """Bisect the last interval before each first touch, in place."""
    rows = np.flatnonzero(np.isfinite(first) & (first > 0))
    high = first[rows]
    low = np.maximum(high - 2 * resolution / bound[rows], 0.0)
    for _ in range(12):
        middle = (low + high) / 2
        touching = distance(rows, middle) <= 0
        high = np.where(touching, middle, high)
        low = np.where(touching, low, middle)
    first[rows] = high
