"""Distance, nearest points and depth of convex bodies, row by row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.geometry import thread_count
from tauguard.rigid import _rigid_mesh
from tauguard.rigid.queries import native, rows
from tauguard.rigid.rounded import Solid, solid_parts


@dataclass(frozen=True, eq=False)
class Gaps:
    """Signed distance of two bodies, row by row: ``(point_b - point_a) . normal``.

    Attributes:
        distance: Above zero the shortest way between the bodies, zero where they touch, below zero
            minus the shortest way that brings them apart. Shape (N,).
        point_a: The point of a nearest to b; in each other, a's deepest point along the normal.
            Shape (N, 3).
        point_b: Likewise of b. Shape (N, 3).
        normal: Unit, from a to b: the direction in which b leaves a. Where bodies without
            thickness touch, any normal of what they span. Shape (N, 3).
    """

    distance: NDArray[np.float64]
    point_a: NDArray[np.float64]
    point_b: NDArray[np.float64]
    normal: NDArray[np.float64]

    def within(self, min_distance: float) -> NDArray[np.bool_]:
        """Which pairs are no further apart than ``min_distance``. Shape (N,)."""
        return self.distance <= min_distance


def solid_gaps(a: Solid, b: Solid, threads: int = 1) -> Gaps:
    """Signed distances of convex bodies, as the public query gives them."""
    (core_a, radius_a), (core_b, radius_b) = solid_parts("a", a), solid_parts("b", b)
    out = np.empty((rows(core_a, core_b), 10))
    _rigid_mesh.gaps(
        *native(core_a), radius_a, *native(core_b), radius_b, out, thread_count(threads)
    )
    return Gaps(out[:, 0], out[:, 1:4], out[:, 4:7], out[:, 7:10])
