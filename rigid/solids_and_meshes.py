"""Queries of convex bodies with radii, and of meshes with convex bodies."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, cast, get_args, overload

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.findings import ArgumentError
from tauguard.geometry import thread_count
from tauguard.rigid import _rigid
from tauguard.rigid.curved import HalfSpaces
from tauguard.rigid.mesh import MeshOverlap, MeshTree, check_magnitude, first_touch
from tauguard.rigid.mesh_distance import MeshPairDistances, mesh_distance
from tauguard.rigid.motion import Motion, PoseLike, bounded, common_length, optional_poses
from tauguard.rigid.motion_start import with_start
from tauguard.rigid.queries import (
    Poses,
    check_method,
    find_witness,
    posed_pair,
    row_count,
    sharp_overlap,
)
from tauguard.rigid.results import (
    Distances,
    Impacts,
    MeshDistances,
    MeshImpacts,
    Overlap,
    Witness,
)
from tauguard.rigid.rounded import Solid, solid_parts
from tauguard.rigid.shapes import Bodies, Shape

OverlapMethod = Literal["abfme", "sat", "auto"]
#: Largest coordinate and radius of bodies in a query with a mesh; meshes have the same limit.
MOST_COORDINATE = 1e30


@overload
def overlap(
    a: Solid,
    b: Solid,
    method: OverlapMethod = "auto",
    threads: int = 1,
    *,
    pose_a: PoseLike = None,
    pose_b: PoseLike = None,
) -> Overlap: ...
@overload
def overlap(
    a: MeshTree,
    b: Solid,
    method: OverlapMethod = "auto",
    threads: int = 1,
    *,
    pose_b: PoseLike = None,
) -> MeshOverlap: ...
@overload
def overlap(
    a: Solid,
    b: MeshTree,
    method: OverlapMethod = "auto",
    threads: int = 1,
    *,
    pose_a: PoseLike = None,
) -> MeshOverlap: ...
def overlap(
    a: Solid | MeshTree,
    b: Solid | MeshTree,
    method: OverlapMethod = "auto",
    threads: int = 1,
    *,
    pose_a: PoseLike = None,
    pose_b: PoseLike = None,
) -> Overlap | MeshOverlap:
    """Whether the convex bodies ``a[i]`` and ``b[i]`` share a point; touching is a hit.

    For polytopes, also grown by radii, the answer is exact. For a cylinder, cone or ellipsoid it
    is a hit where :func:`distance` is at most 0.

    Args:
        a: N bodies of one kind, with or without radii, or one body for all rows. Or a mesh: its
            surface is tested, not its inside, and the bodies' coordinates are in its frame.
        b: As ``a``. The two kinds may differ, and at most one side may be a mesh.
        method: ``abfme``, ``sat`` (needs facets, so not for hulls) or ``auto`` (the fastest for the
            two kinds in the study ``rigid``). Each is exact for any finite input. For bodies with
            radii, for curved bodies and for meshes, only ``auto`` is available.
        threads: 0 means all processors; the answer does not depend on it.
        pose_a: Poses of the bodies ``a``, as for :func:`distance`.
        pose_b: Poses of the bodies ``b``.

    Returns:
        ``hit`` of shape (N,). For two batches of bodies also ``witness``, which is computed at the
        first access; for a mesh also ``faces``.

    Raises:
        ArgumentError: lengths that do not match, a method that is unknown or not available for the
            arguments, two meshes, two half-spaces, a bad pose, or a coordinate beyond 1e100 of
            bodies with radii and curved bodies (with a mesh: beyond 1e30).
    """
    if pose_a is None and pose_b is None and type(method) is str and method == "auto":
        few = _few(_rigid.few_meets, a, b) if type(threads) is int and threads == 1 else None
        if few is not None:
            return Overlap(few, lambda: overlap_witness(a, b, few))
    _check_place("method", method)
    check_method(method, get_args(OverlapMethod))
    special = [name for name, solid in (("a", a), ("b", b)) if not isinstance(solid, Bodies)]
    if special and method != "auto":
        raise ArgumentError(
            f"method: {method!r} needs bodies without radii, but {special[0]} is a "
            f"{type(a if special[0] == 'a' else b).__name__}; expected auto"
        )
    at_a, at_b = optional_poses("pose_a", pose_a), optional_poses("pose_b", pose_b)
    if not special:
        return sharp_overlap(cast(Bodies, a), cast(Bodies, b), method, threads, at_a, at_b)
    if beside := _mesh_beside(a, b, at_a, at_b):
        mesh, bodies, count, swapped = beside
        face = np.empty(count, dtype=np.int32)
        mesh._mesh.meets(bodies, face, thread_count(threads))
        return MeshOverlap(face >= 0, _faces_of(face, swapped))
    count, first, second = native_pair(a, b, at_a, at_b)
    hit = np.empty(count, dtype=np.uint8)
    _rigid.meets(first, second, hit, thread_count(threads))
    met = hit.view(np.bool_)
    return Overlap(met, lambda: _witness(first, second, hit, threads))


def _few(query: Callable[[Any, Any], Any], a: object, b: object) -> Any:
    """Ask for a few pairs of bodies in one short call; ``None`` where the general query must."""
    if not (isinstance(a, Shape) and isinstance(b, Shape)):
        return None
    first, second = a.ready, b.ready
    return None if first is None or second is None else query(first, second)


def overlap_witness(a: Any, b: Any, hit: NDArray[np.bool_]) -> Witness:
    """The witness of an overlap of few rows."""
    if isinstance(a, Bodies) and isinstance(b, Bodies):
        return find_witness(a, b, hit)
    _, first, second = native_pair(a, b)
    return _witness(first, second, hit.view(np.uint8))


def _witness(a: _rigid.Batch, b: _rigid.Batch, hit: NDArray[np.uint8], threads: int = 1) -> Witness:
    """A common point or a separating plane of each row, up to rounding."""
    out, point = np.empty((len(hit), 10)), np.full((len(hit), 3), np.nan)
    _rigid.distances(a, b, out, thread_count(threads))
    _rigid.common_points(a, b, hit, point, thread_count(threads))
    normal, met = out[:, 7:10], hit.view(np.bool_)
    offset = np.einsum("ij,ij->i", normal, 0.5 * (out[:, 1:4] + out[:, 4:7]))
    return Witness(point, np.where(met[:, None], np.nan, normal), np.where(met, np.nan, offset))


@overload
def distance(
    a: Solid,
    b: Solid,
    threads: int = 1,
    *,
    pose_a: PoseLike = None,
    pose_b: PoseLike = None,
) -> Distances: ...
@overload
def distance(
    a: MeshTree,
    b: MeshTree,
    threads: int = 1,
    *,
    pose_a: PoseLike = None,
    pose_b: PoseLike = None,
) -> MeshPairDistances: ...
@overload
def distance(
    a: MeshTree, b: Solid, threads: int = 1, *, pose_b: PoseLike = None
) -> MeshDistances: ...
@overload
def distance(
    a: Solid, b: MeshTree, threads: int = 1, *, pose_a: PoseLike = None
) -> MeshDistances: ...
def distance(
    a: Solid | MeshTree,
    b: Solid | MeshTree,
    threads: int = 1,
    *,
    pose_a: PoseLike = None,
    pose_b: PoseLike = None,
) -> Distances:
    """Signed distance, nearest points and normal of the bodies ``a[i]`` and ``b[i]``.

    The bound of the error is relative to the diagonal of the box around both bodies:

    * Polytopes (tetrahedra, boxes, parallelepipeds, hulls), half-spaces against them, and all of
      these grown by radii: 3e-14. The sign is exact, also for degenerate bodies: it agrees with
      :func:`overlap`, and the distance is 0 if and only if the bodies touch.
    * A cylinder, cone or ellipsoid on either side: 1e-9. Beyond this bound the sign is certain.
    * A half-space and a cylinder, cone or ellipsoid: 3e-14.
    * Two meshes: 1e-12. The distance of the surfaces is 0 if and only if they share a point,
      exactly for the pose of ``b`` relative to ``a``, rounded. If both are closed it is signed; see
      :class:`MeshPairDistances`.

    The method is the descent of Gilbert, Johnson and Keerthi (1988) with the expanding polytope
    (van den Bergen 2001). Both run in floating point, and a certificate checks each result of
    polytopes. If the certificate fails, or the bodies are closer to contact than 1e-10 of their
    size, both run in exact arithmetic, which takes about a millisecond per pair.

    Args:
        a: N bodies of one kind, with or without radii, or one body. Or a mesh, with the bodies'
            coordinates in its frame. The distance of a body inside of a closed mesh is negative.
        b: As ``a``. The two kinds may differ. For two meshes the rows are poses.
        threads: 0 means all processors; the answer does not depend on it.
        pose_a: Homogeneous matrices that move the bodies ``a`` into the common frame, one for all
            or one per row. Shape (4, 4) or (N, 4, 4). One body at N poses is not copied. A pose
            transforms the numbers of a body (vertices; centre and rotation) and rounds them; the
            answer is that for the rounded numbers.
        pose_b: As ``pose_a``, for ``b``.

    Raises:
        ArgumentError: lengths that do not match, polygons, two half-spaces, two meshes whose trees
            have different volumes, a pose that is no rigid motion (named with its row), or a
            coordinate beyond 1e100 (with a mesh: a coordinate of the bodies beyond 1e30).
    """
    if pose_a is None and pose_b is None and type(threads) is int and threads == 1:
        table = _few(_rigid.few_distances, a, b)
        if table is not None:
            return Distances.of_rows(table)
    _check_place("threads", threads)
    if isinstance(a, MeshTree) and isinstance(b, MeshTree):
        return mesh_distance(a, b, pose_a, pose_b, threads)
    at_a, at_b = optional_poses("pose_a", pose_a), optional_poses("pose_b", pose_b)
    if beside := _mesh_beside(a, b, at_a, at_b):
        check_magnitude(a, b)
        mesh, bodies, count, swapped = beside
        out, face = np.empty((count, 10)), np.empty(count, dtype=np.int32)
        mesh._mesh.distances(bodies, mesh.closed, out, face, thread_count(threads))
        first, second, normal = out[:, 1:4], out[:, 4:7], out[:, 7:10]
        if swapped:
            first, second, normal = second, first, -normal
        return MeshDistances(out[:, 0], first, second, normal, face)
    count, one, other = native_pair(a, b, at_a, at_b)
    out = np.empty((count, 10))
    _rigid.distances(one, other, out, thread_count(threads))
    return Distances(out[:, 0], out[:, 1:4], out[:, 4:7], out[:, 7:10])


def _check_place(name: str, value: object) -> None:
    """Raise an ``ArgumentError`` for a pose in the place of the argument ``name``."""
    if isinstance(value, np.ndarray | list):
        raise ArgumentError(f"{name}: an array; poses are passed by name, `pose_a=` and `pose_b=`")


@overload
def time_of_impact(
    a: Solid,
    b: Solid,
    motion_a: Motion,
    motion_b: Motion,
    threads: int = 1,
    *,
    target_distance: float = 0.0,
    stop_at_penetration: bool = True,
    compute_impact_geometry_on_penetration: bool = False,
) -> Impacts: ...
@overload
def time_of_impact(
    a: MeshTree, b: MeshTree | Solid, motion_a: Motion, motion_b: Motion, threads: int = 1
) -> MeshImpacts: ...
@overload
def time_of_impact(
    a: Solid, b: MeshTree, motion_a: Motion, motion_b: Motion, threads: int = 1
) -> MeshImpacts: ...
def time_of_impact(
    a: Solid | MeshTree,
    b: Solid | MeshTree,
    motion_a: Motion,
    motion_b: Motion,
    threads: int = 1,
    *,
    target_distance: float = 0.0,
    stop_at_penetration: bool = True,
    compute_impact_geometry_on_penetration: bool = False,
) -> Impacts:
    """The first contact of moving bodies, t in [0, 1].

    The coordinates of a body are relative to its own frame, which the motion moves. The answer is
    conservative, also under rounding: at every time before ``time_of_impact`` the bodies are apart.
    The method is advancement along separating directions (Mirtich 1996; Zhang, Lee and Kim 2006)
    with a bound on the second derivative: it converges quadratically, from below.

    Args:
        a: N convex bodies of one kind, with or without radii, or one body. Or a mesh: its surface
            is tested, not its inside.
        b: As ``a``. Two meshes may have different bounding volumes.
        motion_a: N motions, or one.
        motion_b: N motions, or one.
        threads: 0 means all processors; the answer does not depend on it.
        target_distance: Bodies this near to each other count as touching (not for two meshes).
        stop_at_penetration: Whether bodies that overlap at t = 0 (or are within the target
            distance) are a hit there. If not, those whose nearest points move apart are a hit only
            at a later time, at which they approach each other. Until they are apart, the pair is
            tested at least every 0.1 rad of rotation.
        compute_impact_geometry_on_penetration: Whether such bodies get the normal and ``depth`` of
            :func:`distance` at t = 0. The three names are those of parry's ``ShapeCastOptions``.
            The last two are for convex bodies.

    Returns:
        ``hit``, ``time_of_impact``, ``point`` and ``normal`` (world frame, from a to b); with a
        mesh also ``faces``. If two bodies overlap at t = 0, the time is 0, the normal is NaN and
        the point is in both bodies.

    Raises:
        ArgumentError: lengths that do not match, a motion that is not a ``Motion``, polygons, or a
            coordinate beyond 1e100, whose products would overflow (with a mesh: a coordinate of
            the bodies beyond 1e30).
    """
    for name, motion in (("motion_a", motion_a), ("motion_b", motion_b)):
        if not isinstance(motion, Motion):
            raise ArgumentError(f"{name}: a {type(motion).__name__}, expected a Motion")
        bounded(name, motion)
    target = _target(target_distance)
    special = compute_impact_geometry_on_penetration or not stop_at_penetration
    for name, side in (("a", a), ("b", b)):
        if isinstance(side, MeshTree) and special:
            raise ArgumentError(
                f"{name}: MeshTree, expected convex bodies with `stop_at_penetration=False` or "
                "`compute_impact_geometry_on_penetration=True`"
            )
    if isinstance(a, MeshTree) and isinstance(b, MeshTree):
        if target > 0:
            raise ArgumentError("target_distance: two meshes, expected convex bodies on one side")
        return first_touch(a, b, motion_a, motion_b, threads)
    found = _first_impact(a, b, motion_a, motion_b, threads, target)
    if not special:
        return found

    def query(x: Any, y: Any, motion_x: Motion, motion_y: Motion) -> Impacts:
        return _first_impact(x, y, motion_x, motion_y, threads, target)

    def measure(x: Any, y: Any, pose_x: Array, pose_y: Array) -> Distances:
        near: Distances = distance(x, y, threads, pose_a=pose_x, pose_b=pose_y)
        return near

    sides = (a, b, motion_a, motion_b)
    geometry = compute_impact_geometry_on_penetration
    return with_start(found, sides, query, measure, target, stop_at_penetration, geometry)


def _target(value: object) -> float:
    if not isinstance(value, int | float | np.number) or not 0 <= value < np.inf:
        raise ArgumentError(f"target_distance: {value!r:.40}, expected a length of 0 or more")
    return float(value)


def _first_impact(
    a: Solid | MeshTree, b: Solid | MeshTree, motion_a: Motion, motion_b: Motion, threads: int,
    target: float,
) -> Impacts:  # fmt: skip
    """The first time at which the bodies, one of which is convex, are within ``target``."""
    lengths = {"motion_a": len(motion_a), "motion_b": len(motion_b)}
    if beside := _mesh_beside(a, b, target=target):
        check_magnitude(a, b)
        mesh, bodies, count, swapped = beside
        if bodies.curved:
            side = "a" if swapped else "b"
            raise ArgumentError(
                f"{side}: {type(a if swapped else b).__name__}, expected bodies with vertices or "
                "radii against a moving mesh, such as Hulls of points on the surface"
            )
        of_mesh, of_bodies = (motion_b, motion_a) if swapped else (motion_a, motion_b)
        count = common_length({"bodies": count} | lengths)
        out, face = np.empty((count, 7)), np.empty(count, dtype=np.int32)
        mesh._mesh.time_of_impact_of_bodies(
            bodies, *of_mesh.packed, *of_bodies.packed, out, face, thread_count(threads)
        )
        normal = -out[:, 4:7] if swapped else out[:, 4:7]
        found = np.isfinite(out[:, 0]), out[:, 0], out[:, 1:4], normal
        return MeshImpacts(*found, _faces_of(face, swapped))
    count, first, second = native_pair(a, b, target=target)
    out = np.empty((common_length({"bodies": count} | lengths), 7))
    moved = (*motion_a.packed, *motion_b.packed)
    _rigid.time_of_impact(first, second, *moved, out, thread_count(threads))
    return Impacts(np.isfinite(out[:, 0]), out[:, 0], out[:, 1:4], out[:, 4:7])


def native_pair(
    a: Solid | MeshTree,
    b: Solid | MeshTree,
    pose_a: Poses = None,
    pose_b: Poses = None,
    target: float = 0.0,
) -> tuple[int, _rigid.Batch, _rigid.Batch]:
    """The number of rows, and the native forms of both sides, each grown by half of ``target``."""
    (core_a, radius_a), (core_b, radius_b) = (
        solid_parts(name, cast(Solid, solid)) for name, solid in (("a", a), ("b", b))
    )
    if isinstance(core_a, HalfSpaces) and isinstance(core_b, HalfSpaces):
        raise ArgumentError("a, b: two HalfSpaces always overlap unless they are parallel")
    count = row_count(core_a, core_b, pose_a, pose_b)
    if target > 0:
        radius_a, radius_b = radius_a + 0.5 * target, radius_b + 0.5 * target
    first, second = posed_pair(core_a, core_b, radius_a, radius_b, pose_a, pose_b)
    return count, first, second


def _mesh_beside(
    a: Solid | MeshTree,
    b: Solid | MeshTree,
    pose_a: Poses = None,
    pose_b: Poses = None,
    target: float = 0.0,
) -> tuple[MeshTree, _rigid.Batch, int, bool] | None:
    """The mesh, the bodies, their number, and whether the mesh is ``b``; ``None`` without a mesh.

    Raises:
        ArgumentError: both are meshes, the mesh has a pose, or a half-space.
    """
    if isinstance(a, MeshTree) and isinstance(b, MeshTree):
        raise ArgumentError(
            "a, b: both are meshes; expected at most one. MeshTree.overlap(other, pose) tests two "
            "meshes, distance(a, b, pose_b=...) measures them"
        )
    swapped = isinstance(b, MeshTree)
    mesh, solid = (b, a) if swapped else (a, b)
    if not isinstance(mesh, MeshTree):
        return None
    side, pose, of_mesh = ("a", pose_a, pose_b) if swapped else ("b", pose_b, pose_a)
    if of_mesh is not None:
        raise ArgumentError(
            f"pose_{'b' if swapped else 'a'}: {'b' if swapped else 'a'} is a MeshTree, whose frame "
            f"is the common one; give the bodies `pose_{side}=np.linalg.inv(pose_of_mesh) @ pose`"
        )
    core, radius = solid_parts(side, cast(Solid, solid), MOST_COORDINATE)
    if isinstance(core, HalfSpaces):
        raise ArgumentError(
            f"{side}: HalfSpaces, expected bounded bodies against a mesh; the heights of the "
            "vertices are vertices @ normal - offset"
        )
    count = row_count(core, core, pose, None)
    if target > 0:
        radius = radius + target
    return mesh, core.grown(radius, pose, pose is not None), count, swapped


def _faces_of(face: NDArray[np.int32], swapped: bool) -> NDArray[np.int32]:
    """Faces of a and of b; -1 for the side of the bodies. Shape (N, 2)."""
    none = np.full_like(face, -1)
    return np.stack([none, face] if swapped else [face, none], axis=1)
