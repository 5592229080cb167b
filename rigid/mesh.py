"""Rigid triangle meshes: pairs of triangles that intersect, and their contacts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.arrays import in_a_line
from tauguard.findings import ArgumentError
from tauguard.geometry import finite, frozen, frozen_finite, frozen_indices, thread_count
from tauguard.rigid import _rigid
from tauguard.rigid.closed import check_closed, first_of_parts, merged_corners
from tauguard.rigid.motion import Motion, bounded, common_length, poses
from tauguard.rigid.rays import PointDistances, RayHits, unit_vectors
from tauguard.rigid.results import MeshImpacts

Volume = Literal["obb", "aabb"]
#: Winding number that the native module gives for points on the surface.
ON_SURFACE = 1 << 30


@dataclass(frozen=True, eq=False)
class MeshOverlap:
    """Overlap of two meshes, or of a mesh and convex bodies, one row per pose or body.

    Attributes:
        hit: True if the two share a point (touching is a hit). Shape (N,).
        faces: One intersecting pair, (face of this mesh, face of the other). Without a hit, and on
            the side of a convex body, the entry is -1. Shape (N, 2).
    """

    hit: NDArray[np.bool_]
    faces: NDArray[np.int32]

    __repr__ = in_a_line


@dataclass(frozen=True, eq=False)
class MeshContacts:
    """Every intersecting pair of faces, sorted by pose, face and other face.

    Attributes:
        pose: The row of the pose. Shape (M,).
        faces: Face of this mesh and face of the other. Shape (M, 2).
        point: A point of both triangles, in general position the middle of their intersection, in
            this mesh's frame. Shape (M, 3).
        normal: Direction of the shortest translation of the other mesh's triangle that separates
            the two triangles. Unit vector. Shape (M, 3).
        penetration: Length of this translation; 0 if the triangles just touch. Shape (M,), m.
    """

    pose: NDArray[np.int32]
    faces: NDArray[np.int32]
    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    penetration: NDArray[np.float64]

    __repr__ = in_a_line

    def __len__(self) -> int:
        return len(self.pose)


class MeshTree:
    """A bounding-volume tree over the triangles of one rigid mesh.

    Nodes have eight children, divided by the surface-area heuristic. The children's volumes are
    stored in single precision and tested eight at a time. The volume never changes an answer:

    * ``obb``, the default: oriented boxes along the principal axes of each child's surface
      (Gottschalk, Lin and Manocha 1996). Their queries are the fastest on all meshes that
      ``tauguard bench rigid`` measures.
    * ``aabb``: boxes along the axes of the mesh's frame. Such a tree is built in two thirds of the
      time, which pays off if the tree is used for at most a few thousand poses.

    Exactness: a pose places a vertex ``y`` of the other mesh at ``R y + t``, evaluated in
    double precision and rounded. Whether two triangles with these corners share a point is decided
    exactly, also for degenerate triangles.

    Args:
        vertices: Shape (V, 3), m.
        faces: Shape (F, 3), rows of ``vertices``, at least one. Degenerate triangles are legal.
        volume: ``"obb"`` or ``"aabb"``.

    Raises:
        ArgumentError: wrong shapes, an entry that is not finite, an index out of range, no faces,
            or an unknown volume.
    """

    volumes: tuple[str, ...] = get_args(Volume)

    def __init__(self, vertices: ArrayLike, faces: ArrayLike, volume: str = "obb") -> None:
        """Build the tree; see the class for the arguments."""
        points = frozen_finite("vertices", vertices, (None, 3))
        triangles = frozen_indices("faces", faces, (None, 3), len(points))
        if len(triangles) == 0:
            raise ArgumentError("faces: empty; a mesh needs at least one triangle")
        if len(triangles) > 2**28 - 1:
            raise ArgumentError(f"faces: {len(triangles)} rows, at most {2**28 - 1} fit")
        if np.abs(points).max() > 1e30:
            raise ArgumentError("vertices: a coordinate beyond 1e30; scale the mesh down")
        if volume not in self.volumes:
            raise ArgumentError(f"volume: {volume!r}, expected one of {', '.join(self.volumes)}")
        self._vertices, self._faces, self._volume = points, triangles, volume
        self._mesh = _rigid.Mesh(points, triangles, volume)

    @property
    def vertices(self) -> NDArray[np.float64]:
        """The tree's own copy, read-only. Shape (V, 3), m."""
        return self._vertices

    @property
    def faces(self) -> NDArray[np.int32]:
        """The tree's own copy, read-only. Shape (F, 3)."""
        return self._faces

    @property
    def volume(self) -> str:
        """The bounding volume of the nodes."""
        return self._volume

    def __reduce__(self) -> tuple[type[MeshTree], tuple[Any, ...]]:
        """``copy`` and ``pickle`` build the tree again."""
        return type(self), (self._vertices, self._faces, self._volume)

    def __len__(self) -> int:
        return len(self.faces)

    def __repr__(self) -> str:
        counts = f"{len(self.vertices)} vertices, {len(self)} faces"
        return f"{type(self).__name__}({counts}, volume={self.volume!r})"

    def overlap(self, other: MeshTree, pose: ArrayLike, threads: int = 1) -> MeshOverlap:
        """Whether the surfaces intersect, with the other mesh at ``pose`` in this mesh's frame.

        The search ends at the first intersecting pair of triangles.

        Args:
            other: A mesh whose tree has the same volume.
            pose: Shape (N, 4, 4), or (4, 4) for a batch of one.
            threads: 0 means all processors; the answer does not depend on it.

        Raises:
            ArgumentError: another volume, or a bad pose (named with its row).
        """
        checked_pair(self, other)
        batch = poses("pose", pose)
        faces = np.empty((len(batch), 2), dtype=np.int32)
        self._mesh.overlap(other._mesh, batch, faces, thread_count(threads))
        return MeshOverlap(faces[:, 0] >= 0, faces)

    def contacts(
        self, other: MeshTree, pose: ArrayLike, threads: int = 1, limit: int = 10_000_000
    ) -> MeshContacts:
        """All intersecting pairs of triangles, with points, normals and penetrations.

        Up to rounding the contacts are symmetric: exchanging the meshes and inverting the pose
        only reverses the normals.

        Args:
            other: As for :meth:`overlap`.
            pose: As for :meth:`overlap`.
            threads: 0 means all processors; the answer does not depend on it.
            limit: Largest number of pairs over all poses; coincident meshes can exceed it.

        Raises:
            ArgumentError: as for :meth:`overlap`, a bad limit, or more pairs than ``limit``.
        """
        checked_pair(self, other)
        most, batch = _checked_limit(limit), poses("pose", pose)
        return _contacts_of(*self._mesh.contacts(other._mesh, batch, most, thread_count(threads)))

    @cached_property
    def _corners(self) -> NDArray[np.int32]:
        """Corners of the faces; those at the same position have the same number. Shape (F, 3)."""
        return frozen(merged_corners(self._vertices, self._faces))

    @cached_property
    def _open_because(self) -> str:
        """Why the mesh is not closed; empty if it is."""
        try:
            check_closed(self._vertices[self._faces], self._corners)
        except ArgumentError as error:
            return str(error)
        return ""

    @cached_property
    def used_corners(self) -> NDArray[np.float64]:
        """The corners of faces, each position once. Shape (C, 3)."""
        rows = np.unique(self._corners, return_index=True)[1]
        return frozen(self._vertices[self._faces.ravel()[rows]])

    @cached_property
    def part_corners(self) -> NDArray[np.float64]:
        """A corner of each part: of faces that are connected by corners. Shape (P, 3)."""
        return frozen(self._vertices[self._faces[first_of_parts(self._corners), 0]])

    @cached_property
    def low(self) -> NDArray[np.float64]:
        """The smallest coordinates of corners of faces. Shape (3,)."""
        return frozen(self.used_corners.min(axis=0))

    @cached_property
    def high(self) -> NDArray[np.float64]:
        """The largest coordinates of corners of faces. Shape (3,)."""
        return frozen(self.used_corners.max(axis=0))

    @property
    def closed(self) -> bool:
        """Whether the faces are a closed surface whose normals point outward.

        Each edge must belong to as many faces in one direction as in the other. Corners at the same
        position count as one, so a mesh of separate triangles (STL) can be closed.
        """
        return not self._open_because

    def contains(self, points: ArrayLike, threads: int = 1) -> NDArray[np.bool_]:
        """Whether points are inside of this closed mesh; points on the surface are. Shape (N,).

        The answer is exact for the given numbers. It is the sign of the winding number, which
        counts the faces above a point (Jacobson, Kavan and Sorkine-Hornung 2013 review such
        numbers). Parts may lie in each other or intersect: a point is inside if it is in some part.

        Args:
            points: In this mesh's frame. Shape (N, 3).
            threads: 0 means all processors; the answer does not depend on it.

        Raises:
            ArgumentError: the mesh is open or has inverted faces (the message names them), wrong
                shapes, an entry that is not finite or beyond 1e100.
        """
        inside = self._windings(self._checked_points(points), threads) > 0
        return np.asarray(inside)

    def _checked_points(self, points: ArrayLike) -> NDArray[np.float64]:
        """Points for a query that needs a closed mesh."""
        check_magnitude(self)
        if self._open_because:
            raise ArgumentError(self._open_because)
        batch = finite("points", points, (None, 3))
        far = np.abs(batch).max(axis=1, initial=0) > 1e100
        if far.any():
            row = int(np.argmax(far))
            raise ArgumentError(f"points: {batch[row]} in row {row}, expected coordinates to 1e100")
        return batch

    def _windings(self, points: NDArray[np.float64], threads: int) -> NDArray[np.int32]:
        out = np.empty(len(points), dtype=np.int32)
        self._mesh.windings(points, out, thread_count(threads))
        return out

    def signed_distance(self, points: ArrayLike, threads: int = 1) -> PointDistances:
        """Distances of points from the surface of this closed mesh, negative inside.

        The sign is exact for the given numbers, as in :meth:`contains`. The error of the distance
        is at most 1e-12 times the largest coordinate of the nearest face relative to the point.

        Args:
            points: In this mesh's frame. Shape (N, 3).
            threads: 0 means all processors; the answer does not depend on it.

        Raises:
            ArgumentError: as :meth:`contains`. For an open mesh use
                ``tauguard.rigid.distance(tree, Spheres(points, 0))``.
        """
        batch = self._checked_points(points)
        out, face = np.empty((len(batch), 4)), np.empty(len(batch), dtype=np.int32)
        self._mesh.nearest(batch, out, face, thread_count(threads))
        turns = self._windings(batch, threads)
        on_surface = turns == ON_SURFACE
        length = np.maximum(out[:, 0], np.where(on_surface, 0, np.finfo(float).smallest_subnormal))
        distance = np.where(on_surface, 0.0, np.where(turns > 0, -length, length))
        return PointDistances(distance, out[:, 1:], face)

    def cast(self, origins: ArrayLike, directions: ArrayLike, threads: int = 1) -> RayHits:
        """The first face that each ray meets.

        Which faces a ray meets is decided exactly. Edges and corners belong to the faces, so that
        no ray passes between two faces. A ray within the plane of a face passes this face. A ray
        that starts on a face hits it at distance 0.

        Args:
            origins: In this mesh's frame. Shape (N, 3), or (3,) for all rays.
            directions: Of any length but 0. Shape (N, 3), or (3,) for all rays.
            threads: 0 means all processors; the answer does not depend on it.

        Raises:
            ArgumentError: wrong shapes or lengths, an entry that is not finite, a direction of
                length 0, or an origin beyond 1e100 (named with its row).
        """
        check_magnitude(self)
        rays = [
            finite(name, np.atleast_2d(np.asarray(value)), (None, 3))
            for name, value in (("origins", origins), ("directions", directions))
        ]
        count = common_length({"origins": len(rays[0]), "directions": len(rays[1])})
        for name, bad, wanted in (
            ("origins", np.abs(rays[0]).max(axis=1, initial=0) > 1e100, "coordinates up to 1e100"),
            ("directions", ~rays[1].any(axis=1), "a direction of any length but 0"),
        ):
            if bad.any():
                row = int(np.argmax(bad))
                value = rays[name == "directions"][row]
                raise ArgumentError(f"{name}: {value} in row {row}, expected {wanted}")
        distance, face = np.empty(count), np.empty(count, dtype=np.int32)
        self._mesh.cast(rays[0], rays[1], distance, face, thread_count(threads))
        hit = face >= 0
        normal = np.where(hit[:, None], self.normals[face], np.nan)
        return RayHits(hit, distance, face, normal)

    @cached_property
    def normals(self) -> NDArray[np.float64]:
        """Unit normals of the faces; 0 for a face without area. Shape (F, 3)."""
        a, b, c = np.moveaxis(self._vertices[self._faces], 1, 0)
        normal = np.cross(unit_vectors(b - a), unit_vectors(c - a))
        return frozen(unit_vectors(normal))

    def self_contacts(self, limit: int = 10_000_000) -> MeshContacts:
        """Pairs of faces of this mesh that intersect: self-intersection at rest.

        Faces that share a corner or an edge count only if they meet elsewhere too. This is decided
        exactly. Corners at the same position count as one.

        Args:
            limit: Largest number of pairs.

        Returns:
            Contacts as of :meth:`contacts`; the face of smaller number is first, ``pose`` is 0.

        Raises:
            ArgumentError: a bad limit.
            ValueError: more pairs than ``limit``.
        """
        return _contacts_of(*self._mesh.self_contacts(self._corners, _checked_limit(limit)))

    def time_of_impact(self, other: MeshTree, motion: Motion, threads: int = 1) -> MeshImpacts:
        """The first contact with the other mesh, which has ``motion`` in this mesh's frame.

        This mesh is at rest; see :func:`tauguard.rigid.time_of_impact`.
        """
        bounded("motion", motion)
        rest = Motion(np.eye(4), np.zeros(3), np.zeros(3))
        return first_touch(self, other, rest, motion, threads)

    def sweep(
        self, other: MeshTree, pose: ArrayLike, displacement: ArrayLike, threads: int = 1
    ) -> MeshImpacts:
        """The first contact with the other mesh, which moves from ``pose`` without rotation.

        Args:
            other: Any mesh.
            pose: Pose at t = 0. Shape (N, 4, 4) or (4, 4).
            displacement: Displacement over the step t in [0, 1]. Shape (N, 3) or (3,), m.
            threads: 0 means all processors; the answer does not depend on it.

        Raises:
            ArgumentError: a bad pose or displacement (named with its row), lengths that do not
                match.
        """
        start, move = poses("pose", pose), np.asarray(displacement)
        if move.ndim == 2 and len(start) == 1:
            start = np.repeat(start, len(move), axis=0)
        if move.shape not in ((3,), (len(start), 3)):
            raise ArgumentError(
                f"displacement: shape {move.shape}, expected ({len(start)}, 3) or (3,)"
            )
        finite("displacement", np.atleast_2d(move), (None, 3))
        return self.time_of_impact(other, Motion(start, move, np.zeros(3)), threads)


