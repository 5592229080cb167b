"""Which bodies and flexes passed through each other? Decided by eroded shapes that meet.

Each geom is eroded to 3 % of its half thickness, each flex to 3 % of its radius. Two that start
apart and whose eroded shapes meet have passed through each other. coal computes distances.
Conservative advancement follows the path between two states, so that no moment is skipped.
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

#: Fraction of the half thickness that erosion leaves.
LEFT = 0.03
#: Pairs whose eroded shapes are closer than this fraction of both half thicknesses at the start
#: are in each other already.
SUNK = 0.1
#: Eroded shapes closer than this have met [m].
MEET = 1e-7
#: Most distance queries of one pair on one path; a pair that needs more is not judged.
MOST = 20_000
#: Faces of a triangle and of a tetrahedron.
_FACES = {3: [(0, 1, 2), (0, 2, 1)], 4: [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)]}


@dataclass(frozen=True)
class Poses:
    """Poses of one state, and the rotations since the state before."""

    time: float
    body: Array  #: origins, shape (B, 3) [m]
    body_quat: Array  #: orientations, w first, shape (B, 4)
    turn: Array  #: rotation vectors since the state before, shape (B, 3) [rad]
    geom: Array  #: centres, shape (G, 3) [m]
    geom_mat: Array  #: rotations, shape (G, 3, 3)
    vertices: Array  #: vertices of flexes, shape (V, 3) [m]


class Tunnelling:
    """Follows every pair of geoms that may touch, and every geom and simplex of a flex.

    Pairs of two flexes are not followed.

    Attributes:
        pairs: Names of the pairs that passed through each other, in order; "flex" names any flex.
        undecided: Paths that took too many distance queries to be followed to their ends.

    Args:
        model: MjModel.
        data: MjData in the first state. Pairs whose eroded shapes meet there, or nearly, are left
            out.
    """

    def __init__(self, model: Any, data: Any) -> None:
        """Make the eroded shapes."""
        self._model, self._scratch = model, mujoco.MjData(model)
        self._request, self._result = coal.DistanceRequest(), coal.DistanceResult()
        rows, soft = may_touch(model), may_touch_flexes(model)
        self._eroded = {g: eroded(model, g) for g in {*rows.ravel(), *(g for g, _ in soft)}}
        self._soft = [(g, f, simplices(model, f)) for g, f in soft]
        self.pairs: list[tuple[str, str]] = []
        self.undecided = 0
        self._poses = self._read(data, None)
        self._bound = np.array([_radius(model, g) for g in range(model.ngeom)])
        arm = np.linalg.norm(self._poses.geom - self._poses.body[model.geom_bodyid], axis=1)
        self._reach = arm + np.where(np.isfinite(self._bound), self._bound, 0.0)
        apart = np.array([self._distance(a, b, self._poses, self._poses) for a, b in rows.tolist()])
        thin = np.array([half_thickness(model, g) for g in range(model.ngeom)])
        free = apart > SUNK * thin[rows].sum(axis=1)
        self._pairs, self._apart, here = rows[free], apart[free], self._poses
        self._soft = [
            (g, f, e[~self._meeting(g, f, e, self._bound[g], here, here, SUNK * thin[g])])
            for g, f, e in self._soft
        ]

    def observe(self, data: Any) -> None:
        """Follow the path from the last state to this one; ends at the first pair that passed."""
        if self.pairs or not np.isfinite(data.qpos).all():
            return
        before, self._poses = self._poses, self._read(data, self._poses)
        after, body = self._poses, self._model.geom_bodyid
        turned = np.linalg.norm(after.turn[body], axis=1) * self._reach
        moved = np.linalg.norm(after.body[body] - before.body[body], axis=1) + turned
        a, b = self._pairs.T
        self._apart -= moved[a] + moved[b]
        for k in np.flatnonzero(self._apart <= 0).tolist():
            one, other = self._pairs[k].tolist()
            self._apart[k] = self._distance(one, other, before, after)
            if self._apart[k] <= 0:
                self.pairs.append((self._model.geom(one).name, self._model.geom(other).name))
        for geom, flex, elements in self._soft:
            sweep = self._bound[geom] + moved[geom]
            if self._meeting(geom, flex, elements, sweep, before, after).any():
                self.pairs.append((self._model.geom(geom).name, "flex"))

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

    def _distance(self, one: int, other: int, before: Poses, after: Poses) -> float:
        """Lower bound of the eroded shapes' final distance [m]; 0 if they meet on the path."""
        moving = [
            _Body(self._model, g, self._eroded[g], self._reach, before, after) for g in (one, other)
        ]
        return self._advance(moving[0], moving[1], 0.0)

    def _meeting(
        self,
        geom: int,
        flex: int,
        elements: Any,
        sweep: float,
        before: Poses,
        after: Poses,
        near_by: float = 0.0,
    ) -> Any:
        """By simplex: whether the eroded geom comes within ``near_by`` [m] of it. Shape (E,)."""
        radius = near_by + (SUNK if near_by else LEFT) * float(self._model.flex_radius[flex])
        low = np.minimum(before.vertices, after.vertices)[elements].min(axis=1)
        high = np.maximum(before.vertices, after.vertices)[elements].max(axis=1)
        at = before.geom[geom]
        sweep += radius
        near = (at + sweep > low).all(axis=1) & (at - sweep < high).all(axis=1)
        near &= (self._model.flex_vertbodyid[elements] != self._model.geom_bodyid[geom]).all(axis=1)
        body = _Body(self._model, geom, self._eroded[geom], self._reach, before, after)
        for k in np.flatnonzero(near).tolist():
            e = elements[k]
            flat = _Simplex(before.vertices[e], after.vertices[e])
            near[k] = self._advance(body, flat, radius) <= 0
        return near

    def _advance(self, a: _Body | _Simplex, b: _Body | _Simplex, radius: float) -> float:
        """Conservative advancement: final distance less ``radius`` [m]; 0 if it vanishes before."""
        speed, t = float(np.linalg.norm(a.shift - b.shift)) + a.own_speed + b.own_speed, 0.0
        for _ in range(MOST):
            self._result.clear()
            distance = coal.distance(*a.at(t), *b.at(t), self._request, self._result) - radius
            if distance <= MEET:
                return 0.0
            if np.isnan(distance):  # coal could not tell
                break
            if t >= 1 or t + distance / max(speed, 1e-300) >= 1:
                return max(float(distance - (1 - t) * speed), 1e-12)
            t += distance / speed
        self.undecided += 1
        return 1e-12


