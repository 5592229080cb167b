"""Whether two things have gone through one another: what is left of them meets on the way.

Of each geom 3 % of its half thickness is left, of each flex 3 % of its radius. Distances are
coal's;
the way between two poses is followed by conservative advancement, so that no moment is skipped.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import coal
import mujoco
import numpy as np
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from tauguard.arrays import Array
from tauguard.contacts.pairs import geom_flex_pairs, geom_pairs

#: Share of the half thickness that is left.
LEFT = 0.03
#: Cores nearer than this have met [m].
MEET = 1e-7
#: Distances of one pair on one way, at most.
MOST = 400
#: Of a triangle and of a tetrahedron.
_FACES = {3: [(0, 1, 2), (0, 2, 1)], 4: [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)]}


@dataclass(frozen=True)
class Poses:
    """Where everything is, and how bodies came there."""

    time: float
    body: Array  #: origins, shape (B, 3) [m]
    body_quat: Array  #: orientations, w first, shape (B, 4)
    turn: Array  #: rotation vectors from the poses before, shape (B, 3) [rad]
    geom: Array  #: middles, shape (G, 3) [m]
    geom_mat: Array  #: shape (G, 3, 3)
    vertices: Array  #: of flexes, shape (V, 3) [m]


class Deep:
    """Follows every pair of geoms that may touch, and every geom and simplex of a flex.

    Attributes:
        passed: The names of pairs whose cores have met, in order; "flex" stands for one.

    Args:
        model: MjModel.
        data: MjData in the first state. Pairs whose cores meet there are left out.
    """

    def __init__(self, model: Any, data: Any) -> None:
        """Make the cores."""
        self._model, self._scratch = model, mujoco.MjData(model)
        self._request, self._result = coal.DistanceRequest(), coal.DistanceResult()
        pairs, soft = geom_pairs(model), geom_flex_pairs(model)
        self._core = {g: core(model, g) for g in {*pairs.first, *pairs.second, *soft.first}}
        self._bound = np.where(model.geom_rbound > 0, model.geom_rbound, np.inf)
        self._reach = np.linalg.norm(model.geom_pos, axis=1) + model.geom_rbound
        self._soft = [
            (int(g), int(f), simplices(model, int(f)))
            for g, f in zip(soft.first, soft.second, strict=True)
        ]
        self.passed: list[tuple[str, str]] = []
        self._poses = self._read(data, None)
        rows = np.stack([pairs.first, pairs.second], axis=1)
        gaps = np.array([self._meets(a, b, self._poses, self._poses) for a, b in rows.tolist()])
        self._pairs, self._gaps = rows[gaps > 0], gaps[gaps > 0]

    def look(self, data: Any) -> None:
        """Follow the way from the state seen last to this one; not once something has passed."""
        if self.passed:
            return
        before, self._poses = self._poses, self._read(data, self._poses)
        after, body = self._poses, self._model.geom_bodyid
        turned = np.linalg.norm(after.turn[body], axis=1) * self._reach
        moved = np.linalg.norm(after.body[body] - before.body[body], axis=1) + turned
        a, b = self._pairs.T
        self._gaps -= moved[a] + moved[b]
        for k in np.flatnonzero(self._gaps <= 0).tolist():
            one, other = self._pairs[k].tolist()
            self._gaps[k] = self._meets(one, other, before, after)
            if self._gaps[k] <= 0:
                self.passed.append((self._model.geom(one).name, self._model.geom(other).name))
        for geom, flex, elements in self._soft:
            sweep = self._bound[geom] + moved[geom]
            if self._meets_flex(geom, flex, elements, sweep, before, after):
                self.passed.append((self._model.geom(geom).name, "flex"))

    def _read(self, data: Any, last: Poses | None) -> Poses:
        model, own = self._model, self._scratch
        own.qpos[:], own.qvel[:], own.time = data.qpos, data.qvel, data.time
        own.mocap_pos[:], own.mocap_quat[:] = data.mocap_pos, data.mocap_quat
        mujoco.mj_kinematics(model, own)
        if model.nflex:
            mujoco.mj_comPos(model, own)
            mujoco.mj_flex(model, own)
        turn = np.zeros((model.nbody, 3))
        if last is not None:
            turn = _turn(last.body_quat, own.xquat)
            if np.abs(own.qvel).max() * (own.time - last.time) > 1.0:
                mujoco.mj_comPos(model, own)
                mujoco.mj_comVel(model, own)
                turn = _whole_turns(turn, own.cvel[:, :3] * (own.time - last.time))
        return Poses(
            float(own.time),
            own.xpos.copy(),
            own.xquat.copy(),
            turn,
            own.geom_xpos.copy(),
            own.geom_xmat.reshape(-1, 3, 3).copy(),
            own.flexvert_xpos.copy() if model.nflex else np.zeros((0, 3)),
        )

    def _meets(self, one: int, other: int, before: Poses, after: Poses) -> float:
        """How far apart both cores are at the end; not above 0 if they meet on the way [m]."""
        moving = [
            _Body(self._model, g, self._core[g], self._reach, before, after) for g in (one, other)
        ]
        return self._closes(moving[0], moving[1], 0.0)

    def _meets_flex(
        self, geom: int, flex: int, elements: Any, sweep: float, before: Poses, after: Poses
    ) -> bool:
        """Whether the geom's core meets one of the simplices on this way."""
        radius = LEFT * float(self._model.flex_radius[flex])
        low = np.minimum(before.vertices, after.vertices)[elements].min(axis=1)
        high = np.maximum(before.vertices, after.vertices)[elements].max(axis=1)
        at = before.geom[geom]
        near = (at + sweep > low).all(axis=1) & (at - sweep < high).all(axis=1)
        near &= (self._model.flex_vertbodyid[elements] != self._model.geom_bodyid[geom]).all(axis=1)
        body = _Body(self._model, geom, self._core[geom], self._reach, before, after)
        return any(
            self._closes(body, _Simplex(before.vertices[e], after.vertices[e]), radius) <= 0
            for e in elements[near]
        )

    def _closes(self, a: _Body | _Simplex, b: _Body | _Simplex, radius: float) -> float:
        """Conservative advancement: the gap beyond ``radius`` at the end, or 0 if it closes [m]."""
        speed, t = float(np.linalg.norm(a.way - b.way)) + a.own_speed + b.own_speed, 0.0
        for _ in range(MOST):
            self._result.clear()
            gap = coal.distance(*a.at(t), *b.at(t), self._request, self._result) - radius
            if gap <= MEET:
                return 0.0
            if t >= 1 or t + gap / max(speed, 1e-300) >= 1:
                return max(float(gap - (1 - t) * speed), 1e-12)
            t += gap / speed
        return 0.0


