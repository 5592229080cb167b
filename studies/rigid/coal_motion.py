"""coal beside ``time_of_impact``: its distance of moving pairs, and advancement over it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.framework import time_in_turn
from studies.rigid.convex import nanoseconds, take
from tauguard.arrays import Array
from tauguard.report import Row
from tauguard.rigid import Impacts, Motion, coal_peer
from tauguard.rigid.rounded import Solid

#: coal's shapes, each with its pose in the body's frame.
Shapes = list[tuple[Any, Any]]
#: Distance at which advancement over coal's stops, and what counts as coal's own tolerance.
STOP = 1e-6


def coal_shapes(solid: Solid) -> Shapes | None:
    """coal's shapes and poses, None where it is not installed."""
    try:
        coal_peer.coal_module()
    except ValueError:
        return None
    return coal_peer.geometries(solid)


def in_motion(
    call: Callable[[], Impacts],
    sides: tuple[Shapes | None, Shapes | None],
    motions: tuple[Motion, Motion],
    lever: Array,
) -> Row:
    """Time of a call, and coal's distance at each time of impact and at 24 moments before.

    Args:
        call: ``time_of_impact`` of n pairs.
        sides: coal's shapes of both sides, or None without coal.
        motions: Of both sides, n rows or one.
        lever: No two points of a pair's bodies are together further from the origins of their
            frames [m]. Shape (n,).
    """
    found = call()
    n = len(found.time_of_impact)
    spent = time_in_turn({"": call}, 3, time.process_time)[""]
    row: Row = {"pairs": n, "hits": int(found.hit.sum()), "us": nanoseconds(spent, 1000 * n)}
    left, right = sides
    if left is None or right is None:
        return {**row, "coal_us": "coal is not installed"}
    gap = CoalGap(left, right, motions)
    end = np.where(found.hit, found.time_of_impact, 1.0)
    before = [gap(np.arange(n), share * end) for share in np.linspace(0, 0.999, 24)]
    at = np.abs(gap(np.arange(n), end))[found.hit & (found.time_of_impact > 0)]
    speed = np.linalg.norm(motions[0].linear - motions[1].linear, axis=1)
    speed += lever * np.maximum(*(np.linalg.norm(m.angular, axis=1) for m in motions))
    toi, seconds, steps = advanced(gap, speed, n)
    both = np.isfinite(toi) & found.hit & (found.time_of_impact > 0)
    return {
        **row,
        "passed_before": passed_before(np.min(before, axis=0), found.time_of_impact),
        "gap_at_toi": float(at.max(initial=0.0)),
        "coal_us": 1e6 * seconds / n,
        "coal_steps": steps / n,
        "coal_disagrees": int((np.isfinite(toi) != found.hit).sum()),
        "toi_differs_most": float(np.abs(toi[both] - found.time_of_impact[both]).max(initial=0.0)),
    }


def passed_before(least: Array, toi: Array) -> int:
    """Pairs whose least distance before the time was below zero [m], but for overlaps at t = 0."""
    return int(((least < -STOP) & ~(toi == 0)).sum())


class CoalGap:
    """coal's signed distance of moving pairs."""

    def __init__(self, left: Shapes, right: Shapes, motions: tuple[Motion, Motion]) -> None:
        """Shapes with their poses in the bodies' frames (one shape stands for all), and motions."""
        self.sides, self.motions = (left, right), motions
        self.coal, self.seconds = coal_peer.coal_module(), 0.0

    def __call__(self, rows: NDArray[np.intp], t: Array) -> Array:
        """Of the K chosen rows at their times [m]; ``seconds`` adds up what the calls take."""
        out = np.empty(len(rows))
        poses = [self._poses(side, rows, t) for side in (0, 1)]
        request, result = self.coal.DistanceRequest(), self.coal.DistanceResult()
        request.enable_signed_distance = True
        begin = time.process_time()
        for k in range(len(rows)):
            (a, at_a), (b, at_b) = poses[0][k], poses[1][k]
            result.clear()
            out[k] = self.coal.distance(a, at_a, b, at_b, request, result)
        self.seconds += time.process_time() - begin
        return out

    def _poses(self, side: int, rows: NDArray[np.intp], t: Array) -> Shapes:
        motion, own = self.motions[side], self.sides[side]
        some = rows if len(motion) > 1 else np.zeros_like(rows)
        moved = take(motion, some).at(t)
        found = []
        for row, pose in zip(rows, moved, strict=True):
            shape, place = own[row if len(own) > 1 else 0]
            there = self.coal.Transform3s(pose[:3, :3], pose[:3, 3])
            found.append((shape, there * place))
        return found


def advanced(gap: CoalGap, speed: Array, n: int, most: int = 300) -> tuple[Array, float, int]:
    """Conservative advancement over coal's distance (Mirtich 1996).

    Args:
        gap: Of n pairs in motion.
        speed: No point of either body nears the other's faster [m a step]. Shape (n,).
        n: How many pairs.
        most: Calls a pair; one that takes more keeps the time that it has reached.

    Returns:
        The times in [0, 1], inf where the pair stays apart (shape (n,)), the processor seconds in
        coal's distance, and its calls.
    """
    t, toi, alive, steps = np.zeros(n), np.full(n, np.inf), np.arange(n), 0
    gap.seconds = 0.0
    for _ in range(most):
        left = gap(alive, t[alive])
        steps += len(alive)
        touch = left <= STOP
        toi[alive[touch]] = t[alive[touch]]
        t[alive] += np.maximum(left, 0) / speed[alive]
        alive = alive[~touch & (t[alive] < 1)]
        if len(alive) == 0:
            break
    toi[alive] = t[alive]  # creeping towards contact
    return toi, gap.seconds, steps