class _Body:
    """A moving eroded geom: its body's origin moves straight and turns at a constant rate."""

    def __init__(
        self, model: Any, geom: int, shape: Any, reach: Array, before: Poses, after: Poses
    ) -> None:
        body = int(model.geom_bodyid[geom])
        self._shape, self._from = shape, before.body[body]
        self._arm, self._mat = before.geom[geom] - self._from, before.geom_mat[geom]
        self.shift = after.body[body] - self._from
        self._turn = np.zeros(3) if before is after else after.turn[body]
        self._turns = bool(self._turn.any())
        self.own_speed = float(np.linalg.norm(self._turn) * reach[geom]) if self._turns else 0.0

    def at(self, t: float) -> tuple[Any, Any]:
        """Shape and pose at a fraction ``t`` of the path."""
        if not self._turns:
            return self._shape, coal.Transform3s(self._mat, self._from + t * self.shift + self._arm)
        turn = _matrix(t * self._turn)
        return self._shape, coal.Transform3s(
            turn @ self._mat, self._from + t * self.shift + turn @ self._arm
        )


def _matrix(turn: Array) -> Array:
    """Rotation matrix of a rotation vector [rad] (Rodrigues)."""
    quat, mat = np.zeros(4), np.zeros(9)
    angle = float(np.linalg.norm(turn))
    mujoco.mju_axisAngle2Quat(quat, turn / angle if angle else np.array([1.0, 0, 0]), angle)
    mujoco.mju_quat2Mat(mat, quat)
    return mat.reshape(3, 3)


