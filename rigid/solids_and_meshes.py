"""Overlap and distance of convex bodies, and of meshes with convex bodies."""

from typing import Literal, cast, get_args, overload

from tauguard.rigid import mesh_bodies
from tauguard.rigid.mesh import MeshOverlap, MeshTree
from tauguard.rigid.queries import check_method, sharp_overlap
from tauguard.rigid.results import Distances, MeshDistances, Overlap
from tauguard.rigid.rounded import Solid
from tauguard.rigid.shapes import Bodies
from tauguard.rigid.solid_queries import rounded_overlap, solid_distances

OverlapMethod = Literal["abfme", "sat", "auto"]


@overload
def overlap(a: Solid, b: Solid, method: OverlapMethod = "auto", threads: int = 1) -> Overlap: ...
@overload
def overlap(
    a: MeshTree, b: Solid, method: OverlapMethod = "auto", threads: int = 1
) -> MeshOverlap: ...
@overload
def overlap(
    a: Solid, b: MeshTree, method: OverlapMethod = "auto", threads: int = 1
) -> MeshOverlap: ...
def overlap(
    a: Solid | MeshTree, b: Solid | MeshTree, method: OverlapMethod = "auto", threads: int = 1
) -> Overlap | MeshOverlap:
    """Whether the convex bodies ``a[i]`` and ``b[i]`` share a point; touching is a hit.

    Args:
        a: N bodies of one kind, with or without radii, or one body for all rows. Or a mesh: its
            surface is tested, not its inside, and the bodies' coordinates are in its frame.
        b: As ``a``. The two kinds may differ, and at most one side may be a mesh.
        method: ``abfme``, ``sat`` (needs facets, so not for hulls) or ``auto`` (the fastest for the
            two kinds in the study ``rigid``). Each is exact for any finite input. For bodies with
            radii and for meshes, only ``auto`` is available.
        threads: 0 means all processors; the answer does not depend on it.

    Returns:
        ``hit`` of shape (N,). For two batches of bodies also ``witness``, which is computed at the
        first access; for a mesh also ``faces``.

    Raises:
        ValueError: lengths that do not match, a method that is unknown or not available for the
            arguments, two meshes, or a coordinate beyond 1e100 of bodies with radii (with a mesh:
            a coordinate of the bodies beyond 1e30).
    """
    check_method(method, get_args(OverlapMethod))
    special = [name for name, solid in (("a", a), ("b", b)) if not isinstance(solid, Bodies)]
    if special and method != "auto":
        raise ValueError(
            f"method: {method!r} needs bodies without radii, but {special[0]} is a "
            f"{type(a if special[0] == 'a' else b).__name__}; expected auto"
        )
    if not special:
        return sharp_overlap(cast(Bodies, a), cast(Bodies, b), method, threads)
    if beside := mesh_bodies.mesh_beside(a, b):
        return mesh_bodies.overlap(*beside, threads)
    return rounded_overlap(cast(Solid, a), cast(Solid, b), threads)


@overload
def distance(a: Solid, b: Solid, threads: int = 1) -> Distances: ...
@overload
def distance(a: MeshTree, b: Solid, threads: int = 1) -> MeshDistances: ...
@overload
def distance(a: Solid, b: MeshTree, threads: int = 1) -> MeshDistances: ...
def distance(a: Solid | MeshTree, b: Solid | MeshTree, threads: int = 1) -> Distances:
    """Signed distance, nearest points and normal of the convex bodies ``a[i]`` and ``b[i]``.

    The sign is exact, also for degenerate bodies: it agrees with :func:`overlap`, and the distance
    is 0 if and only if the bodies touch. The error of the distance is at most 3e-14 times the
    diagonal of the box around both bodies.

    The method is the descent of Gilbert, Johnson and Keerthi (1988) with the expanding polytope
    (van den Bergen 2001). Both run in floating point, and a certificate checks each result. If the
    certificate fails, or the bodies are closer to contact than 1e-10 of their size, both run in
    exact arithmetic, which takes about a millisecond per pair.

    Args:
        a: N bodies of one kind, with or without radii, or one body. Or a mesh: its surface is
            tested, not its inside, and the bodies' coordinates are in its frame.
        b: As ``a``. The two kinds may differ, and at most one side may be a mesh.
        threads: 0 means all processors; the answer does not depend on it.

    Raises:
        ValueError: lengths that do not match, polygons, two meshes, or a coordinate beyond 1e100
            (with a mesh: a coordinate of the bodies beyond 1e30).
    """
    if beside := mesh_bodies.mesh_beside(a, b):
        return mesh_bodies.distance(*beside, threads)
    return solid_distances(cast(Solid, a), cast(Solid, b), threads)
