"""Find the pairs that touch on the path between two states, and when."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.contacts.checker import State, geom_kinds, pair_kind
from tauguard.contacts.ground_truth import triangles
from tauguard.findings import ArgumentError
from tauguard.models.cloth import flex_elements

Index = NDArray[np.int32]


def geom_pairs(model: Any) -> Index:
    """Ids of the geoms that may touch, the smaller id first. Shape (P, 2)."""
    explicit = {tuple(sorted(p)) for p in zip(model.pair_geom1, model.pair_geom2, strict=True)}
    excluded = {(int(e) >> 16, int(e) & 0xFFFF) for e in model.exclude_signature}
    weld, parent = model.body_weldid, model.body_parentid
    filter_parents = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    found = []
    for i in range(model.ngeom):
        for j in range(i + 1, model.ngeom):
            if (i, j) in explicit:
                found.append((i, j))
                continue
            bodies = int(model.geom_bodyid[i]), int(model.geom_bodyid[j])
            a, b = int(weld[bodies[0]]), int(weld[bodies[1]])
            above = int(weld[parent[a]]), int(weld[parent[b]])
            related = filter_parents and a and b and (a == above[1] or b == above[0])
            if a == b or related or tuple(sorted(bodies)) in excluded:
                continue
            if meet(model.geom_contype, model.geom_conaffinity, i, j):
                found.append((i, j))
    return np.array(found, dtype=np.int32).reshape(-1, 2)


def meet(contype: Any, conaffinity: Any, i: int, j: int) -> bool:
    """Whether the collision bits of two geoms allow contacts."""
    return bool(contype[i] & conaffinity[j] or contype[j] & conaffinity[i])


def flex_geoms(model: Any, flex: int) -> list[int]:
    """Geoms that the flex may touch."""
    kind, affinity = int(model.flex_contype[flex]), int(model.flex_conaffinity[flex])
    return [
        g
        for g in range(model.ngeom)
        if kind & int(model.geom_conaffinity[g]) or affinity & int(model.geom_contype[g])
    ]


#: Function (rows, s), both of shape (K,), that returns signed distances of pairs [m], shape (K,).
Distance = Callable[[NDArray[Any], Array], Array]


@dataclass(frozen=True)
class Found:
    """The result of a search for each pair; every field has shape (N,)."""

    time: Array  #: first touch (fraction of the step), late by less than resolution / L; or inf
    depth: Array  #: largest depth found [m]; 0 without penetration


def search(
    distance: Distance, bound: Array, tolerance: float = 1e-5, resolution: float = 2e-6
) -> Found:
    """Find the first touch of each pair, and whether it becomes deeper than ``tolerance``.

    Let d(s) be the signed distance of two objects whose points move by at most L relative to each
    other in the step. Then |d(s) - d(t)| <= L |s - t|, so d has no zero in [a, b] if d(a) + d(b) >
    L (b - a). Intervals are halved until this holds, or a penetration is found, or the interval is
    shorter than the resolution (Piyavskii 1972; conservative advancement uses the same bound).

    Args:
        distance: Distances of pairs at given times.
        bound: Bound L of each pair [m], shape (N,).
        tolerance: Once a pair is deeper than this, greater depths are not searched for [m].
        resolution: Distance below which a pair may be reported as touching [m].
    """
    n = len(bound)
    rows = np.arange(n)
    first, deepest = np.full(n, np.inf), np.full(n, np.inf)

    def sample(pairs: NDArray[Any], s: Array) -> Array:
        d = distance(pairs, s)
        np.minimum.at(deepest, pairs, d)
        touching = d <= 0
        np.minimum.at(first, pairs[touching], s[touching])
        return d

    a, b = np.zeros(n), np.ones(n)
    da, db = sample(rows, a), sample(rows, b)
    while len(rows):
        length = bound[rows] * (b - a)
        # After the first contact only a depth above the tolerance matters.
        known = (deepest[rows] < -tolerance) | ((da + db - length) / 2 > -tolerance)
        settled = known & (a >= first[rows])
        open_ = (da + db <= length) & ~settled
        short = open_ & (length <= resolution)
        np.minimum.at(first, rows[short], b[short])
        keep = open_ & ~short
        rows, a, b, da, db = rows[keep], a[keep], b[keep], da[keep], db[keep]
        # There is no contact within d / L of either end. Split the rest in the middle.
        low = a + np.maximum(da, 0) / bound[rows]
        high = np.maximum(b - np.maximum(db, 0) / bound[rows], low)
        middle = np.clip((low + high) / 2, a + 0.05 * (b - a), b - 0.05 * (b - a))
        dm = sample(rows, middle)
        rows = np.concatenate([rows, rows])
        a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
        da, db = np.concatenate([da, dm]), np.concatenate([dm, db])
    _polish(distance, first, bound, resolution)
    return Found(first, np.maximum(-deepest, 0.0))


def _polish(distance: Distance, first: Array, bound: Array, resolution: float) -> None:
    """Bisect the last interval before each first touch, in place."""
    rows = np.flatnonzero(np.isfinite(first) & (first > 0))
    high = first[rows]
    low = np.maximum(high - 2 * resolution / bound[rows], 0.0)
    for _ in range(12):
        middle = (low + high) / 2
        touching = distance(rows, middle) <= 0
        high = np.where(touching, middle, high)
        low = np.where(touching, low, middle)
    first[rows] = high


@dataclass(frozen=True)
class Step:
    """The motion of all geoms and flex vertices of a scene in one step.

    A point y of a body moves as ``xpos + s dx + exp(s [w]x) xmat y``, s in [0, 1]. Flex vertices
    move linearly.
    """

    origin: Array  #: origin of each geom's body at s = 0, shape (ngeom, 3) [m]
    shift: Array  #: dx, shape (ngeom, 3) [m]
    turn: Array  #: w in the world frame, shape (ngeom, 3) [rad]
    arm: Array  #: vector from the body's origin to the geom's centre at s = 0, shape (ngeom, 3) [m]
    xmat: Array  #: the geom's rotation at s = 0, shape (ngeom, 3, 3)
    vertices: Array  #: flex vertices at s = 0, shape (V, 3) [m]
    travel: Array  #: displacement of flex vertices, shape (V, 3) [m]

    @classmethod
    def between(cls, model: Any, before: State, after: State) -> Step:
        """The step from ``before`` to ``after``."""
        from scipy.spatial.transform import Rotation

        body = model.geom_bodyid
        start = before.xmat.reshape(-1, 3, 3)
        between = after.xmat.reshape(-1, 3, 3) @ start.transpose(0, 2, 1)
        turn = Rotation.from_matrix(between).as_rotvec()
        same = (before.xmat == after.xmat).all(axis=1)
        turn[same] = 0.0
        return cls(
            origin=before.xpos[body],
            shift=(after.xpos - before.xpos)[body],
            turn=turn[body],
            arm=before.geom_xpos - before.xpos[body],
            xmat=before.geom_xmat.reshape(-1, 3, 3),
            vertices=before.flexvert_xpos,
            travel=after.flexvert_xpos - before.flexvert_xpos,
        )

    def poses(self, geoms: NDArray[Any], s: Array) -> tuple[Array, Array]:
        """Centres (K, 3) and rotations (K, 3, 3) of ``geoms`` (K,) at ``s`` (K,)."""
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_rotvec(s[:, None] * self.turn[geoms])
        center = self.origin[geoms] + s[:, None] * self.shift[geoms] + turn.apply(self.arm[geoms])
        return center, turn.as_matrix() @ self.xmat[geoms]

    def reach(self, geoms: NDArray[Any], radius: Array) -> Array:
        """Bound on how far rotation moves points within ``radius`` (K,) of a geom's centre [m]."""
        spin = np.linalg.norm(self.turn[geoms], axis=1)
        return np.asarray(spin * (np.linalg.norm(self.arm[geoms], axis=1) + radius))