class _Simplex:
    """A simplex of a flex, whose corners move straight."""

    def __init__(self, start: Array, end: Array) -> None:
        self._start, self._step = start, end - start
        self.shift = self._step.mean(axis=0)
        self.own_speed = float(np.linalg.norm(self._step - self.shift, axis=1).max())

    def at(self, t: float) -> tuple[Any, Any]:
        """Shape and pose at a fraction ``t`` of the path."""
        x = self._start + t * self._step
        if len(x) == 2:
            x = np.concatenate([x, x.mean(axis=0, keepdims=True)])
        return _convex(x, _FACES[len(x)]), coal.Transform3s.Identity()


#: Kinds of geoms that are followed.
_FOLLOWED = ("PLANE", "SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX", "MESH")


def _followed(model: Any) -> Any:
    kinds = [int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}")) for kind in _FOLLOWED]
    return np.isin(model.geom_type, kinds)


def may_touch(model: Any, followed: bool = True) -> Any:
    """Geoms that MuJoCo lets meet, by its manual's rules. Shape (P, 2), lower id first.

    Args:
        model: MjModel.
        followed: Without height fields and signed distance fields.
    """
    off = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    if model.opt.disableflags & off:
        return np.zeros((0, 2), dtype=int)
    chosen = np.zeros((model.ngeom, model.ngeom), dtype=bool)
    weld, kinds = model.body_weldid, mujoco.mjtGeom
    filtered = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    excluded, highest = set(), -1
    for signature in model.exclude_signature.tolist():  # read once, beside sorted pairs of bodies
        if signature > highest:
            excluded.add(divmod(signature, 1 << 16))
        highest = max(highest, signature)
    for a in range(model.nbody):
        for b in range(a + 1, model.nbody):
            one, other = int(weld[a]), int(weld[b])
            still = model.body_dofnum[one] == 0 and model.body_dofnum[other] == 0
            masks = model.body_contype[a] & model.body_conaffinity[b]
            if not masks | (model.body_conaffinity[a] & model.body_contype[b]):
                continue
            if one == other or still or (a, b) in excluded:
                continue
            child = (
                one == weld[model.body_parentid[other]] or other == weld[model.body_parentid[one]]
            )
            if filtered and child and one != 0 and other != 0:
                continue
            first, second = (
                model.body_geomadr[k] + np.arange(model.body_geomnum[k]) for k in (a, b)
            )
            masks = model.geom_contype[first][:, None] & model.geom_conaffinity[second]
            back = model.geom_conaffinity[first][:, None] & model.geom_contype[second]
            chosen[np.ix_(first, second)] = (masks | back) != 0
    tested = _in_trees(model)
    chosen &= tested[:, None] & tested
    chosen[model.pair_geom1, model.pair_geom2] = True
    chosen |= chosen.T
    flat = np.isin(model.geom_type, [int(kinds.mjGEOM_PLANE), int(kinds.mjGEOM_HFIELD)])
    chosen &= ~(flat[:, None] & flat)
    if followed:
        chosen &= _followed(model)[:, None] & _followed(model)
    return np.argwhere(np.triu(chosen, 1))


def may_touch_flexes(model: Any) -> list[tuple[int, int]]:
    """Geoms, of those that are followed, and flexes that MuJoCo lets meet."""
    off = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    if model.opt.disableflags & off:
        return []
    meets = np.ones((model.ngeom, model.nflex), dtype=bool)
    of = model.geom_bodyid
    for contype, conaffinity in (
        (model.geom_contype, model.geom_conaffinity),
        (model.body_contype[of], model.body_conaffinity[of]),
    ):
        masks = contype[:, None] & model.flex_conaffinity
        meets &= (masks | (conaffinity[:, None] & model.flex_contype)) != 0
    found = np.argwhere(meets & (_followed(model) & _in_trees(model))[:, None])
    return [(int(g), int(f)) for g, f in found]


def _in_trees(model: Any) -> Any:
    """Whether MuJoCo finds a geom: bodies of several geoms have trees of those with masks."""
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_MIDPHASE:
        return np.ones(model.ngeom, dtype=bool)
    leaves = {
        int(node)
        for body in range(model.nbody)
        for node in model.bvh_nodeid[model.body_bvhadr[body] :][: model.body_bvhnum[body]]
    }
    alone = model.body_geomnum[model.geom_bodyid] == 1
    return np.array([alone[g] or g in leaves for g in range(model.ngeom)], dtype=bool)