def check_magnitude(*sides: object) -> None:
    """Raise an ``ArgumentError`` for a mesh whose squared lengths lose their digits."""
    for mesh in sides:
        if isinstance(mesh, MeshTree) and 0 < np.abs(mesh._vertices).max() < 1e-40:
            raise ArgumentError(
                "all coordinates of a mesh are below 1e-40; scale the scene up for distances, rays "
                "and motions"
            )


def checked_pair(tree: MeshTree, other: MeshTree) -> None:
    """Raise an ``ArgumentError`` if ``other`` is no mesh, or has another kind of volume."""
    if not isinstance(other, MeshTree):
        raise ArgumentError(
            f"other: {type(other).__name__}, expected a MeshTree; for convex bodies use "
            "tauguard.rigid.overlap or distance"
        )
    if other.volume != tree.volume:
        raise ArgumentError(
            f"other: its volume is {other.volume!r}, this tree's {tree.volume!r}; "
            "build both with the same volume"
        )


def _checked_limit(limit: int) -> int:
    if isinstance(limit, bool) or not isinstance(limit, int) or not 0 < limit < 2**62:
        raise ArgumentError(f"limit: {limit!r:.40}, expected a positive integer")
    return limit


def _contacts_of(rows: NDArray[np.int32], values: NDArray[np.float64]) -> MeshContacts:
    return MeshContacts(
        np.ascontiguousarray(rows[:, 0]),
        np.ascontiguousarray(rows[:, 1:]),
        np.ascontiguousarray(values[:, :3]),
        np.ascontiguousarray(values[:, 3:6]),
        np.ascontiguousarray(values[:, 6]),
    )


def first_touch(
    a: MeshTree, b: MeshTree, motion_a: Motion, motion_b: Motion, threads: int
) -> MeshImpacts:
    """The first contact of two moving meshes, whose volumes may differ."""
    check_magnitude(a, b)
    count = common_length({"motion_a": len(motion_a), "motion_b": len(motion_b)})
    out, faces = np.empty((count, 7)), np.empty((count, 2), dtype=np.int32)
    moved = (*motion_a.packed, *motion_b.packed)
    a._mesh.time_of_impact(b._mesh, *moved, out, faces, thread_count(threads))
    return MeshImpacts(np.isfinite(out[:, 0]), out[:, 0], out[:, 1:4], out[:, 4:7], faces)
