"""Signed distance of two meshes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.arrays import in_a_line
from tauguard.findings import ArgumentError
from tauguard.geometry import thread_count
from tauguard.rigid.mesh import MeshContacts, MeshTree, check_magnitude, checked_pair
from tauguard.rigid.motion import common_length, poses
from tauguard.rigid.results import Distances

Array = NDArray[np.float64]
#: Largest coordinate of a mesh in the frame of the other; boxes have single precision.
MOST_COORDINATE = 1e30


@dataclass(frozen=True, eq=False)
class MeshPairDistances(Distances):
    """Distance of two meshes, one row per pose.

    If both meshes are closed and overlap, the distance is negative: minus the depth of the deepest
    point, over the corners of each mesh in the other one, and where no corner is inside over points
    behind faces that intersect. Every translation that separates the meshes is at least as long. If
    a mesh is open, meshes whose surfaces intersect have the distance 0.

    Attributes:
        faces: The nearest faces (of a, of b); of overlapping meshes, two faces that intersect, or
            -1 where one mesh is in the other. Shape (N, 2).
    """

    faces: NDArray[np.int32]

    __repr__ = in_a_line


def mesh_distance(
    a: MeshTree,
    b: MeshTree,
    pose_a: ArrayLike | None = None,
    pose_b: ArrayLike | None = None,
    threads: int = 1,
) -> MeshPairDistances:
    """Distance, nearest points, normal and faces of two meshes; see :func:`distance`.

    Raises:
        ArgumentError: trees of different volumes, a bad pose, or meshes more than 1e30 apart
            (named with the row).
    """
    checked_pair(a, b)
    check_magnitude(a, b)
    at_a = poses("pose_a", np.eye(4) if pose_a is None else pose_a)
    at_b = poses("pose_b", np.eye(4) if pose_b is None else pose_b)
    count = common_length({"pose_a": len(at_a), "pose_b": len(at_b)})
    relative = at_b if pose_a is None else _inverse(at_a) @ at_b
    relative = np.ascontiguousarray(np.broadcast_to(relative, (count, 4, 4)))
    far = np.abs(relative[:, :3, 3]).max(axis=1, initial=0) > MOST_COORDINATE
    if far.any():
        raise ArgumentError(
            f"pose_a, pose_b: the meshes are more than 1e30 apart in row {int(np.argmax(far))}; "
            "scale the scene down"
        )
    out, faces = np.empty((count, 10)), np.empty((count, 2), dtype=np.int32)
    a._mesh.distance(b._mesh, relative, out, faces, thread_count(threads))
    if a.closed and b.closed:
        for row in np.flatnonzero(_may_overlap(a, b, relative, out[:, 0] == 0, threads)):
            _sign(a, b, relative[row], out[row], faces[row], threads)
    if pose_a is not None:
        for k in (1, 4):
            out[:, k : k + 3] = _moved(at_a, out[:, k : k + 3])
        out[:, 7:10] = np.einsum("nij,nj->ni", at_a[:, :3, :3], out[:, 7:10])
    return MeshPairDistances(out[:, 0], out[:, 1:4], out[:, 4:7], out[:, 7:10], faces)


def _inverse(pose: Array) -> Array:
    """Inverse rigid motions. Shape (N, 4, 4)."""
    out = np.tile(np.eye(4), (len(pose), 1, 1))
    out[:, :3, :3] = pose[:, :3, :3].transpose(0, 2, 1)
    out[:, :3, 3] = -np.einsum("nij,nj->ni", out[:, :3, :3], pose[:, :3, 3])
    return out


def _moved(pose: Array, points: Array) -> Array:
    """``points`` (N, 3) moved by one pose each, or by one pose (1, 4, 4) for all."""
    return np.asarray((pose[:, :3, :3] @ points[:, :, None])[:, :, 0] + pose[:, :3, 3])


def _may_overlap(
    a: MeshTree, b: MeshTree, relative: Array, met: NDArray[np.bool_], threads: int
) -> NDArray[np.bool_]:
    """Rows whose surfaces meet, or in which a part of one mesh is in the other. Shape (N,)."""
    overlap = met.copy()
    for mesh, other, place in ((a, b, relative), (b, a, _inverse(relative))):
        for corner in other.part_corners:
            points = place[:, :3, :3] @ corner + place[:, :3, 3]
            near = ((points >= mesh.low) & (points <= mesh.high)).all(axis=1) & ~overlap
            if near.any():
                overlap[near] = mesh.contains(np.ascontiguousarray(points[near]), threads)
    return overlap


def _sign(
    a: MeshTree, b: MeshTree, pose: Array, out: Array, faces: NDArray[np.int32], threads: int
) -> None:
    """Replace the row by that of the deepest point."""
    there, back = pose[None], _inverse(pose[None])
    met = out[0] == 0
    corners = _moved(there, b.used_corners), _moved(back, a.used_corners)
    deepest = _deepest(a, corners[0], threads), _deepest(b, corners[1], threads)
    if met and deepest[0][0] == deepest[1][0] == 0:
        contacts = a.contacts(b, pose)
        common = _common_points(a, b, pose, contacts)
        deepest = _deepest(a, common, threads), _deepest(b, _moved(back, common), threads)
        worst = int(np.argmax(contacts.penetration))
        if contacts.penetration[worst] > max(deepest[0][0], deepest[1][0]):
            normal, depth = contacts.normal[worst], contacts.penetration[worst]
            middle = contacts.point[worst]
            row = -depth, middle + 0.5 * depth * normal, middle - 0.5 * depth * normal, normal
            out[:] = np.concatenate([np.atleast_1d(x) for x in row])
            return
    of_b = deepest[0][0] >= deepest[1][0]
    depth, inside, surface = deepest[0] if of_b else deepest[1]
    if depth == 0:
        return
    if not of_b:
        inside, surface = _moved(there, inside[None])[0], _moved(there, surface[None])[0]
    way = (surface - inside) / depth * (1 if of_b else -1)
    out[:] = [-depth, *(surface if of_b else inside), *(inside if of_b else surface), *way]
    if not met:
        faces[:] = -1


def _common_points(a: MeshTree, b: MeshTree, pose: Array, contacts: MeshContacts) -> Array:
    """Points in both meshes, in the frame of a, behind faces that intersect or lie in one plane.

    The way from a contact goes against the sum of both normals, half-way to the next face behind.
    """
    back = _inverse(pose[None])
    of_a, of_b = contacts.faces.T
    inward = -(a.normals[of_a] + b.normals[of_b] @ pose[:3, :3].T)
    length = np.linalg.norm(inward, axis=1)
    rows = np.flatnonzero(length > 1e-6)
    inward = inward[rows] / length[rows, None]
    skipped = 1e-9 * float(np.linalg.norm(a.high - a.low) + np.linalg.norm(b.high - b.low))
    start = contacts.point[rows] + skipped * inward
    ways = (
        a.cast(start, inward).distance,
        b.cast(_moved(back, start), inward @ pose[:3, :3]).distance,
    )
    way = np.minimum(*ways)
    points = (start + 0.5 * np.where(np.isfinite(way), way, 0)[:, None] * inward).copy()
    inside = a.contains(points) & b.contains(_moved(back, points))
    return np.ascontiguousarray(points[inside])


def _deepest(mesh: MeshTree, points: Array, threads: int) -> tuple[float, Array, Array]:
    """The depth of the deepest point in the mesh (0 if none is inside), it, and the surface."""
    near = ((points >= mesh.low) & (points <= mesh.high)).all(axis=1)
    points = points[near]
    points = points[mesh.contains(points, threads)]
    if len(points) == 0:
        return 0.0, np.zeros(3), np.zeros(3)
    at = mesh.signed_distance(points, threads)
    row = int(np.argmin(at.distance))
    return -float(at.distance[row]), points[row], at.point[row]
