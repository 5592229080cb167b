"""Overlap and distance of convex bodies, rounded or not, and of meshes with them."""

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
        a: N bodies of one kind, rounded or not, or one body that meets every ``b[i]``; or a mesh,
            whose surface counts (not its inside) and whose frame the bodies' numbers are in.
        b: likewise; kinds mix freely, and at most one side is a mesh.
        method: ``abfme``, ``sat`` (not for hulls, which have no facets) or ``auto`` (what the
            study ``rigid`` shows fastest for the two kinds): never wrong on any finite input.
            Rounded bodies and meshes know ``auto``, which is as exact.
        threads: 0 means all processors; the answer does not depend on it.

    Returns:
        ``hit`` of shape (N,); of bodies ``witness``, which is found at its first access, and of a
        mesh the ``faces`` that are met.

    Raises:
        ValueError: lengths that do not match, an unknown method, ``sat`` of hulls,
            another method than ``auto`` of rounded bodies or a mesh, two meshes,
            a coordinate beyond 1e100 of rounded bodies (1e30 beside a mesh).
    """
    check_method(method, get_args(OverlapMethod))
    special = [name for name, solid in (("a", a), ("b", b)) if not isinstance(solid, Bodies)]
    if special and method != "auto":
        raise ValueError(
            f"method: {method!r} takes bodies without a radius only, which {special[0]} is not; "
            "expected auto"
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

    The sign is never wrong, even for degenerate bodies: it agrees with :func:`overlap`, and the
    distance is 0 exactly where the bodies touch. The error of the length is at most 3e-14 of the
    pair's extent, which is the diagonal of the box around both. The method is Gilbert, Johnson and
    Keerthi's descent (1988) with the expanding polytope (van den Bergen 2001) in floating point; a
    certificate checks each answer. If the certificate fails, or the bodies are within 1e-10 of
    contact, both algorithms run in exact arithmetic, which takes about a millisecond a pair.

    Args:
        a: N bodies of one kind, rounded or not, or one; or a mesh, whose surface counts (not its
            inside) and whose frame the bodies' numbers are in.
        b: N bodies, or one; kinds mix freely. At most one side is a mesh.
        threads: 0 means all processors; the answer does not depend on it.

    Raises:
        ValueError: lengths that do not match, polygons, two meshes, or a coordinate beyond 1e100
            (1e30 beside a mesh).
    """
    if beside := mesh_bodies.mesh_beside(a, b):
        return mesh_bodies.distance(*beside, threads)
    return solid_distances(cast(Solid, a), cast(Solid, b), threads)
