"""Distance and overlap of convex bodies, with or without radii."""

import numpy as np
from numpy.typing import NDArray

from tauguard.geometry import thread_count
from tauguard.rigid import _rigid_mesh
from tauguard.rigid.queries import find_witness, native, rows
from tauguard.rigid.results import Distances, Overlap, Witness
from tauguard.rigid.rounded import Solid, solid_parts


def solid_distances(a: Solid, b: Solid, threads: int = 1) -> Distances:
    """Signed distances of convex bodies; see :func:`tauguard.rigid.distance`."""
    (core_a, radius_a), (core_b, radius_b) = solid_parts("a", a), solid_parts("b", b)
    out = np.empty((rows(core_a, core_b), 10))
    _rigid_mesh.distances(
        *native(core_a), radius_a, *native(core_b), radius_b, out, thread_count(threads)
    )
    return Distances(out[:, 0], out[:, 1:4], out[:, 4:7], out[:, 7:10])


def rounded_overlap(a: Solid, b: Solid, threads: int = 1) -> Overlap:
    """Whether bodies with radii share a point, decided exactly."""
    (core_a, radius_a), (core_b, radius_b) = solid_parts("a", a), solid_parts("b", b)
    hit = np.empty(rows(core_a, core_b), dtype=np.uint8)
    _rigid_mesh.meets(
        *native(core_a), radius_a, *native(core_b), radius_b, hit, thread_count(threads)
    )
    met = hit.view(np.bool_)
    return Overlap(met, lambda: rounded_witness(a, b, met, threads))


def rounded_witness(a: Solid, b: Solid, hit: NDArray[np.bool_], threads: int = 1) -> Witness:
    """A common point or a separating plane of each row, up to rounding."""
    (core_a, radius_a), (core_b, radius_b) = solid_parts("a", a), solid_parts("b", b)
    cores = solid_distances(core_a, core_b, threads)
    # Cores that overlap have a common point. Otherwise the point is on the segment between them.
    point = find_witness(core_a, core_b, cores.distance <= 0, threads).point
    gap = np.maximum(cores.distance, 0.0)
    along = 0.5 * (np.maximum(gap - radius_b, 0.0) + np.minimum(gap, radius_a))
    between = cores.point_a + along[:, None] * cores.normal
    point = np.where((cores.distance > 0)[:, None], between, point)
    middle = cores.point_a + 0.5 * (gap + radius_a - radius_b)[:, None] * cores.normal
    offset = np.einsum("ij,ij->i", cores.normal, middle)
    return Witness(
        np.where(hit[:, None], point, np.nan),
        np.where(hit[:, None], np.nan, cores.normal),
        np.where(hit, np.nan, offset),
    )
