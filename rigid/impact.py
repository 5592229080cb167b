"""Time of impact of bodies under linear and angular motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast, overload

import numpy as np
from numpy.typing import NDArray

from tauguard.geometry import thread_count
from tauguard.rigid import _rigid_mesh
from tauguard.rigid.mesh import MeshTree
from tauguard.rigid.mesh_bodies import first_contact
from tauguard.rigid.motion import Motion, common_length
from tauguard.rigid.queries import native, rows
from tauguard.rigid.results import Impacts
from tauguard.rigid.rounded import Solid, solid_parts


@dataclass(frozen=True, eq=False)
class MeshImpacts(Impacts):
    """First contact of two moving meshes, or of one and convex bodies, row by row.

    Attributes:
        faces: The triangles that touch first, (face of a, face of b); -1 where there is no hit, and
            for a side that is no mesh. Shape (N, 2).
    """

    faces: NDArray[np.int32]


@overload
def time_of_impact(
    a: Solid, b: Solid, motion_a: Motion, motion_b: Motion, threads: int = 1
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
) -> Impacts:
    """When do moving bodies first touch, t in [0, 1]?

    The bodies' numbers are coordinates of their own frame, which the motion moves. The answer is
    conservative: at every time before ``toi`` the bodies are apart, rounding included. Advancement
    along separating directions (after Mirtich 1996 and Zhang, Lee and Kim 2006) with a bound on the
    second derivative: it converges quadratically, from below.

    Args:
        a: N convex bodies of one kind, rounded or not, or one; or a mesh, whose surface counts (not
            its inside).
        b: The same for the other side; two meshes may have different bounding volumes.
        motion_a: N motions, or one.
        motion_b: N motions, or one.
        threads: 0 means all processors; the answer does not depend on it.

    Returns:
        ``hit``, ``toi``, ``point`` and ``normal`` (world frame, from a to b); meshes also tell
        the ``faces``. Where two bodies overlap at t = 0 the toi is 0 and the normal NaN; the point
        is common to both then too.

    Raises:
        ValueError: lengths that do not match, no motion, polygons, or a coordinate beyond 1e100,
            whose products would overflow (for bodies beside a mesh beyond 1e30, as for the mesh).
    """
    for name, motion in (("motion_a", motion_a), ("motion_b", motion_b)):
        if not isinstance(motion, Motion):
            raise ValueError(f"{name}: a {type(motion).__name__}, expected a Motion")
        _bounded(name, motion.pose_t0[:, :3, 3], motion.linear)
    if isinstance(a, MeshTree) or isinstance(b, MeshTree):
        return _of_meshes(a, b, motion_a, motion_b, threads)
    (core_a, radius_a), (core_b, radius_b) = solid_parts("a", a), solid_parts("b", b)
    lengths = {
        "bodies": rows(core_a, core_b),
        "motion_a": len(motion_a),
        "motion_b": len(motion_b),
    }
    out = np.empty((common_length(lengths), 7))
    _rigid_mesh.time_of_impact(
        *(*native(core_a), radius_a, *native(core_b), radius_b),
        *(*motion_a.packed, *motion_b.packed, out, thread_count(threads)),
    )
    return Impacts(np.isfinite(out[:, 0]), out[:, 0], out[:, 1:4], out[:, 4:7])


def _of_meshes(
    a: Solid | MeshTree, b: Solid | MeshTree, motion_a: Motion, motion_b: Motion, threads: int
) -> MeshImpacts:
    if isinstance(a, MeshTree) and isinstance(b, MeshTree):
        count = common_length({"motion_a": len(motion_a), "motion_b": len(motion_b)})
        out, faces = np.empty((count, 7)), np.empty((count, 2), dtype=np.int32)
        a._mesh.time_of_impact(
            b._mesh, *motion_a.packed, *motion_b.packed, out, faces, thread_count(threads)
        )
    elif isinstance(a, MeshTree):
        out, faces = first_contact(a, cast(Solid, b), motion_a, motion_b, threads)
    else:
        mesh = cast(MeshTree, b)
        out, faces = first_contact(mesh, a, motion_b, motion_a, threads, swapped=True)
    return MeshImpacts(np.isfinite(out[:, 0]), out[:, 0], out[:, 1:4], out[:, 4:7], faces)


def _bounded(name: str, *values: NDArray[np.float64]) -> None:
    if max(np.abs(value).max(initial=0.0) for value in values) > 1e100:
        raise ValueError(f"{name}: a coordinate beyond 1e100; scale the scene down")
