"""The target of a planned collision, and the obstacle or wrench that causes it."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.envs.episodes.episode import CollisionPlan
from tauguard.envs.episodes.labels import homogeneous
from tauguard.envs.episodes.motions import Motion
from tauguard.envs.episodes.poses import Poses, cross
from tauguard.models import Scene

#: Least speed of a link's surface when it meets a clamp [m/s].
CLAMP_SPEED = 0.005
#: Least and largest travel of the link's surface after it meets a clamp [m].
CLAMP_TRAVEL = (0.002, 0.06)
#: A clamp stays for its duration plus this time [s].
CLAMP_HOLD = 0.1
STRIDE = 0.02  #: interval at which targets are searched for along a motion [s]
CASTS = 8  #: number of rays at each of these times
CHUNK = 64  #: number of these times for which a clamp's travel is bounded at once
ROUNDING = 1e-9  #: more than the rounding errors of these bounds [m]
#: Geoms of which ``size[1]`` is half the length of the axis, or 0; a point drawn on it is inside.
AXIAL = (
    mujoco.mjtGeom.mjGEOM_SPHERE,
    mujoco.mjtGeom.mjGEOM_CAPSULE,
    mujoco.mjtGeom.mjGEOM_CYLINDER,
)
#: A striker starts this time before it reaches its target [s].
LEAD = 0.15


@dataclass(frozen=True)
class Target:
    """Where an obstacle meets a link: a point of the surface and the direction of the push."""

    row: int  #: sample of the motion
    body: int  #: MuJoCo body of the link
    point: Array  #: on the surface, world frame [m]
    direction: Array  #: unit vector of the push on the link, world frame
    velocity: Array  #: of the surface point [m/s]


@dataclass(frozen=True)
class _LinkPath:
    """Poses of a link and of the arm's joints at R rows of the motion.

    For a clamp the link's poses continue after these rows, for as long as the clamp stands.
    """

    rows: list[int]  #: row numbers, R of them
    body: int  #: MuJoCo body of the link
    position: Array  #: of the link's origin [m], shape (R or more, 3)
    rotation: Array  #: of the link, shape (R or more, 3, 3)
    anchor: Array  #: on the joints' axes [m], shape (R, n, 3)
    axis: Array  #: of the joints, shape (R, n, 3)
    speed: Array  #: of the link's origin [m/s], shape (R, 3)
    spin: Array  #: of the link [rad/s], shape (R, 3)

    def velocity(self, number: int, points: Array) -> Array:
        """Velocity of points of the link, shape (..., 3), at the ``number``-th row [m/s]."""
        arm = points - self.position[number]
        return np.asarray(self.speed[number] + cross(self.spin[number], arm))


class Aim:
    """Finds surface points of a scene's links by ray casting along a motion."""

    def __init__(self, scene: Scene, motion: Motion) -> None:
        """Prepare the scene's collision geometry and the motion's references."""
        self._scene, self._motion = scene, motion
        self._data, self._poses = mujoco.MjData(scene.model), Poses(scene)
        self._dt = float(motion.t[1] - motion.t[0])
        self._stride = max(1, round(STRIDE / self._dt))
        model = scene.model
        links = np.isin(model.geom_bodyid, scene.link_bodies)
        solid = links & ((model.geom_contype != 0) | (model.geom_conaffinity != 0))
        self._groups = np.zeros(6, dtype=np.uint8)
        self._groups[model.geom_group[solid]] = 1
        self._geoms = [
            np.flatnonzero(solid & (model.geom_bodyid == body)).tolist()
            for body in scene.link_bodies
        ]
        #: Direction of each geom's axis in its body.
        self._lines = homogeneous(model.geom_pos, model.geom_quat)[:, :3, 2]
        self._still = np.abs(motion.qd).max(axis=1) <= 1e-9

    def find(self, plan: CollisionPlan, rng: np.random.Generator, last: int) -> Target | None:
        """The first target for ``plan`` from its time up to sample ``last``; None without one."""
        first = round(plan.time / self._dt)
        path = self._link_path(plan, range(first, max(first + 1, last), self._stride))
        usable = self._quick_enough(plan, path)
        for number, row in enumerate(path.rows):
            if plan.kind == "clamp" and not plan.at_rest and number % CHUNK == 0:
                some = slice(number, number + CHUNK)
                usable[some] &= self._may_stop_soon(
                    plan, path, np.arange(len(path.rows))[some], rng
                )
            if plan.at_rest and not self._still[row]:
                continue
            if not usable[number]:
                self._draw(plan, rng, CASTS)
                continue
            target = self._cast(plan, path, number, rng)
            if target is not None:
                return target
        return None

    def _link_path(self, plan: CollisionPlan, rows: range) -> _LinkPath:
        body = int(self._scene.link_bodies[plan.link - 1])
        longer = self._standing(plan) if plan.kind == "clamp" else 1
        stops = slice(rows.start, rows[-1] + longer, self._stride)
        position, rotation = self._poses.body(self._motion.q[stops], body)
        at = np.array(rows)
        anchor, axis = self._poses.joints(self._motion.q[at])
        speed, spin = np.zeros((len(at), 3)), np.zeros((len(at), 3))
        for joint in self._poses.moving[plan.link - 1]:
            turn = self._motion.qd[at, joint, None] * axis[:, joint]
            if self._poses.sliding[joint]:
                speed += turn
            else:
                spin += turn
                speed += cross(turn, position[: len(at)] - anchor[:, joint])
        return _LinkPath(list(rows), body, position, rotation, anchor, axis, speed, spin)

    def _quick_enough(self, plan: CollisionPlan, path: _LinkPath) -> NDArray[np.bool_]:
        """The rows at which some point of :meth:`_draw` can be fast enough for a clamp.

        The points lie on a line in each geom. Speed is convex along a line, so it is largest at an
        end of the line.
        """
        if plan.kind != "clamp":
            return np.ones(len(path.rows), dtype=bool)
        model, count = self._scene.model, len(path.rows)
        fastest = np.zeros(count)
        for geom in self._geoms[plan.link - 1]:
            for end in (-0.8, 0.8):
                local = model.geom_pos[geom] + end * model.geom_size[geom, 1] * self._lines[geom]
                speed = path.speed + cross(path.spin, path.rotation[:count] @ local)
                fastest = np.maximum(fastest, np.linalg.norm(speed, axis=1))
        return fastest > 0.999 * CLAMP_SPEED

    def _may_stop_soon(
        self, plan: CollisionPlan, path: _LinkPath, rows: NDArray[np.intp], rng: np.random.Generator
    ) -> NDArray[np.bool_]:
        """Whether a ray that :meth:`_cast` would draw at these successive rows may give a clamp.

        The ray of push p through the point x of a geom meets the link's surface at x - m p. There m
        is at most the distance M from x to the link's farthest point, and at least 0 if x is in
        the link, otherwise -M. While the link turns by R, this point travels -p.dx - m (1 - p.R p)
        against p, which falls with m.
        """
        before, model, size = rng.bit_generator.state, self._scene.model, (len(rows), CASTS, -1)
        geoms, places, _ = self._draw(plan, rng, len(rows) * CASTS)
        rng.bit_generator.state = before
        local = (model.geom_pos[geoms] + places[:, None] * self._lines[geoms]).reshape(size)
        position, rotation = path.position[rows, None], path.rotation[rows]
        inside = local @ rotation.transpose(0, 2, 1)
        velocity = path.speed[rows, None] + cross(path.spin[rows, None], inside)
        speed = np.linalg.norm(velocity, axis=2)
        push = -velocity / np.maximum(speed, ROUNDING)[..., None]
        own = np.flatnonzero(model.geom_bodyid == path.body)
        away = np.linalg.norm(local[:, :, None] - model.geom_pos[own], axis=3)
        depth = (away + model.geom_rbound[own]).max(axis=2)
        within = np.isin(model.geom_type[geoms], AXIAL).reshape(depth.shape)
        later = rows[:, None] + np.arange(len(range(0, self._standing(plan), self._stride)))
        later = np.minimum(later, len(path.position) - 1)
        turned = path.rotation[later].reshape(*later.shape, 9)
        moved = np.concatenate([path.position[later] - position, turned], axis=2)

        def travel(deep: Array) -> Array:
            lever = deep[..., None] * (push @ rotation) - local
            factors = (push[..., None] * lever[..., None, :]).reshape(*deep.shape, 9)
            factors = np.concatenate([-push, factors], axis=2)
            end = (moved @ factors.transpose(0, 2, 1)).max(axis=1)
            return np.asarray(end + (push * inside).sum(axis=2) - deep)

        possible = speed >= CLAMP_SPEED - ROUNDING
        possible &= travel(np.where(within, 0.0, -depth)) >= CLAMP_TRAVEL[0] - ROUNDING
        possible &= travel(depth) <= CLAMP_TRAVEL[1] + ROUNDING
        return np.asarray(possible.any(axis=1))

    def _draw(
        self, plan: CollisionPlan, rng: np.random.Generator, count: int
    ) -> tuple[list[int], Array, Array]:
        """Draw ``count`` rays: geoms, places along the geoms' axes, pushes (0 for a clamp)."""
        own, size = self._geoms[plan.link - 1], self._scene.model.geom_size
        if plan.kind == "clamp" and len(own) == 1:  # the loop would draw the same numbers
            reach = float(size[own[0], 1]) * 0.8
            return own * count, rng.uniform(-reach, reach, count), np.zeros((count, 3))
        geoms, places, pushes = [], np.empty(count), np.zeros((count, 3))
        for k in range(count):
            geom = own[int(rng.integers(len(own)))]
            reach = float(size[geom, 1]) * 0.8
            geoms.append(geom)
            places[k] = rng.uniform(-reach, reach)
            if plan.kind != "clamp":
                pushes[k] = rng.normal(size=3)
        return geoms, places, pushes

    def _cast(
        self, plan: CollisionPlan, path: _LinkPath, number: int, rng: np.random.Generator
    ) -> Target | None:
        """The first target of :data:`CASTS` rays at a row; None without one.

        Afterwards ``rng`` has drawn only the rays up to the target.
        """
        data = self._data
        data.qpos[self._scene.qpos_adr] = self._motion.q[path.rows[number]]
        mujoco.mj_kinematics(self._scene.model, data)
        before = rng.bit_generator.state
        geoms, places, pushes = self._draw(plan, rng, CASTS)
        inside = data.geom_xpos[geoms] + data.geom_xmat[geoms][:, 2::3] * places[:, None]
        if plan.kind == "clamp":
            pushes = -path.velocity(number, inside)
        size = np.sqrt((pushes**2).sum(axis=1))
        quick = size >= (CLAMP_SPEED if plan.kind == "clamp" else 0.0)
        pushes /= np.where(size > 0, size, 1.0)[:, None]
        points, hit = self._hits(path.body, inside, pushes, quick)
        if not hit.any():
            return None
        if plan.kind == "clamp":
            hit &= self._stops_soon(plan, path, number, points, pushes)
        for taken in np.flatnonzero(hit):
            point, push = points[taken], pushes[taken]
            if self._reaches(plan, path, number, point, push):
                rng.bit_generator.state = before
                self._draw(plan, rng, int(taken) + 1)
                speed = path.velocity(number, point)
                return Target(path.rows[number], path.body, point, push, speed)
        return None

    def _hits(
        self, body: int, inside: Array, pushes: Array, wanted: NDArray[np.bool_]
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Where rays towards points in a body meet it, and whether they meet this body first."""
        model, geom, normal = self._scene.model, np.full(1, -1, dtype=np.int32), np.zeros(3)
        origins, distances = inside - 2.0 * pushes, np.zeros(len(inside))
        hit = wanted.copy()
        for k in np.flatnonzero(wanted):
            distances[k] = mujoco.mj_ray(
                model, self._data, origins[k], pushes[k], self._groups, 1, -1, geom, normal
            )
            hit[k] = distances[k] >= 0 and model.geom_bodyid[geom[0]] == body
        return origins + distances[:, None] * pushes, hit

    def _reaches(
        self, plan: CollisionPlan, path: _LinkPath, number: int, point: Array, push: Array
    ) -> bool:
        """Whether some force in the plan's range gives a torque in its severity range at a row."""
        if plan.severity is None or plan.force is None:
            return True
        levers = [0.0]
        for joint in self._poses.moving[plan.link - 1]:
            along = path.axis[number, joint]
            arm = (
                push
                if self._poses.sliding[joint]
                else cross(point - path.anchor[number, joint], push)
            )
            levers += [abs(float(along @ arm))] if joint < 4 else []
        low, high = plan.severity
        return low < max(levers) * plan.force[1] and max(levers) * plan.force[0] < high

    def _standing(self, plan: CollisionPlan) -> int:
        return round((plan.duration + CLAMP_HOLD) / self._dt)

    def _stops_soon(
        self, plan: CollisionPlan, path: _LinkPath, number: int, points: Array, pushes: Array
    ) -> NDArray[np.bool_]:
        """Whether the surface moves on by a distance within :data:`CLAMP_TRAVEL`.

        It then presses against the clamp and does not sweep past it.
        """
        count = len(range(0, self._standing(plan), self._stride))
        stand = slice(number, number + count)
        position, rotation = path.position[stand], path.rotation[stand]
        local = (points - position[0]) @ rotation[0]
        # Position of each point along its push, relative to its start; shape (rows, points).
        turned = np.einsum("pi,tij,pj->tp", pushes, rotation, local)
        along = turned + position @ pushes.T - (points * pushes).sum(axis=1)
        reach = (-along).max(axis=0)
        return np.asarray((reach >= CLAMP_TRAVEL[0]) & (reach <= CLAMP_TRAVEL[1]))


def pulse_wrench(target: Target, lever: Array, force: float, duration: float, dt: float) -> Array:
    """A half-sine force along the target's direction, as a wrench about the centre of mass.

    Args:
        target: direction of the force.
        lever: from the link's centre of mass to the point of the force, shape (T, 3) [m].
        force: peak of the force [N].
        duration: duration of the force [s], from the first sample on.
        dt: time between two samples [s].

    Returns:
        Force [N] and torque [N m], world frame, shape (T, 6).
    """
    t = np.arange(len(lever)) * dt
    size = np.where((t > 0) & (t < duration), np.sin(np.pi * np.clip(t / duration, 0, 1)), 0.0)
    pushes = force * size[:, None] * target.direction
    return np.concatenate([pushes, cross(lever, pushes)], axis=1)


def launch(target: Target, speed: float, radius: float) -> tuple[Array, Array]:
    """Start position and velocity of a striker that reaches the target after :data:`LEAD` seconds.

    ``speed`` is relative to the target's surface point, along the push [m/s].
    """
    velocity = target.velocity + speed * target.direction
    centre = target.point - radius * target.direction
    return centre - LEAD * velocity, velocity


def clamp_centre(target: Target, path: Array, depth: float, radius: float) -> Array:
    """Centre of a fixed sphere into which the reference motion runs ``depth`` metres.

    Args:
        target: the surface point that meets the sphere.
        path: path of that point in the reference motion while the clamp stands, shape (T, 3) [m].
        depth: how far the point would go past the sphere's surface [m].
        radius: radius of the sphere [m].
    """
    ahead = float((-(path - target.point) @ target.direction).max(initial=0.0))
    return target.point - (ahead - depth + radius) * target.direction
