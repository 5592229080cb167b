"""Overlap, also in successive frames, and sweeps of convex bodies without radii, row by row.

* ``abfme`` eliminates the unknowns of a separating plane by Fourier-Motzkin elimination. Facet
  functions are scaled by determinants, so nothing is divided; redundant combinations are left out.
* ``sat`` tests separating axes (Gottschalk et al. 1996; Ericson 2005, 5.2).

Both run in floating point with derived error bounds. Exact arithmetic decides the remaining rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Sized
from contextlib import contextmanager
from threading import Lock
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.arrays import Array
from tauguard.findings import ArgumentError
from tauguard.geometry import frozen_finite, thread_count
from tauguard.rigid import _rigid
from tauguard.rigid.motion import PoseLike, common_length, optional_poses
from tauguard.rigid.results import Impacts, Overlap, Witness
from tauguard.rigid.rounded import no_body
from tauguard.rigid.shapes import (
    SHARP,
    Bodies,
    Boxes,
    Core,
    Hulls,
    Parallelepipeds,
    Polygons,
    Shape,
    Tetrahedra,
)

SweepMethod = Literal["abfme", "sat", "auto"]
#: Checked poses (N, 4, 4), or none.
Poses = NDArray[np.float64] | None

#: Number of a method in the native module; ``exact`` is for studies and tests.
_METHODS = {"abfme": 0, "sat": 1, "auto": 2, "exact": 4}
_KINDS = (Tetrahedra, Boxes, Parallelepipeds, Hulls, Polygons)


def check_method(method: object, known: Sequence[str]) -> None:
    """Raise an ``ArgumentError`` if ``method``, which may be of any type, is not in ``known``."""
    if not (isinstance(method, str) and method in known):
        given = repr(method) if isinstance(method, str) else f"a {type(method).__name__}"
        raise ArgumentError(f"method: {given}, expected one of {', '.join(known)}")


def sharp_overlap(
    a: Bodies, b: Bodies, method: str, threads: int, pose_a: Poses = None, pose_b: Poses = None
) -> Overlap:
    """Whether bodies without radii share a point; arguments as in the public ``overlap``."""
    if pose_a is None and pose_b is None:
        hit = native_overlap(a, b, method, threads)[0]
    else:
        if method == "sat":
            refuse_hulls(a, b)
        out = np.empty(rows(a, b, pose_a, pose_b), dtype=np.uint8)
        first, second = posed_pair(a, b, SHARP, SHARP, pose_a, pose_b)
        _rigid.overlap_posed(first, second, _METHODS[method], thread_count(threads), out)
        hit = out.view(np.bool_)
    return Overlap(hit, lambda: find_witness(a, b, hit, threads, pose_a, pose_b))


def native_overlap(
    a: Bodies, b: Bodies, method: str, threads: int = 1
) -> tuple[NDArray[np.bool_], int]:
    """``hit`` of shape (N,), and the number of rows that exact arithmetic decided."""
    if method == "sat":
        refuse_hulls(a, b)
    hit = np.empty(rows(a, b), dtype=np.uint8)
    if method == "auto" and isinstance(a, Boxes) and isinstance(b, Boxes):
        return hit.view(np.bool_), overlap_boxes(a, b, thread_count(threads), hit)
    left = _rigid.overlap(a.native, b.native, _METHODS[method], thread_count(threads), hit)
    return hit.view(np.bool_), left


def refuse_hulls(a: Bodies, b: Bodies) -> None:
    """Raise an ``ArgumentError`` for hulls and polygons, whose facets are not known."""
    if isinstance(a, Hulls | Polygons) or isinstance(b, Hulls):
        raise ArgumentError("method: sat needs facets, which hulls do not have; use abfme or auto")


def overlap_boxes(a: Boxes, b: Boxes, threads: int, hit: NDArray[np.uint8]) -> int:
    """Write the overlap of boxes to ``hit``; returns how many rows exact arithmetic decided."""
    skew = max(a.skew, b.skew)
    return _rigid.overlap_boxes(a.native, a.blocks, b.native, b.blocks, skew, threads, hit)


def sweep(
    a: Bodies,
    b: Bodies,
    displacement: ArrayLike,
    method: SweepMethod = "auto",
    threads: int = 1,
    *,
    pose_a: PoseLike = None,
    pose_b: PoseLike = None,
) -> Impacts:
    """The first contact of ``b[i]``, which moves by ``t * displacement[i]``, with ``a[i]``.

    For two meshes use :meth:`MeshTree.sweep`. For bodies that rotate, with radii, or curved, use
    :func:`time_of_impact`.

    Args:
        a: N bodies of one kind at rest, or one.
        b: N bodies, or one.
        displacement: Displacement over the step t in [0, 1]. Shape (N, 3) or (3,).
        method: ``abfme`` decides ``hit`` by eliminating the separating plane, with t as a further
            unknown, and computes times on separating axes for hits only. ``sat`` uses separating
            axes for both. ``auto`` is the faster of the two. With each method, ``hit`` is exact
            and ``time_of_impact`` is never late.
        threads: 0 means all processors; the answer does not depend on it.
        pose_a: Poses of the bodies ``a``, as for :func:`tauguard.rigid.distance`.
        pose_b: Poses of the bodies ``b`` at t = 0.

    Returns:
        ``hit``, ``time_of_impact``, ``point`` and ``normal`` (from a to b; NaN where they overlap
        at t = 0).

    Raises:
        ArgumentError: lengths or shapes that do not match, an entry that is not finite, an unknown
            method.
    """
    at_a, at_b = optional_poses("pose_a", pose_a), optional_poses("pose_b", pose_b)
    given = np.asarray(displacement)
    most = len(given) if given.ndim == 2 else 1
    count = rows(a, b, at_a, at_b, most)
    if isinstance(a, Polygons):
        raise ArgumentError("a: Polygons, expected bodies in space; give them thickness as Hulls")
    check_method(method, get_args(SweepMethod))
    moves = frozen_finite("displacement", given[None] if given.ndim == 1 else given, (None, 3))
    if len(moves) not in (1, count):
        raise ArgumentError(f"displacement: {len(moves)} rows, expected {count} or 1")
    if at_a is None and at_b is None and max(len(a), len(b)) == count:
        hit, out, _ = native_sweep(a, b, moves, method, threads)
    else:
        hit, out = _posed_sweep(a, b, moves, method, threads, at_a, at_b, count)
    return Impacts(hit, out[:, 0], out[:, 1:4], out[:, 4:7])


def _posed_sweep(
    a: Bodies, b: Bodies, displacement: NDArray[np.float64], method: str, threads: int,
    pose_a: Poses, pose_b: Poses, count: int,
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:  # fmt: skip
    moves = np.ascontiguousarray(np.broadcast_to(displacement, (count, 3)))
    hit, out = np.empty(count, dtype=np.uint8), np.empty((count, 7))
    first, second = posed_pair(a, b, SHARP, SHARP, pose_a, pose_b)
    workers = thread_count(threads)
    _rigid.sweep_posed(first, second, moves, _METHODS[method], workers, hit, out)
    return hit.view(np.bool_), out


def native_sweep(
    a: Bodies,
    b: Bodies,
    displacement: NDArray[np.float64],
    method: str,
    threads: int = 1,
    points: bool = True,
) -> tuple[NDArray[np.bool_], NDArray[np.float64], int]:
    """``hit`` (N,); time of impact, point and normal (N, 7); number of exactly decided rows."""
    count = rows(a, b)
    moves = np.ascontiguousarray(np.broadcast_to(displacement, (count, 3)))
    hit, out = np.empty(count, dtype=np.uint8), np.empty((count, 7))
    left = _rigid.sweep(
        a.native, b.native, moves, _METHODS[method], thread_count(threads), points, hit, out
    )
    return hit.view(np.bool_), out, left


@contextmanager
def portable() -> Iterator[None]:
    """Context that disables vector instructions in all threads, for studies and tests."""
    _rigid.allow_vectors(False)
    try:
        yield
    finally:
        _rigid.allow_vectors(True)


def find_witness(
    a: Bodies,
    b: Bodies,
    hit: NDArray[np.bool_],
    threads: int = 1,
    pose_a: Poses = None,
    pose_b: Poses = None,
) -> Witness:
    """A common point or a separating plane of each row, up to rounding."""
    out = np.empty((len(hit), 7))
    first, second = posed_pair(a, b, SHARP, SHARP, pose_a, pose_b)
    _rigid.witnesses(first, second, thread_count(threads), hit.view(np.uint8), out)
    return Witness(out[:, :3], out[:, 3:6], out[:, 6])


def rows(a: Bodies, b: Bodies, pose_a: Poses = None, pose_b: Poses = None, others: int = 1) -> int:
    """The common number of rows of two batches and their poses; one body or pose fits any number.

    Raises:
        ArgumentError: not batches of polytopes or of polygons, or lengths that do not match.
    """
    for name, bodies in (("a", a), ("b", b)):
        if type(bodies) not in _KINDS:
            raise ArgumentError(f"{name}: {_no_polytopes(bodies)}")
    if isinstance(a, Polygons) != isinstance(b, Polygons):
        raise ArgumentError("b: polygons are tested against polygons only; both must be Polygons")
    for name, pose in (("pose_a", pose_a), ("pose_b", pose_b)):
        if pose is not None and isinstance(a, Polygons):
            raise ArgumentError(f"{name}: Polygons are in the plane and take no poses; use Hulls")
    return row_count(a, b, pose_a, pose_b, others)


def row_count(a: Sized, b: Sized, pose_a: Poses, pose_b: Poses, others: int = 1) -> int:
    """As :func:`rows`, without the test of the kinds."""
    if len(a) != len(b) and 1 not in (len(a), len(b)):
        raise ArgumentError(f"b: {len(b)} bodies against {len(a)}; expected the same number, or 1")
    count = max(len(a), len(b)) if len(a) and len(b) else 0
    if pose_a is None and pose_b is None and others == 1:
        return count
    lengths = {"pose_a": pose_a, "pose_b": pose_b}
    given = {name: len(poses) for name, poses in lengths.items() if poses is not None}
    return common_length({"a, b": count} | given | {"displacement": others})


def posed_pair(
    a: Core, b: Core, radius_a: Array, radius_b: Array, pose_a: Poses, pose_b: Poses
) -> tuple[_rigid.Batch, _rigid.Batch]:
    """The native forms of both sides."""
    moving = pose_a is not None or pose_b is not None
    return a.grown(radius_a, pose_a, moving), b.grown(radius_b, pose_b, moving)


def _no_polytopes(bodies: object) -> str:
    if isinstance(bodies, Polygons):
        return no_body(bodies)
    if isinstance(bodies, Shape):
        return (
            f"{type(bodies).__name__}, expected Tetrahedra, Boxes, Parallelepipeds, Hulls or "
            "Polygons; use overlap, distance, or time_of_impact with a Motion of angular = 0"
        )
    if type(bodies).__name__ == "MeshTree":
        return (
            "MeshTree, expected convex bodies; use MeshTree.sweep for two meshes, and "
            "time_of_impact with a Motion of angular = 0 for a mesh and convex bodies"
        )
    return no_body(bodies)


class PlaneCache:
    """Overlap queries on the same pairs frame after frame.

    The cache keeps the normal of a separating plane for each pair that was apart. While this normal
    separates the bodies, nothing else is computed. The result always equals that of
    :func:`tauguard.rigid.overlap`. Calls from several threads wait for each other.

    Args:
        count: The number of pairs N, the same in every frame.

    Raises:
        ArgumentError: ``count`` is not an integer of 0 or more.
    """

    def __init__(self, count: int) -> None:
        """Start without planes; see the class."""
        if not isinstance(count, int | np.integer) or isinstance(count, bool) or count < 0:
            raise ArgumentError(f"count: {count!r:.40}, expected an integer of 0 or more")
        self._lock = Lock()
        self._normals: NDArray[np.float64] = np.zeros((count, 3))
        #: Number of pairs of the last frame that were decided by their cached plane.
        self.answered = 0

    def overlap(self, a: Bodies, b: Bodies, threads: int = 1) -> Overlap:
        """Overlap in one frame; the separating planes are kept. Arguments as for ``overlap``.

        Raises:
            ArgumentError: the number of pairs is not ``count``, or an error of ``overlap``.
        """
        count = rows(a, b)
        if count != len(self._normals):
            raise ArgumentError(f"a, b: {count} pairs, expected {len(self._normals)}")
        hit = np.empty(count, dtype=np.uint8)
        with self._lock:
            self.answered = _rigid.overlap_cached(
                a.native, b.native, thread_count(threads), self._normals, hit
            )
        found = hit.view(np.bool_)
        return Overlap(found, lambda: find_witness(a, b, found, threads))
