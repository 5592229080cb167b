"""The truth of times of impact of convex bodies: exact for translations, a bracket for any motion.

The bracket shares nothing with the code under test. The gap between two bodies along their
separating axes is a lower bound of their distance, and a distance changes no faster than the
bodies' points move. An interval of time whose middle has a gap above speed times half its length is
clear throughout; any other is halved, down to 2^-36 of the step. A contact between two samples
cannot be missed.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from oracles.convex_overlap import cross, dot, exact_vertices, float_bodies
from tauguard.arrays import Array
from tauguard.report import Row, rate
from tauguard.rigid import Boxes, Motion
from tauguard.rigid.shapes import Bodies

#: Halvings of the step.
LEVELS = 36


def exact_toi(a: Bodies, b: Bodies, displacement: NDArray[np.float64], i: int) -> Fraction | None:
    """Exact time of impact of row i (b moves), None without one; bodies of full dimension only."""
    pa, ea = exact_vertices(a, i)
    pb, eb = exact_vertices(b, i)
    d = tuple(Fraction(float(x)) for x in displacement[i])
    enter, leave = Fraction(0), Fraction(1)
    for u, v in combinations(ea + eb, 2):
        axis = cross(u, v)
        if not any(axis):
            continue
        low = min(dot(axis, p) for p in pa) - max(dot(axis, p) for p in pb)
        high = max(dot(axis, p) for p in pa) - min(dot(axis, p) for p in pb)
        speed = dot(axis, d)
        if speed == 0:
            if low > 0 or high < 0:
                return None
            continue
        first, last = sorted((low / speed, high / speed))
        enter, leave = max(enter, first), min(leave, last)
        if enter > leave:
            return None
    return enter


class AxisGap:
    """The separating-axis gap of pairs at any time, in NumPy: a lower bound of their distance."""

    def __init__(self, a: Bodies, b: Bodies, ma: Motion, mb: Motion) -> None:
        """Rows of bodies in their own frames, and their motions."""
        self.sides = [(*float_bodies(body, len(body)), m) for body, m in ((a, ma), (b, mb))]
        self.parallel = [isinstance(body, Boxes) for body in (a, b)]
        reach = [np.linalg.norm(v, axis=2).max(axis=1) for v, _, _ in self.sides]
        turn = [np.linalg.norm(m.angular, axis=1) * r for r, m in zip(reach, (ma, mb), strict=True)]
        #: Bound on the speed of any point of a relative to any of b. Shape (N,).
        self.speed = np.linalg.norm(ma.linear - mb.linear, axis=1) + turn[0] + turn[1]

    def __call__(self, row: NDArray[np.intp], t: Array) -> Array:
        """AxisGap of pair ``row[i]`` at ``t[i]``; 0 or less where they touch. Shape (M,)."""
        points, axes, edges = [], [], []
        for (v, e, motion), parallel in zip(self.sides, self.parallel, strict=True):
            turn = Rotation.from_rotvec(t[:, None] * motion.angular[row]).as_matrix()
            pose = turn @ motion.pose_t0[row, :3, :3]
            at = motion.pose_t0[row, :3, 3] + t[:, None] * motion.linear[row]
            points.append(np.einsum("nij,nvj->nvi", pose, v[row]) + at[:, None])
            moved = np.einsum("nij,nej->nei", pose, e[row])
            edges.append(moved)
            pick = [(0, 1), (0, 2), (1, 2)]
            if not parallel:  # the faces at vertex 0 and the one across from it
                pick += [(3, 4)]
            axes.append(np.stack([np.cross(moved[:, i], moved[:, j]) for i, j in pick], axis=1))
        crossed = np.cross(edges[0][:, :, None], edges[1][:, None]).reshape(len(row), -1, 3)
        axis = np.concatenate([*axes, crossed], axis=1)
        length = np.linalg.norm(axis, axis=2, keepdims=True)
        axis = np.where(length > 1e-9, axis / np.maximum(length, 1e-300), 0.0)
        pa, pb = (axis @ p.transpose(0, 2, 1) for p in points)
        gap = np.maximum(pa.min(2) - pb.max(2), pb.min(2) - pa.max(2))
        return np.asarray(np.where(length[:, :, 0] > 1e-9, gap, -np.inf).max(axis=1))


def bracket(a: Bodies, b: Bodies, ma: Motion, mb: Motion) -> tuple[Array, Array]:
    """The first contact lies in ``[early, touch]``; both inf where there is none.

    Where the bodies come so close that 2^-36 of the step cannot tell, ``touch`` is inf and
    ``early`` is finite.
    """
    gap = AxisGap(a, b, ma, mb)
    row, begin, size = np.arange(len(a)), np.zeros(len(a)), 1.0
    touch = np.where(gap(row, begin) <= 0, 0.0, np.inf)
    early = touch.copy()
    row, begin = row[touch > 0], begin[touch > 0]
    for _ in range(LEVELS):
        middle = begin + 0.5 * size
        g = gap(row, middle)
        np.minimum.at(touch, row[g <= 0], middle[g <= 0])
        keep = (g <= 0.5 * size * gap.speed[row]) & (begin < touch[row])
        row, begin = np.repeat(row[keep], 2), np.repeat(begin[keep], 2)
        size *= 0.5
        begin[1::2] += size
    np.minimum.at(early, row, begin)
    return early, touch


def impact_errors(early: Array, touch: Array, toi: Array) -> Row:
    """Errors of found times (inf: none) against the bracket; rows it cannot tell are set aside."""
    known = np.isfinite(touch) == np.isfinite(early)
    truth, found = known & np.isfinite(touch), np.isfinite(toi)
    later = truth & found & (touch > 0)
    # The bracket is 1.5e-11 wide; the error is against its far end, so it is not flattered.
    error = np.abs(touch[later] - toi[later])
    return {
        "hits": int(truth.sum()),
        "undecided": int((~known).sum()),
        "missed": rate(int((truth & ~found).sum()), int(truth.sum())),
        "false": rate(int((known & ~truth & found).sum()), int((known & ~truth).sum())),
        "late": rate(int((truth & found & (toi > touch)).sum()), int(truth.sum())),
        "toi_error_median": float(np.median(error)) if later.any() else None,
        "toi_error_max": float(error.max()) if later.any() else None,
    }


def sweep_errors(
    a: Bodies,
    b: Bodies,
    d: NDArray[np.float64],
    hit: NDArray[np.bool_],
    toi: NDArray[np.float64],
    count: int,
) -> tuple[int, int, float]:
    """Late times, wrong hits and the largest error of the first ``count`` rows, by rationals."""
    late = wrong = 0
    error = 0.0
    for i in range(count):
        exact = exact_toi(a, b, d, i)
        wrong += (exact is not None) != hit[i]
        if exact is not None and hit[i]:
            late += toi[i] > exact
            error = max(error, abs(float(exact - type(exact)(float(toi[i])))))
    return late, wrong, error
