"""Time of impact of bodies under linear and angular motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray

from tauguard.geometry import thread_count
from tauguard.rigid import _rigid_mesh
from tauguard.rigid.mesh import MeshTree
from tauguard.rigid.motion import Motion
from tauguard.rigid.queries import native, rows
from tauguard.rigid.results import Impacts
from tauguard.rigid.shapes import Bodies, Polygons


@dataclass(frozen=True, eq=False)
class MeshImpacts(Impacts):
    """First contact of two moving meshes, row by row.

    Attributes:
        faces: The triangles that touch first, (face of a, face of b); -1 where there is no hit.
            Shape (N, 2).
    """

    faces: NDArray[np.int32]


@overload
def time_of_impact(
    a: Bodies, b: Bodies, motion_a: Motion, motion_b: Motion, threads: int = 1
) -> Impacts: ...
@overload
def time_of_impact(
    a: MeshTree, b: MeshTree, motion_a: Motion, motion_b: Motion, threads: int = 1
) -> MeshImpacts: ...
def time_of_impact(
    a: Bodies | MeshTree,
    b: Bodies | MeshTree,
    motion_a: Motion,
    motion_b: Motion,
    threads: int = 1,
) -> Impacts:
    """When do moving bodies first touch, t in [0, 1]?

    The bodies' numbers are coordinates of their own frame, which the motion moves. The answer is
    conservative: at every time before ``toi`` the bodies are apart, rounding included. Advancement
    along separating directions (after Mirtich 1996 and Zhang, Lee and Kim 2006) with a bound on the
    second derivative: it converges quadratically, from below.

    Args:
        a: N convex bodies of one kind, or one; or a mesh, whose surface counts (not its inside).
        b: The same for the other side; two meshes may have different bounding volumes.
        motion_a: N motions, or one.
        motion_b: N motions, or one.
        threads: 0 means all processors; the answer does not depend on it.

    Returns:
        ``hit``, ``toi``, ``point`` and ``normal`` (world frame, from a to b); meshes also tell
        the ``faces``. Where two bodies overlap at t = 0 the toi is 0 and the normal NaN; the point
        is common to both then too.

    Raises:
        ValueError: lengths that do not match, a body against a mesh, polygons, or a coordinate
            beyond 1e100, whose products would overflow.
    """
    for name, motion in (("motion_a", motion_a), ("motion_b", motion_b)):
        _bounded(name, motion.pose_t0[:, :3, 3], motion.linear)
    if isinstance(a, MeshTree) and isinstance(b, MeshTree):
        count = _lengths({"motion_a": len(motion_a), "motion_b": len(motion_b)})
        out, faces = np.empty((count, 7)), np.empty((count, 2), dtype=np.int32)
        a._mesh.time_of_impact(
            b._mesh, *_packed(motion_a), *_packed(motion_b), out, faces, thread_count(threads)
        )
        return MeshImpacts(np.isfinite(out[:, 0]), out[:, 0], out[:, 1:4], out[:, 4:7], faces)
    if isinstance(a, MeshTree) or isinstance(b, MeshTree):
        raise ValueError("b: a mesh against convex bodies; give both as meshes")
    if isinstance(a, Polygons) or isinstance(b, Polygons):
        name = "a" if isinstance(a, Polygons) else "b"
        raise ValueError(
            f"{name}: Polygons, expected bodies in space; give them thickness as Hulls"
        )
    bodies = rows(a, b)
    for name, body in (("a", a), ("b", b)):
        _bounded(name, body.packed)
    lengths = {"bodies": bodies, "motion_a": len(motion_a), "motion_b": len(motion_b)}
    out = np.empty((_lengths(lengths), 7))
    _rigid_mesh.time_of_impact(
        *native(a), *native(b), *_packed(motion_a), *_packed(motion_b), out, thread_count(threads)
    )
    return Impacts(np.isfinite(out[:, 0]), out[:, 0], out[:, 1:4], out[:, 4:7])


def _bounded(name: str, *values: NDArray[np.float64]) -> None:
    if max(np.abs(value).max(initial=0.0) for value in values) > 1e100:
        raise ValueError(f"{name}: a coordinate beyond 1e100; scale the scene down")


def _packed(motion: Motion) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    return motion.pose_t0, motion.linear, motion.angular


def _lengths(lengths: dict[str, int]) -> int:
    """The common length, each being that or 1."""
    count = 0 if 0 in lengths.values() else max(lengths.values())
    for name, length in lengths.items():
        if length not in (1, count):
            raise ValueError(f"{name}: {length} rows, expected {count} or 1")
    return count
