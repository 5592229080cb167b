"""Broad phase: which of many bodies may be near each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.findings import ArgumentError
from tauguard.geometry import finite, thread_count
from tauguard.rigid import _rigid
from tauguard.rigid.curved import HalfSpaces
from tauguard.rigid.mesh import MeshTree
from tauguard.rigid.motion import Motion, bounded, poses
from tauguard.rigid.rounded import Solid, solid_parts
from tauguard.rigid.shapes import SHARP, Boxes

Array = NDArray[np.float64]
Bodies = Solid | MeshTree

#: Bound on rounding of a coordinate that a pose moves, relative to the largest coordinate.
ROUNDING = 2.0**-48


def near_pairs(
    bodies: Bodies | Sequence[Bodies],
    margin: float = 0.0,
    *,
    pose: ArrayLike | None = None,
    displacement: ArrayLike | None = None,
    motion: Motion | None = None,
    threads: int = 1,
) -> NDArray[np.int32]:
    """Pairs of bodies that may be at most ``margin`` apart; all other pairs are further apart.

    A pair is given if the boxes around both bodies, along the axes of the common frame, are at most
    ``margin`` apart on every axis. So a pair of bodies that are nearer than ``margin`` is never
    missed, also under rounding. A half-space is tested against the box of the other body; two
    half-spaces are no pair. The boxes are kept in a tree that is built along a space-filling curve
    (Lauterbach et al. 2009).

    Args:
        bodies: A batch of bodies, a mesh, or a list of batches and meshes. A mesh is one body. The
            bodies of a list are numbered through, in its order.
        margin: Distance up to which pairs are wanted, 0 or more [m].
        pose: One pose per body, or one for all, which moves bodies into the common frame. Shape
            (N, 4, 4) or (4, 4).
        displacement: Bodies move by this vector, without rotation, in the step. Pairs are those
            that may be near at any time of the step. Shape (N, 3), m.
        motion: Motions of the bodies, as in :func:`time_of_impact`, in place of ``pose`` and
            ``displacement``. One per body, or one for all.
        threads: 0 means all processors; the answer does not depend on it.

    Returns:
        Numbers of the bodies of each pair, smaller first, sorted. Shape (k, 2).

    Raises:
        ArgumentError: no batch of bodies, a margin that is negative or not finite, lengths that do
            not match, a pose that is no rigid motion (named with its row), ``motion`` together with
            ``pose`` or ``displacement``, or a rotating half-space.
    """
    batches = _batches(bodies)
    gap = np.asarray(margin)
    if gap.ndim or gap.dtype.kind not in "fiu" or not (np.isfinite(gap) and gap >= 0):
        raise ArgumentError(f"margin: {margin!r:.40}, expected a finite number of 0 or more [m]")
    count = sum(1 if isinstance(batch, MeshTree) else len(batch) for batch in batches)
    at, move, turn = _movement(count, pose, displacement, motion)
    boxes, planes, where = _boxes(batches, at, thread_count(threads))
    if move is not None:
        later = boxes + move[:, None]
        if turn is not None:
            later, bulge = _turned(batches, motion, boxes, planes, thread_count(threads))
            later[:, 0] -= bulge[:, None]
            later[:, 1] += bulge[:, None]
            boxes = boxes + bulge[:, None, None] * np.array([-1, 1])[:, None]
        boxes = np.stack(
            [np.minimum(boxes[:, 0], later[:, 0]), np.maximum(boxes[:, 1], later[:, 1])], axis=1
        )
        boxes = np.ascontiguousarray(_grown(boxes, 0))
        if len(planes):
            along = np.einsum("ij,ij->i", planes[:, :3], move[where])
            planes[:, 3] += np.maximum(along, 0)
    by = 0.5 * float(gap)
    if len(planes) == 0:
        return _rigid.overlapping_boxes(boxes, by, thread_count(threads))
    solid = np.ones(count, dtype=bool)
    solid[where] = False
    numbers = np.flatnonzero(solid).astype(np.int32)
    pairs = numbers[_rigid.overlapping_boxes(boxes[solid], by, thread_count(threads))]
    of_planes = _beside_planes(planes, where, _grown(boxes[solid], by), numbers, by)
    pairs = np.concatenate([pairs.reshape(-1, 2), of_planes])
    return np.ascontiguousarray(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))])


def _batches(bodies: Bodies | Sequence[Bodies]) -> list[Bodies]:
    """The batches, checked."""
    given = bodies if isinstance(bodies, list | tuple) else [bodies]
    for k, batch in enumerate(given):
        if not isinstance(batch, MeshTree):
            solid_parts(f"bodies[{k}]" if isinstance(bodies, list | tuple) else "bodies", batch)
    return list(given)


def _movement(
    count: int, pose: ArrayLike | None, displacement: ArrayLike | None, motion: Motion | None
) -> tuple[Array | None, Array | None, Array | None]:
    """Poses at the start (N, 4, 4), displacements (N, 3), and rotation vectors, if any."""
    if motion is not None:
        for name, value in (("pose", pose), ("displacement", displacement)):
            if value is not None:
                raise ArgumentError(f"{name}: not together with motion, which has it")
        if not isinstance(motion, Motion):
            raise ArgumentError(f"motion: a {type(motion).__name__}, expected a Motion")
        bounded("motion", motion)
        start = _rows("motion", motion.pose_t0, count)
        turn = _rows("motion", motion.angular, count)
        return start, _rows("motion", motion.linear, count), turn if turn.any() else None
    at = None if pose is None else _rows("pose", poses("pose", pose), count)
    move = None
    if displacement is not None:
        step = finite("displacement", np.atleast_2d(np.asarray(displacement)), (None, 3))
        move = _rows("displacement", step, count)
    return at, move, None


def _rows(name: str, value: Array, count: int) -> Array:
    if len(value) not in (1, count):
        raise ArgumentError(f"{name}: {len(value)} rows, expected one for each of {count} bodies")
    return np.ascontiguousarray(np.broadcast_to(value, (count, *value.shape[1:])))


def _boxes(
    batches: list[Bodies], at: Array | None, threads: int
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Boxes (N, 2, 3) of all bodies, planes (P, 4) of half-spaces, and the numbers of these."""
    boxes: list[Array] = [] if batches else [np.zeros((0, 2, 3))]
    planes: list[Array] = []
    where: list[NDArray[np.intp]] = []
    first = 0
    for batch in batches:
        count = 1 if isinstance(batch, MeshTree) else len(batch)
        place = None if at is None else at[first : first + count]
        out = np.full((count, 2, 3), [[-np.inf], [np.inf]])
        if isinstance(batch, MeshTree):
            middle, half = 0.5 * (batch.low + batch.high), 0.5 * (batch.high - batch.low)
            if place is None:
                out[0] = batch.low, batch.high
            else:
                around = Boxes([middle], [half])
                _rigid.bounds(around.grown(SHARP, place, True), out, threads)
        else:
            core, radius = solid_parts("bodies", batch)
            if isinstance(core, HalfSpaces):
                planes.append(_placed_planes(core.packed, place))
                where.append(np.arange(first, first + count, dtype=np.intp))
            elif count:
                _rigid.bounds(core.grown(radius, place, place is not None), out, threads)
        boxes.append(out)
        first += count
    return (
        np.concatenate(boxes) if len(boxes) != 1 else boxes[0],
        np.concatenate(planes) if planes else np.zeros((0, 4)),
        np.concatenate(where) if where else np.zeros(0, dtype=np.intp),
    )


