"""Impact zones, the last resort: penetrating partners move rigidly together for a sub-step."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.contacts.guard.mocap import MocapVelocityField
from tauguard.contacts.guard.report import Pair


@dataclass(frozen=True)
class Hit:
    """A pair whose partners would pass through each other."""

    pair: Pair
    vertices: NDArray[np.int32]  #: affected vertices of flexes; empty for two geoms


#: Largest number of attempts, each with more pairs. After the last one everything is stopped.
ROUNDS = 8


def impact_zone(
    model: Any,
    data: Any,
    qpos: Array,
    length: float,
    hits: Sequence[Hit],
    judge: Callable[[], list[Hit]],
) -> tuple[list[Hit], float]:
    """Repeat a sub-step so that no partners pass through each other.

    The velocity at the end of the sub-step is changed by as little as possible, in the metric of
    the inertia, so that the partners of each hit do not move relative to each other (rigid impact
    zones: Provot 1997; Bridson, Fedkiw and Anderson 2002). This removes kinetic energy and adds
    none, except for the work of mocap bodies. The bodies move with this velocity for the sub-step.
    Pairs that pass through on the new path are added, and the computation is repeated. If there are
    none to add, if this has no success in :data:`ROUNDS` attempts, or if an edited inertia gives no
    finite velocity, everything except mocap bodies stands still for the sub-step.

    Args:
        model: MjModel.
        data: MjData after the failed sub-step, with the kinematics of its start and the mocap poses
            of its end.
        qpos: Joint positions at the start of the sub-step.
        length: Length of the sub-step [s].
        hits: The pairs that passed through.
        judge: Finds the pairs that pass through on the path from the start to ``data.qpos``.

    Returns:
        All hits whose partners were joined, and the resulting work of mocap bodies [J].
    """
    velocity, stopped = data.qvel.copy(), {(hit.pair, hit.vertices.tobytes()): hit for hit in hits}
    for _ in range(ROUNDS):
        joined = _joined(model, data, velocity, list(stopped.values()), length)
        if joined is None:
            break
        data.qvel[:], work = joined
        data.qpos[:] = qpos
        mujoco.mj_integratePos(model, data.qpos, data.qvel, length)
        more = judge()
        if not more:
            return list(stopped.values()), work
        known = len(stopped)
        stopped |= {(hit.pair, hit.vertices.tobytes()): hit for hit in more}
        if len(stopped) == known:
            break
    data.qpos[:], data.qvel[:] = qpos, 0.0
    return list(stopped.values()), 0.0


def _joined(
    model: Any, data: Any, velocity: Array, hits: Sequence[Hit], length: float
) -> tuple[Array, float] | None:
    """The velocity nearest to ``velocity`` at which the partners of each hit move rigidly together.

    With J the Jacobian of relative motion, M the inertia, c the mocap velocity and S the impulses:
    J M^-1 J' S = J v + c, and mocap bodies do the work S c. ``None`` if a result is not finite, for
    example with negative moments of inertia.
    """
    field = MocapVelocityField(model, data, length) if model.nmocap else None
    parts = [_rows(model, data, hit, field) for hit in hits]
    rows, carried = (np.concatenate([part[k] for part in parts]) for k in range(2))
    acts = np.abs(rows).max(axis=1) > 0
    rows, carried = rows[acts], carried[acts]
    if not len(rows):
        return velocity, 0.0
    weighted = np.zeros_like(rows)
    mujoco.mj_solveM(model, data, weighted, rows)
    with np.errstate(all="ignore"):
        square = rows @ weighted.T
        if not np.isfinite(square).all():
            return None
        impulses = np.linalg.lstsq(square, rows @ velocity + carried, rcond=1e-10)[0]
        joined = np.asarray(velocity - impulses @ weighted)
    return (joined, float(impulses @ carried)) if np.isfinite(joined).all() else None


def _rows(model: Any, data: Any, hit: Hit, field: MocapVelocityField | None) -> tuple[Array, Array]:
    """Jacobian of the partners' relative motion, shape (R, nv), and mocap velocity, shape (R,)."""

    def of(body: int, point: Array, count: int) -> tuple[Array, Array]:
        jacobian = np.zeros((6, model.nv))
        place = np.ascontiguousarray(point)
        mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], place, body)
        velocity = np.zeros(6) if field is None else field.velocity(body, place)
        return jacobian[:count], velocity[:count]

    (first, one), (_, other) = hit.pair
    if first == "geom":
        a, b = (int(model.geom_bodyid[g]) for g in (one, other))
        point = data.xipos[a if model.body_dofnum[model.body_weldid[a]] else b]
        return _apart([of(a, point, 6)], [of(b, point, 6)])
    points = data.flexvert_xpos[hit.vertices]
    own = [
        of(int(model.flex_vertbodyid[v]), point, 3)
        for v, point in zip(hit.vertices.tolist(), points, strict=True)
    ]
    if hit.pair[1][0] == "flex":
        return _apart(own[1:], own[:1] * (len(own) - 1))
    body = int(model.geom_bodyid[other])
    return _apart(own, [of(body, point, 3) for point in points])


def _apart(
    a: Sequence[tuple[Array, Array]], b: Sequence[tuple[Array, Array]]
) -> tuple[Array, Array]:
    """Differences a - b of Jacobians and of velocities, stacked."""
    pairs = list(zip(a, b, strict=True))
    return (
        np.concatenate([one[0] - other[0] for one, other in pairs]),
        np.concatenate([one[1] - other[1] for one, other in pairs]),
    )
