"""A mesh with convex bodies: the kernels of `overlap`, `distance` and `time_of_impact`."""

from typing import cast

import numpy as np
from numpy.typing import NDArray

from tauguard.geometry import thread_count
from tauguard.rigid.mesh import MeshOverlap, MeshTree
from tauguard.rigid.motion import Motion, common_length
from tauguard.rigid.queries import native
from tauguard.rigid.results import MeshDistances, MeshImpacts
from tauguard.rigid.rounded import Solid, solid_parts

#: Largest coordinate and radius of bodies in a query with a mesh; meshes have the same limit.
MOST_COORDINATE = 1e30


def mesh_beside(a: Solid | MeshTree, b: Solid | MeshTree) -> tuple[MeshTree, Solid, bool] | None:
    """The mesh, the bodies, and whether the mesh is ``b``; ``None`` if there is no mesh.

    Raises:
        ValueError: both are meshes.
    """
    if isinstance(a, MeshTree) and isinstance(b, MeshTree):
        raise ValueError(
            "a, b: both are meshes; MeshTree.overlap, contacts and sweep work on two meshes, and "
            "distance on a mesh and convex bodies, such as Hulls of the vertices"
        )
    if isinstance(a, MeshTree):
        return a, cast(Solid, b), False
    return (b, a, True) if isinstance(b, MeshTree) else None


Native = tuple[int, NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]


def bodies_of(name: str, solid: Solid) -> Native:
    """The native form of a batch: kind, packed rows, offsets, radii."""
    core, radius = solid_parts(name, solid, MOST_COORDINATE)
    return *native(core), radius


def overlap(mesh: MeshTree, solid: Solid, swapped: bool, threads: int) -> MeshOverlap:
    """Whether the surface intersects each body, and one intersecting triangle."""
    bodies = bodies_of(_other(swapped), solid)
    face = np.empty(len(solid), dtype=np.int32)
    mesh._mesh.meets(*bodies, face, thread_count(threads))
    return MeshOverlap(face >= 0, faces_of(face, swapped))


def distance(mesh: MeshTree, solid: Solid, swapped: bool, threads: int) -> MeshDistances:
    """Distance of the surface from each body."""
    bodies = bodies_of(_other(swapped), solid)
    out, face = np.empty((len(solid), 10)), np.empty(len(solid), dtype=np.int32)
    mesh._mesh.distances(*bodies, out, face, thread_count(threads))
    first, second, normal = out[:, 1:4], out[:, 4:7], out[:, 7:10]
    if swapped:
        first, second, normal = second, first, -normal
    return MeshDistances(out[:, 0], first, second, normal, face)


def first_contact(
    mesh: MeshTree, solid: Solid, swapped: bool, motion_a: Motion, motion_b: Motion, threads: int
) -> MeshImpacts:
    """First contact of the surface with each body; the mesh is ``b`` if ``swapped``."""
    motion_mesh, motion_solid = (motion_b, motion_a) if swapped else (motion_a, motion_b)
    bodies = bodies_of(_other(swapped), solid)
    lengths = {"bodies": len(solid), "motion_a": len(motion_a), "motion_b": len(motion_b)}
    count = common_length(lengths)
    out, face = np.empty((count, 7)), np.empty(count, dtype=np.int32)
    mesh._mesh.time_of_impact_of_bodies(
        *bodies, *motion_mesh.packed, *motion_solid.packed, out, face, thread_count(threads)
    )
    if swapped:
        out[:, 4:7] *= -1
    parts = out[:, 0], out[:, 1:4], out[:, 4:7]
    return MeshImpacts(np.isfinite(out[:, 0]), *parts, faces_of(face, swapped))


def faces_of(face: NDArray[np.int32], swapped: bool) -> NDArray[np.int32]:
    """Faces of a and of b; -1 for the side of the bodies. Shape (N, 2)."""
    none = np.full_like(face, -1)
    return np.stack([none, face] if swapped else [face, none], axis=1)


def _other(swapped: bool) -> str:
    return "a" if swapped else "b"
