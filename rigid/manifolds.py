"""Contact manifolds of convex bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import in_a_line
from tauguard.findings import ArgumentError
from tauguard.geometry import thread_count
from tauguard.rigid import _rigid
from tauguard.rigid.mesh import MeshTree
from tauguard.rigid.motion import PoseLike, optional_poses
from tauguard.rigid.rounded import Solid
from tauguard.rigid.solids_and_meshes import native_pair


@dataclass(frozen=True, eq=False)
class Contacts:
    """Contact points, sorted by pair; the first one of a pair is the deepest.

    Attributes:
        pair: Row of the two bodies. Shape (M,).
        point_a: Point on the surface of a. Shape (M, 3).
        point_b: Point on the surface of b, opposite along the normal. Shape (M, 3).
        normal: Unit normal from a to b, the same for all points of a pair. Shape (M, 3).
        distance: ``(point_b - point_a) . normal``; negative in penetration. Shape (M,).
    """

    pair: NDArray[np.int64]
    point_a: NDArray[np.float64]
    point_b: NDArray[np.float64]
    normal: NDArray[np.float64]
    distance: NDArray[np.float64]

    __repr__ = in_a_line

    def __len__(self) -> int:
        return len(self.pair)

    @property
    def point(self) -> NDArray[np.float64]:
        """The middle between both points. Shape (M, 3)."""
        return 0.5 * (self.point_a + self.point_b)


def contacts(
    a: Solid,
    b: Solid,
    margin: float = 0.0,
    threads: int = 1,
    *,
    pose_a: PoseLike = None,
    pose_b: PoseLike = None,
) -> Contacts:
    """Up to four contact points of each pair of convex bodies ``a[i]`` and ``b[i]``.

    The normal and the distance of the first point are those of :func:`distance`. The contact
    features of a pair are the faces, edges or vertices that are flat across the normal, up to 3
    degrees. The points are corners of the intersection of both features seen along the normal:
    the deepest one, the one furthest from it, and one on either side of the line through these. A
    cap is a polygon of 16 corners.

    Args:
        a: N convex bodies of one kind, or one body.
        b: As ``a``.
        margin: Points up to this distance apart are contacts; 0 or more.
        threads: 0 means all processors; the answer does not depend on it.
        pose_a: Poses of the bodies ``a``, as for :func:`distance`.
        pose_b: Poses of the bodies ``b``.

    Raises:
        ArgumentError: a mesh, a margin that is negative or not finite, or an error of
            :func:`distance`.
    """
    for name, bodies in (("a", a), ("b", b)):
        if isinstance(bodies, MeshTree):
            raise ArgumentError(
                f"{name}: MeshTree, expected convex bodies; MeshTree.contacts takes two meshes"
            )
    if not isinstance(margin, int | float | np.number) or not 0 <= margin < np.inf:
        raise ArgumentError(f"margin: {margin!r:.40}, expected a length of 0 or more")
    at_a, at_b = optional_poses("pose_a", pose_a), optional_poses("pose_b", pose_b)
    count, first, second = native_pair(a, b, at_a, at_b)
    counts, distances = np.empty(count, dtype=np.int32), np.empty((count, 10))
    out = np.empty((count, 4, 7))
    _rigid.manifolds(first, second, float(margin), counts, distances, out, thread_count(threads))
    rows = out[np.arange(4) < counts[:, None]]
    pair = np.repeat(np.arange(count), counts)
    return Contacts(pair, rows[:, :3], rows[:, 3:6], distances[pair, 7:10], rows[:, 6])