class _Body:
    """A geom's core on its way: its body's origin goes straight and turns at a constant rate."""

    def __init__(
        self, model: Any, geom: int, shape: Any, reach: Array, before: Poses, after: Poses
    ) -> None:
        body = int(model.geom_bodyid[geom])
        self._shape, self._from = shape, before.body[body]
        self._arm, self._mat = before.geom[geom] - self._from, before.geom_mat[geom]
        self.way = after.body[body] - self._from
        self._turn = np.zeros(3) if before is after else after.turn[body]
        self._turns = bool(self._turn.any())
        self.own_speed = float(np.linalg.norm(self._turn) * reach[geom]) if self._turns else 0.0

    def at(self, t: float) -> tuple[Any, Any]:
        """Shape and place at a share of the way."""
        if not self._turns:
            return self._shape, coal.Transform3s(self._mat, self._from + t * self.way + self._arm)
        turn = _matrix(t * self._turn)
        return self._shape, coal.Transform3s(
            turn @ self._mat, self._from + t * self.way + turn @ self._arm
        )


def _matrix(turn: Array) -> Array:
    """Of a rotation vector (Rodrigues)."""
    quat, mat = np.zeros(4), np.zeros(9)
    angle = float(np.linalg.norm(turn))
    mujoco.mju_axisAngle2Quat(quat, turn / angle if angle else np.array([1.0, 0, 0]), angle)
    mujoco.mju_quat2Mat(mat, quat)
    return mat.reshape(3, 3)