def _placed_planes(packed: Array, at: Array | None) -> Array:
    if at is None:
        return packed.copy()
    normal = np.einsum("nij,nj->ni", at[:, :3, :3], packed[:, :3])
    offset = packed[:, 3] + np.einsum("ni,ni->n", normal, at[:, :3, 3])
    return np.column_stack([normal, offset])


def _turned(
    batches: list[Bodies], motion: Motion | None, start: Array, planes: Array, threads: int
) -> tuple[Array, Array]:
    """Boxes at the end of a motion with rotation, and how far paths leave their chords.

    A point at the distance r from the frame's origin has an acceleration of at most w^2 r, so its
    path is within w^2 r / 8 of the chord, and within 2 r of it at any rate.
    """
    assert motion is not None
    if len(planes):
        raise ArgumentError("motion: a half-space cannot rotate; leave its angular velocity 0")
    end = np.ascontiguousarray(np.broadcast_to(motion.at(1.0), (len(start), 4, 4)))
    later, _, _ = _boxes(batches, end, threads)
    own, _, _ = _boxes(batches, None, threads)
    reach = np.linalg.norm(np.abs(own).max(axis=1), axis=1)
    rate = np.linalg.norm(motion.angular, axis=1)
    return later, np.minimum(rate**2 / 8, 2.0) * reach * (1 + ROUNDING)


def _grown(boxes: Array, by: float) -> Array:
    """Boxes that are larger by ``by`` on each side, and by rounding."""
    size = np.abs(np.where(np.isfinite(boxes), boxes, 0)).max(axis=(1, 2), initial=0)
    slack = (by + ROUNDING * (size + by))[:, None]
    return np.stack([boxes[:, 0] - slack, boxes[:, 1] + slack], axis=1)


def _beside_planes(
    planes: Array, where: NDArray[np.intp], boxes: Array, numbers: NDArray[np.int32], by: float
) -> NDArray[np.int32]:
    """Pairs of a half-space and a box whose lowest corner is at most ``by`` above the plane."""
    found = [np.zeros((0, 2), dtype=np.int32)]
    middle, half = boxes.mean(axis=1), 0.5 * (boxes[:, 1] - boxes[:, 0])
    size = np.abs(boxes).max(axis=(1, 2), initial=0)
    for plane, number in zip(planes, where, strict=True):
        lowest = middle @ plane[:3] - half @ np.abs(plane[:3])
        slack = by + 16 * ROUNDING * (size + abs(plane[3]) + by)
        other = numbers[lowest <= plane[3] + slack]
        ends = np.stack([np.full_like(other, number), other], axis=1)
        found.append(np.sort(ends, axis=1))
    return np.concatenate(found)
