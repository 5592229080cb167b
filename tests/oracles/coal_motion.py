"""coal's distance of moving pairs, and times of contact by advancement over it."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracles import coal_peer
from oracles.convex_pairs import take
from tauguard.arrays import Array
from tauguard.rigid import Motion

#: coal's shapes, each with its pose in the body's frame.
Shapes = list[tuple[Any, Any]]
#: Distance at which advancement stops [m]: coal's own tolerance.
CONTACT = 1e-6
#: Calls after which advancement gives up a pair that creeps towards contact.
MOST_CALLS = 500


class MovingDistance:
    """coal's distance of moving pairs; counts the calls and the seconds of every pair."""

    def __init__(
        self, sides: tuple[Shapes, Shapes], motions: tuple[Motion, Motion], signed: bool
    ) -> None:
        """Shapes in the bodies' frames and motions (one may stand for all); signed: convex."""
        self.sides, self.motions, self.signed = sides, motions, signed
        self.coal = coal_peer.coal_module()
        self.n = max(*map(len, sides), *map(len, motions))
        self.seconds, self.calls = np.zeros(self.n), np.zeros(self.n, dtype=np.intp)

    def __call__(self, rows: NDArray[np.intp], t: Array) -> Array:
        """The distance of the chosen rows at their times [m]. Shape (K,)."""
        placed = [self._placed(side, rows, t) for side in (0, 1)]
        request, result = self.coal.DistanceRequest(), self.coal.DistanceResult()
        request.enable_signed_distance = self.signed
        out = np.empty(len(rows))
        for k, ((a, at_a), (b, at_b)) in enumerate(zip(*placed, strict=True)):
            result.clear()
            begin = time.perf_counter()
            out[k] = self.coal.distance(a, at_a, b, at_b, request, result)
            self.seconds[rows[k]] += time.perf_counter() - begin
        self.calls[rows] += 1
        return out

    def _placed(self, side: int, rows: NDArray[np.intp], t: Array) -> Shapes:
        motion, own = self.motions[side], self.sides[side]
        poses = take(motion, rows).at(t)
        found = []
        for row, pose in zip(rows, poses, strict=True):
            shape, place = own[row if len(own) > 1 else 0]
            found.append((shape, self.coal.Transform3s(pose[:3, :3], pose[:3, 3]) * place))
        return found


def advanced_times(distance: MovingDistance, rows: NDArray[np.intp], speed: Array) -> Array:
    """Times of contact of these rows by conservative advancement (Mirtich 1996); inf: none.

    Args:
        distance: of all pairs; its counts begin anew.
        rows: of the pairs that are asked for.
        speed: bound on the speed of any point of one body towards the other [m a step]. Shape (n,).

    Returns:
        Shape (n,). A pair that takes too many calls keeps the time that it has reached.
    """
    distance.seconds[:], distance.calls[:] = 0, 0
    t, toi = np.zeros(distance.n), np.full(distance.n, np.inf)
    for _ in range(MOST_CALLS):
        left = distance(rows, t[rows])
        touch = left <= CONTACT
        toi[rows[touch]] = t[rows[touch]]
        t[rows] += np.maximum(left, 0) / speed[rows]
        rows = rows[~touch & (t[rows] < 1)]
        if len(rows) == 0:
            break
    toi[rows] = t[rows]
    return toi