class _Simplex:
    """Corners of a flex's simplex, which go straight."""

    def __init__(self, start: Array, end: Array) -> None:
        self._start, self._step = start, end - start
        self.way = self._step.mean(axis=0)
        self.own_speed = float(np.linalg.norm(self._step - self.way, axis=1).max())

    def at(self, t: float) -> tuple[Any, Any]:
        """Shape and place at a share of the way."""
        x = self._start + t * self._step
        if len(x) == 2:
            x = np.concatenate([x, x.mean(axis=0, keepdims=True)])
        return _convex(x, _FACES[len(x)]), coal.Transform3s.Identity()


def simplices(model: Any, flex: int) -> Any:
    """Of a flex, by the vertices of all flexes. Shape (E, corners)."""
    corners = int(model.flex_dim[flex]) + 1
    begin, count = int(model.flex_elemdataadr[flex]), int(model.flex_elemnum[flex])
    own = model.flex_elem[begin : begin + corners * count].reshape(-1, corners)
    return own + model.flex_vertadr[flex]


def _turn(before: Array, after: Array) -> Array:
    """Rotation vectors from one set of quaternions (N, 4) to another [rad]."""
    w, x = after[:, :1], after[:, 1:]
    v, y = before[:, :1], -before[:, 1:]
    real = w * v - (x * y).sum(axis=1, keepdims=True)
    axis = w * y + v * x + np.cross(x, y)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = 2 * np.arctan2(sine, np.abs(real)) * np.where(real < 0, -1, 1)
    return np.asarray(axis / np.where(sine > 0, sine, 1) * angle)


def _whole_turns(turn: Array, expected: Array) -> Array:
    """Rotation vectors (N, 3) [rad] with the whole turns added that bring them to ``expected``."""
    angle = np.linalg.norm(turn, axis=1)
    axis = turn / np.where(angle > 0, angle, 1)[:, None]
    whole = np.round(((expected * axis).sum(axis=1) - angle) / (2 * np.pi))
    return np.asarray(turn + 2 * np.pi * whole[:, None] * axis)


def core(model: Any, geom: int) -> Any:
    """What is left of a geom, in its own frame: a shape of coal's."""
    kind = mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
    size = np.asarray(model.geom_size[geom])
    if kind == "plane":
        return coal.Halfspace(np.array([0, 0, 1.0]), 0.0)
    if kind == "sphere":
        return coal.Sphere(LEFT * size[0])
    if kind == "capsule":
        return coal.Capsule(LEFT * size[0], 2 * size[1])
    if kind == "mesh":
        return _mesh_core(model, geom)
    least = size[:2].min() if kind == "cylinder" else size.min()
    own = size - (1 - LEFT) * least
    if kind == "cylinder":
        return coal.Cylinder(own[0], 2 * own[1])
    return coal.Box(*(2 * own)) if kind == "box" else coal.Ellipsoid(*own)


def _mesh_core(model: Any, geom: int) -> Any:
    """The convex hull with its faces moved inwards."""
    mesh = int(model.geom_dataid[geom])
    begin, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    points = np.asarray(model.mesh_vert[begin : begin + count], dtype=np.float64)
    faces = ConvexHull(points).equations
    rows = np.c_[faces[:, :3], np.ones(len(faces))]  # the largest ball: n.x + r <= -d
    best = linprog([0, 0, 0, -1], rows, -faces[:, 3], bounds=[(None, None)] * 4).x
    moved = faces + np.array([0, 0, 0, (1 - LEFT) * best[3]])
    try:
        points = np.unique(HalfspaceIntersection(moved, best[:3]).intersections.round(9), axis=0)
        hull = ConvexHull(points)
    except QhullError:
        points = best[:3] + LEFT * (points - best[:3])
        hull = ConvexHull(points)
    return _convex(points, hull.simplices)


def _convex(points: Any, faces: Any) -> Any:
    corners, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for x in points:
        corners.append(np.asarray(x, dtype=np.float64))
    for face in faces:
        triangles.append(coal.Triangle(*map(int, face)))
    return coal.Convex(corners, triangles)
