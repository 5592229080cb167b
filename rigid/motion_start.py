"""Pairs that overlap at the start of a motion, with the options of parry's shape casts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.rigid.motion import Motion
from tauguard.rigid.results import Distances, Impacts

#: The state of pairs is tested again at the latest after this rotation [rad].
_TURN = 0.1
_MOST_STEPS = 1000

Query = Callable[[Any, Any, Motion, Motion], Impacts]
Measure = Callable[[Any, Any, Array, Array], Distances]


@dataclass(frozen=True)
class _Pairs:
    """Some rows of a query, from a time of the step on."""

    a: Any
    b: Any
    motion_a: Motion
    motion_b: Motion

    def at(self, rows: NDArray[np.intp]) -> _Pairs:
        return _Pairs(*(_some(side, rows) for side in vars(self).values()))

    def state(self, t: Array, measure: Measure) -> tuple[Distances, Array]:
        """Distances at times ``t``, and the speeds at which the nearest points move apart."""
        near = measure(self.a, self.b, self.motion_a.at(t), self.motion_b.at(t))
        speeds = [
            _velocity(self.motion_a, t, near.point_a),
            _velocity(self.motion_b, t, near.point_b),
        ]
        return near, np.einsum("ij,ij->i", near.normal, speeds[1] - speeds[0])

    def rest(self, t: Array) -> _Pairs:
        """The pairs with the motions from ``t`` to the end of the step."""
        left = (1 - t)[:, None]
        motions = (
            Motion(m.at(t), left * m.linear, left * m.angular)
            for m in (self.motion_a, self.motion_b)
        )
        return _Pairs(self.a, self.b, *motions)


def _some(side: Any, rows: NDArray[np.intp]) -> Any:
    if isinstance(side, Motion):
        rows = np.minimum(rows, len(side) - 1)
        return Motion(side.pose_t0[rows], side.linear[rows], side.angular[rows])
    return side if len(side) == 1 else side[rows]


def _velocity(motion: Motion, t: Array, point: Array) -> Array:
    arm = point - (motion.pose_t0[:, :3, 3] + t[:, None] * motion.linear)
    return motion.linear + np.cross(motion.angular, arm)


def with_start(
    found: Impacts, sides: tuple[Any, Any, Motion, Motion], query: Query, measure: Measure,
    target: float, stop: bool, geometry: bool,
) -> Impacts:  # fmt: skip
    """``found`` with the options for pairs within ``target`` of each other at t = 0."""
    depth = np.zeros(len(found.hit)) if geometry else None
    rows = np.flatnonzero(found.hit & (found.time_of_impact == 0))
    out = replace(
        found, hit=found.hit.copy(), time_of_impact=found.time_of_impact.copy(),
        point=found.point.copy(), normal=found.normal.copy(), depth=depth,
    )  # fmt: skip
    if len(rows) == 0:
        return out
    pairs = _Pairs(*sides).at(rows)
    near, parting = pairs.state(np.zeros(len(rows)), measure)
    if depth is not None:
        out.normal[rows], depth[rows] = near.normal, np.maximum(-near.distance, 0)
        out.point[rows] = 0.5 * (near.point_a + near.point_b)
    if not stop:
        apart = parting >= 0
        _ignore(out, rows[apart], pairs.at(np.flatnonzero(apart)), query, measure, target)
    return out


def _ignore(
    out: Impacts, rows: NDArray[np.intp], pairs: _Pairs, query: Query, measure: Measure,
    target: float,
) -> None:  # fmt: skip
    """Replace the impacts of rows whose pairs move apart by the first impacts afterwards."""
    time, open_rows = np.zeros(len(rows)), np.arange(len(rows))
    turn = [np.linalg.norm(m.angular, axis=1) for m in (pairs.motion_a, pairs.motion_b)]
    longest = _TURN / np.maximum(turn[0] + turn[1], _TURN)
    for _ in range(_MOST_STEPS):
        if len(open_rows) == 0:
            return
        now = pairs.at(open_rows)
        t = time[open_rows]
        near, parting = now.state(t, measure)
        apart = near.distance > target + 1e-9 * (1 + np.abs(near.point_a).max(axis=1))
        for mask, judge in ((apart, _resume), (~apart & (parting < 0) & (t > 0), _approach)):
            if mask.any():
                some = np.flatnonzero(mask)
                part = near.normal[some], 0.5 * (near.point_a + near.point_b)[some]
                judge(out, rows[open_rows[some]], now.at(some), t[some], query, part)
        ended = ~apart & (parting >= 0) & (t >= 1)
        _clear(out, rows[open_rows[ended]])
        going = ~apart & (t < 1) & ((parting >= 0) | (t == 0))
        with np.errstate(divide="ignore", invalid="ignore"):
            step = 1.01 * (target - near.distance) / parting
        step = np.clip(np.nan_to_num(step, nan=1.0, posinf=1.0), 1e-3, longest[open_rows])
        time[open_rows] = np.minimum(t + step, 1)
        open_rows = open_rows[going]


def _clear(out: Impacts, rows: NDArray[np.intp]) -> None:
    out.hit[rows], out.time_of_impact[rows] = False, np.inf
    out.point[rows] = out.normal[rows] = np.nan
    if out.depth is not None:
        out.depth[rows] = 0


def _resume(
    out: Impacts, rows: NDArray[np.intp], pairs: _Pairs, t: Array, query: Query, _: object
) -> None:
    rest = pairs.rest(t)
    later = query(rest.a, rest.b, rest.motion_a, rest.motion_b)
    _clear(out, rows)
    out.hit[rows], out.time_of_impact[rows] = later.hit, t + (1 - t) * later.time_of_impact
    out.point[rows], out.normal[rows] = later.point, later.normal


def _approach(
    out: Impacts, rows: NDArray[np.intp], _: _Pairs, t: Array, __: Query, part: tuple[Array, Array]
) -> None:
    out.time_of_impact[rows] = t
    out.normal[rows], out.point[rows] = part
