"""The last resort: partners that would pass through one another go on as one for a moment."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.contacts.guard.report import Pair


@dataclass(frozen=True)
class Hit:
    """A pair that would pass through itself."""

    pair: Pair
    vertices: NDArray[np.int32]  #: of flexes, that take part; empty for two geoms


#: Times that further pairs are added before everything stands still.
ROUNDS = 8


def arrest(
    model: Any,
    data: Any,
    qpos: Array,
    length: float,
    hits: Sequence[Hit],
    judge: Callable[[], list[Hit]],
) -> list[Hit]:
    """Take the piece of a step again so that no pair passes through.

    The velocity at its end is changed by as little as possible, in the metric of the inertia, such
    that the partners of each hit do not move against one another (rigid impact zones: Provot 1997;
    Bridson, Fedkiw and Anderson 2002); that takes kinetic energy and never adds any. The piece then
    goes by that velocity. Pairs that meet on this new way are added; if that does not end, all
    stands still for the piece.

    Args:
        model: MjModel.
        data: MjData after the failed piece; its kinematics are those of the piece's start.
        qpos: At the piece's start.
        length: Of the piece [s].
        hits: What it let through.
        judge: Judges the way from the start to ``data.qpos``.

    Returns:
        All hits whose partners were stopped.
    """
    stopped, velocity = list(hits), data.qvel.copy()
    for _ in range(ROUNDS):
        data.qvel[:] = _joined(model, data, velocity, stopped)
        data.qpos[:] = qpos
        mujoco.mj_integratePos(model, data.qpos, data.qvel, length)
        more = judge()
        if not more:
            return stopped
        stopped += more
    data.qpos[:], data.qvel[:] = qpos, 0.0
    return stopped


def _joined(model: Any, data: Any, velocity: Array, hits: Sequence[Hit]) -> Array:
    """The velocity nearest to ``velocity`` at which the partners of each hit move as one."""
    rows = np.concatenate([_rows(model, data, hit) for hit in hits])
    rows = rows[np.abs(rows).max(axis=1) > 0]
    if not len(rows):
        return velocity
    weighted = np.zeros_like(rows)
    mujoco.mj_solveM(model, data, weighted, rows)
    share = np.linalg.lstsq(rows @ weighted.T, rows @ velocity, rcond=1e-10)[0]
    return np.asarray(velocity - share @ weighted)


def _rows(model: Any, data: Any, hit: Hit) -> Array:
    """Jacobian of the relative motion of a hit's partners. Shape (R, nv)."""
    (first, one), (_, other) = hit.pair
    if first == "geom":
        a, b = (int(model.geom_bodyid[g]) for g in (one, other))
        point = data.xipos[a if model.body_dofnum[model.body_weldid[a]] else b]
        return _body(model, data, a, point, 6) - _body(model, data, b, point, 6)
    points = data.flexvert_xpos[hit.vertices]
    own = [
        _body(model, data, int(model.flex_vertbodyid[v]), point, 3)
        for v, point in zip(hit.vertices.tolist(), points, strict=True)
    ]
    if hit.pair[1][0] == "flex":
        return np.concatenate([row - own[0] for row in own[1:]])
    body = int(model.geom_bodyid[other])
    with_body = [_body(model, data, body, point, 3) for point in points]
    return np.concatenate([a - b for a, b in zip(own, with_body, strict=True)])


def _body(model: Any, data: Any, body: int, point: Array, count: int) -> Array:
    """The first rows of the Jacobian of a point on a body: 3 of its velocity, 3 of its turning."""
    out = np.zeros((6, model.nv))
    mujoco.mj_jac(model, data, out[:3], out[3:], np.ascontiguousarray(point), body)
    return out[:count]
