"""Distance, nearest points and depth of convex bodies, row by row."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast, overload

import numpy as np
from numpy.typing import NDArray

from tauguard.geometry import thread_count
from tauguard.rigid import _rigid_mesh
from tauguard.rigid.queries import find_witness, native, rows
from tauguard.rigid.results import Overlap, Witness
from tauguard.rigid.rounded import Solid, solid_parts

if TYPE_CHECKING:
    from tauguard.rigid.mesh import MeshTree
    from tauguard.rigid.mesh_bodies import MeshGaps


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


@overload
def distance(a: Solid, b: Solid, threads: int = 1) -> Gaps: ...
@overload
def distance(a: MeshTree, b: Solid, threads: int = 1) -> MeshGaps: ...
@overload
def distance(a: Solid, b: MeshTree, threads: int = 1) -> MeshGaps: ...
def distance(a: Solid | MeshTree, b: Solid | MeshTree, threads: int = 1) -> Gaps:
    """Signed distance, nearest points and normal of the convex bodies ``a[i]`` and ``b[i]``.

    The sign is never wrong, degenerate bodies included: it is that of :func:`overlap`, and 0
    exactly where the bodies touch. The length is off by at most 3e-14 of the pair's extent and
    distance. Gilbert, Johnson and Keerthi's descent (1988) and the expanding polytope (van den
    Bergen 2001) in floating point, each answer with its certificate; where that fails, and within
    1e-10 of contact, both in exact arithmetic (about a millisecond a pair).

    Args:
        a: N bodies of one kind, rounded or not, or one; or a mesh, whose surface counts (not its
            inside) and whose frame the bodies' numbers are in.
        b: N bodies, or one; kinds mix freely. At most one side is a mesh.
        threads: 0 means all processors; the answer does not depend on it.

    Raises:
        ValueError: lengths that do not match, polygons, two meshes, or a coordinate beyond 1e100
            (1e30 beside a mesh).
    """
    from tauguard.rigid import mesh_bodies
    from tauguard.rigid.mesh import MeshTree

    if isinstance(a, MeshTree) and isinstance(b, MeshTree):
        raise ValueError("b: a mesh, as a is; distances are of a mesh and convex bodies")
    if isinstance(a, MeshTree):
        return mesh_bodies.distance(a, cast(Solid, b), threads)
    if isinstance(b, MeshTree):
        return mesh_bodies.distance(b, a, threads, swapped=True)
    (core_a, radius_a), (core_b, radius_b) = solid_parts("a", a), solid_parts("b", b)
    out = np.empty((rows(core_a, core_b), 10))
    _rigid_mesh.gaps(
        *native(core_a), radius_a, *native(core_b), radius_b, out, thread_count(threads)
    )
    return Gaps(out[:, 0], out[:, 1:4], out[:, 4:7], out[:, 7:10])


def rounded_overlap(a: Solid, b: Solid, threads: int = 1) -> Overlap:
    """Whether bodies with radii share a point; exact as :func:`distance` is, without its depth."""
    (core_a, radius_a), (core_b, radius_b) = solid_parts("a", a), solid_parts("b", b)
    hit = np.empty(rows(core_a, core_b), dtype=np.uint8)
    _rigid_mesh.meets(
        *native(core_a), radius_a, *native(core_b), radius_b, hit, thread_count(threads)
    )
    met = hit.view(np.bool_)
    return Overlap(met, lambda: rounded_witness(a, b, met, threads))


def rounded_witness(a: Solid, b: Solid, hit: NDArray[np.bool_], threads: int = 1) -> Witness:
    """A common point or a separating plane of each row, to rounding."""
    (core_a, radius_a), (core_b, radius_b) = solid_parts("a", a), solid_parts("b", b)
    cores = distance(core_a, core_b, threads)
    # Where the cores meet they have a common point; else it lies on the way between them.
    point = find_witness(core_a, core_b, cores.distance <= 0, threads).point
    way = np.maximum(cores.distance, 0.0)
    share = 0.5 * (np.maximum(way - radius_b, 0.0) + np.minimum(way, radius_a))
    between = cores.point_a + share[:, None] * cores.normal
    point = np.where((cores.distance > 0)[:, None], between, point)
    middle = cores.point_a + 0.5 * (way + radius_a - radius_b)[:, None] * cores.normal
    offset = np.einsum("ij,ij->i", cores.normal, middle)
    return Witness(
        np.where(hit[:, None], point, np.nan),
        np.where(hit[:, None], np.nan, cores.normal),
        np.where(hit, np.nan, offset),
    )
