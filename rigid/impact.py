"""Time of impact of bodies under linear and angular motion."""

from typing import cast, overload

import numpy as np

from tauguard.geometry import thread_count
from tauguard.rigid import _rigid_mesh
from tauguard.rigid.mesh import MeshTree, first_touch
from tauguard.rigid.mesh_bodies import first_contact, mesh_beside
from tauguard.rigid.motion import Motion, bounded, common_length
from tauguard.rigid.queries import native, rows
from tauguard.rigid.results import Impacts, MeshImpacts
from tauguard.rigid.rounded import Solid, solid_parts


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
    a: Solid | MeshTree, b: Solid | MeshTree, motion_a: Motion, motion_b: Motion, threads: int = 1
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

    Returns:
        ``hit``, ``time_of_impact``, ``point`` and ``normal`` (world frame, from a to b); with a
        mesh also ``faces``. If two bodies overlap at t = 0, the time is 0, the normal is NaN and
        the point is in both bodies.

    Raises:
        ValueError: lengths that do not match, a motion that is not a ``Motion``, polygons, or a
            coordinate beyond 1e100, whose products would overflow (with a mesh: a coordinate of
            the bodies beyond 1e30).
    """
    for name, motion in (("motion_a", motion_a), ("motion_b", motion_b)):
        if not isinstance(motion, Motion):
            raise ValueError(f"{name}: a {type(motion).__name__}, expected a Motion")
        bounded(name, motion)
    if isinstance(a, MeshTree) and isinstance(b, MeshTree):
        return first_touch(a, b, motion_a, motion_b, threads)
    if beside := mesh_beside(a, b):
        return first_contact(*beside, motion_a, motion_b, threads)
    core_a, radius_a = solid_parts("a", cast(Solid, a))
    core_b, radius_b = solid_parts("b", cast(Solid, b))
    lengths = {"bodies": rows(core_a, core_b), "motion_a": len(motion_a), "motion_b": len(motion_b)}
    out = np.empty((common_length(lengths), 7))
    _rigid_mesh.time_of_impact(
        *(*native(core_a), radius_a, *native(core_b), radius_b),
        *(*motion_a.packed, *motion_b.packed, out, thread_count(threads)),
    )
    return Impacts(np.isfinite(out[:, 0]), out[:, 0], out[:, 1:4], out[:, 4:7])