#: A pair that never penetrates deeper than this is not scored [m].
TOLERANCE = 1e-5
#: Kinds of geoms that the ground truth can test against a flex.
FLEX_MEETS = ("plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")


@dataclass(frozen=True, eq=False)
class Touches:
    """Pairs that touch within one step, one per row.

    Attributes:
        geom: Geom id of each partner, -1 for a flex. Shape (K, 2).
        flex: Flex id of each partner, -1 for a geom. Shape (K, 2).
        time: Time of the first touch, as a fraction of the step. Shape (K,).
        depth: Largest depth found; the search ends above :data:`TOLERANCE`. Shape (K,), m.
        counts: Whether the row is scored: the depth exceeds :data:`TOLERANCE`. Shape (K,).
    """

    geom: Index
    flex: Index
    time: Array
    depth: Array
    counts: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.time)


class GroundTruth:
    """True contacts of geoms with each other and with flexes.

    ``mj_geomDistance`` computes the distance of two geoms. The distance of a flex element (a
    triangle of thickness 2 ``flex_radius``) from a sphere, capsule or plane has a closed form. From
    other convex geoms it is computed by GJK of the library coal. Margins are ignored. The code is
    slow and independent of the checkers.

    Args:
        model: MjModel.

    Raises:
        ArgumentError: a flex that is not two-dimensional, or that can touch a geom whose kind is
            not in :data:`FLEX_MEETS`.
    """

    def __init__(self, model: Any) -> None:
        """Find the pairs, and each geom's radius about its centre."""
        self.model = model
        self._data = mujoco.MjData(model)
        kinds = geom_kinds(model)
        self._pairs = geom_pairs(model)
        self._plane = np.array([kind == "plane" for kind in kinds], dtype=bool)
        self._radius = np.where(self._plane, 0.0, model.geom_rbound)
        self._meets: list[tuple[int, int, str]] = []
        for flex in range(model.nflex):
            for geom in flex_geoms(model, flex):
                name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, flex)
                if model.flex_dim[flex] != 2 or kinds[geom] not in FLEX_MEETS:
                    raise ArgumentError(
                        f"flex {name!r} (dim {model.flex_dim[flex]}) and geom "
                        f"{geom} ({kinds[geom]}): the ground truth handles flexes of dim 2 with "
                        f"{', '.join(FLEX_MEETS)}"
                    )
                self._meets.append((flex, geom, kinds[geom]))
        self.covers = frozenset(
            [pair_kind(kinds[i], kinds[j]) for i, j in self._pairs]
            + [pair_kind(kind, "flex") for _, _, kind in self._meets]
        )
        self._hulls = {
            geom: triangles.HullDistance(model, geom, kind)
            for _, geom, kind in self._meets
            if kind not in ("plane", "sphere", "capsule")
        }

    def touches(self, before: State, after: State) -> Touches:
        """The pairs that touch at some time between the two states."""
        step = Step.between(self.model, before, after)
        rows = self._rigid(step)
        for flex, geom, kind in self._meets:
            rows += self._soft(step, flex, geom, kind)
        rows.sort()
        columns: list[Any] = list(zip(*rows, strict=True)) if rows else [[] for _ in range(5)]
        return Touches(
            geom=np.array(columns[0], dtype=np.int32).reshape(-1, 2),
            flex=np.array(columns[1], dtype=np.int32).reshape(-1, 2),
            time=np.array(columns[2], dtype=np.float64),
            depth=np.array(columns[3], dtype=np.float64),
            counts=np.array(columns[4], dtype=bool),
        )

    def _rigid(self, step: Step) -> list[tuple[Any, ...]]:
        """Rows of :class:`Touches` of the rigid pairs."""
        i, j = self._pairs.T
        center, xmat = step.poses(np.arange(self.model.ngeom), np.zeros(self.model.ngeom))
        bound = (
            np.linalg.norm(step.shift[i] - step.shift[j], axis=1)
            + step.reach(i, self._radius[i])
            + step.reach(j, self._radius[j])
        )
        apart = np.linalg.norm(center[i] - center[j], axis=1)
        for plane, other in ((i, j), (j, i)):
            height = np.einsum("ij,ij->i", center[other] - center[plane], xmat[plane][:, :, 2])
            apart = np.where(self._plane[plane], height, apart)
        near = apart - self._radius[i] - self._radius[j] <= bound + TOLERANCE
        i, j = i[near], j[near]
        if not len(i):
            return []

        def distance(rows: NDArray[Any], s: Array) -> Array:
            return self._geom_distances(step, i[rows], j[rows], s)

        found = search(distance, bound[near], TOLERANCE)
        return [
            ((int(i[k]), int(j[k])), (-1, -1), *_row(found, k))
            for k in np.flatnonzero(np.isfinite(found.time))
        ]

    def _geom_distances(self, step: Step, i: NDArray[Any], j: NDArray[Any], s: Array) -> Array:
        data, out = self._data, np.empty(len(s))
        ci, ri = step.poses(i, s)
        cj, rj = step.poses(j, s)
        for k in range(len(s)):
            data.geom_xpos[i[k]], data.geom_xmat[i[k]] = ci[k], ri[k].ravel()
            data.geom_xpos[j[k]], data.geom_xmat[j[k]] = cj[k], rj[k].ravel()
            out[k] = mujoco.mj_geomDistance(self.model, data, int(i[k]), int(j[k]), 1e3, None)
        return out

    def _soft(self, step: Step, flex: int, geom: int, kind: str) -> list[tuple[Any, ...]]:
        """The row of a flex and a geom: first touch and largest depth over all elements."""
        model = self.model
        elements = flex_elements(model, flex)
        count = len(elements)
        corners, travel = step.vertices[elements], step.travel[elements]
        geoms = np.full(count, geom)
        bound = np.linalg.norm(travel - step.shift[geom], axis=2).max(axis=1)
        bound = bound + step.reach(geoms, self._radius[geoms])
        shape = self._soft_distance(geom, kind)
        thickness = float(model.flex_radius[flex])
        near = np.arange(count)
        if kind != "plane":
            center = step.origin[geom] + step.arm[geom]
            middle = corners.mean(axis=1)
            size = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
            apart = np.linalg.norm(middle - center, axis=1) - size - self._radius[geom]
            near = np.flatnonzero(apart - thickness <= bound + TOLERANCE)
        if not len(near):
            return []
        corners, travel = corners[near], travel[near]

        def distance(rows: NDArray[Any], s: Array) -> Array:
            center, xmat = step.poses(geoms[rows], s)
            now = corners[rows] + s[:, None, None] * travel[rows]
            return shape(center, xmat, now) - thickness

        found = search(distance, bound[near], TOLERANCE)
        if not np.isfinite(found.time).any():
            return []
        first, deepest = int(np.argmin(found.time)), float(found.depth.max())
        return [((geom, -1), (-1, flex), float(found.time[first]), deepest, deepest > TOLERANCE)]

    def _soft_distance(self, geom: int, kind: str) -> Callable[[Array, Array, Array], Array]:
        """Function (center, xmat, corners): distance of triangles from a posed geom [m]."""
        size = self.model.geom_size[geom]
        if kind == "plane":
            return lambda center, xmat, corners: np.asarray(
                np.einsum("kij,kj->ki", corners - center[:, None], xmat[:, :, 2]).min(axis=1)
            )
        if kind == "sphere":
            return lambda center, xmat, corners: triangles.point_triangle(center, corners) - size[0]
        if kind == "capsule":
            return lambda center, xmat, corners: (
                triangles.segment_triangle(
                    center - size[1] * xmat[:, :, 2], center + size[1] * xmat[:, :, 2], corners
                )
                - size[0]
            )
        return self._hulls[geom]


def _row(found: Found, k: Any) -> tuple[float, float, bool]:
    depth = float(found.depth[k])
    return float(found.time[k]), depth, depth > TOLERANCE