def _radius(model: Any, geom: int) -> float:
    """Of a ball around a geom's centre that contains it [m]; infinite for a plane."""
    kind = mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
    size = np.abs(model.geom_size[geom])
    if kind == "mesh":
        return float(np.linalg.norm(_mesh_points(model, geom), axis=1).max())
    if kind in ("plane", "hfield", "sdf"):
        return float(np.inf)
    return float(
        {"sphere": size[0], "capsule": size[:2].sum(), "cylinder": np.hypot(*size[:2])}.get(
            kind, np.linalg.norm(size)
        )
    )


def simplices(model: Any, flex: int) -> Any:
    """Simplices of a flex as indices into the vertices of all flexes. Shape (E, corners)."""
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
    """Rotation vectors (N, 3) [rad] plus the whole turns that bring them nearest ``expected``."""
    angle = np.linalg.norm(turn, axis=1)
    axis = turn / np.where(angle > 0, angle, 1)[:, None]
    whole = np.round(((expected * axis).sum(axis=1) - angle) / (2 * np.pi))
    return np.asarray(turn + 2 * np.pi * whole[:, None] * axis)


def half_thickness(model: Any, geom: int) -> float:
    """Half the least thickness of a geom [m]; 0 of a plane."""
    kind = mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
    size = np.abs(model.geom_size[geom])
    if kind == "mesh":
        return _inner_ball(ConvexHull(_mesh_points(model, geom)).equations)[1]
    if kind in ("plane", "hfield", "sdf"):
        return 0.0
    least = {"sphere": size[:1], "capsule": size[:1], "cylinder": size[:2]}.get(kind, size)
    return float(least.min())


def eroded(model: Any, geom: int) -> Any:
    """The eroded shape of a geom in its own frame, as a shape of coal's."""
    kind = mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
    size = np.asarray(model.geom_size[geom])
    if kind == "plane":
        return coal.Halfspace(np.array([0, 0, 1.0]), 0.0)
    if kind == "sphere":
        return coal.Sphere(LEFT * size[0])
    if kind == "capsule":
        return coal.Capsule(LEFT * size[0], 2 * size[1])
    if kind == "mesh":
        return _eroded_mesh(model, geom)
    least = size[:2].min() if kind == "cylinder" else size.min()
    own = size - (1 - LEFT) * least
    if kind == "cylinder":
        return coal.Cylinder(own[0], 2 * own[1])
    return coal.Box(*(2 * own)) if kind == "box" else coal.Ellipsoid(*own)


def _eroded_mesh(model: Any, geom: int) -> Any:
    """The convex hull with its faces moved inwards."""
    points = _mesh_points(model, geom)
    faces = ConvexHull(points).equations
    middle, radius = _inner_ball(faces)
    moved = faces + np.array([0, 0, 0, (1 - LEFT) * radius])
    try:
        points = np.unique(HalfspaceIntersection(moved, middle).intersections.round(9), axis=0)
        hull = ConvexHull(points)
    except QhullError:
        points = middle + LEFT * (points - middle)
        hull = ConvexHull(points)
    return _convex(points, hull.simplices)


def _inner_ball(faces: Array) -> tuple[Array, float]:
    """Centre and radius of the largest ball in a hull: n.x + r <= -d for each face."""
    rows = np.c_[faces[:, :3], np.ones(len(faces))]
    best = linprog([0, 0, 0, -1], rows, -faces[:, 3], bounds=[(None, None)] * 4).x
    return best[:3], float(best[3])


def _mesh_points(model: Any, geom: int) -> Array:
    mesh = int(model.geom_dataid[geom])
    begin, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    return np.asarray(model.mesh_vert[begin : begin + count], dtype=np.float64)


def _convex(points: Any, faces: Any) -> Any:
    corners, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for x in points:
        corners.append(np.asarray(x, dtype=np.float64))
    for face in faces:
        triangles.append(coal.Triangle(*map(int, face)))
    return coal.Convex(corners, triangles)
