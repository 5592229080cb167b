"""How a planned collision is carried out: where it strikes, and what the loop must do for it."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.envs.episode import CollisionPlan
from tauguard.envs.motions import Motion
from tauguard.models import Scene

Array = NDArray[np.float64]

#: A clamp needs a link that moves at least this fast [m/s] to run into it.
CLAMP_SPEED = 0.005
#: Shortest and longest way of the link's surface past the sample of a clamp [m].
CLAMP_TRAVEL = (0.002, 0.06)
#: A clamp stands for its duration and this long [s]; its path is looked at in strides of [s].
CLAMP_HOLD, CLAMP_STRIDE = 0.1, 0.02
#: An obstacle is in place this long before it touches [s].
LEAD = 0.15


@dataclass(frozen=True)
class Target:
    """Where an obstacle meets a link: a point of its surface and the way towards it."""

    row: int  #: sample of the motion
    body: int  #: MuJoCo body of the link
    point: Array  #: on the surface, world frame [m]
    direction: Array  #: unit vector of the push on the link, world frame
    velocity: Array  #: of the surface point [m/s]


class Aim:
    """Finds surface points of a scene's links by ray casting along a motion."""

    def __init__(self, scene: Scene, motion: Motion) -> None:
        """For the scene's collision geometry and the motion's references."""
        self._scene, self._motion = scene, motion
        self._data = mujoco.MjData(scene.model)
        self._ahead = mujoco.MjData(scene.model)
        model = scene.model
        links = np.isin(model.geom_bodyid, scene.link_bodies)
        self._solid = links & ((model.geom_contype != 0) | (model.geom_conaffinity != 0))
        self._groups = np.zeros(6, dtype=np.uint8)
        self._groups[model.geom_group[self._solid]] = 1

    def find(self, plan: CollisionPlan, rng: np.random.Generator, last: int) -> Target | None:
        """A target for ``plan`` at the first sample that offers one, up to sample ``last``."""
        dt = float(self._motion.t[1] - self._motion.t[0])
        first = round(plan.time / dt)
        for row in range(first, max(first + 1, last), max(1, round(0.02 / dt))):
            if plan.at_rest and np.abs(self._motion.qd[row]).max() > 1e-9:
                continue
            self._pose(row)
            for _ in range(8):
                target = self._cast(plan, row, rng)
                if target is not None:
                    return target
        return None

    def _pose(self, row: int) -> None:
        scene, data = self._scene, self._data
        data.qpos[scene.qpos_adr] = self._motion.q[row]
        data.qvel[:] = 0
        data.qvel[scene.dof_adr] = self._motion.qd[row]
        mujoco.mj_kinematics(scene.model, data)
        mujoco.mj_comPos(scene.model, data)

    def _cast(self, plan: CollisionPlan, row: int, rng: np.random.Generator) -> Target | None:
        scene, data = self._scene, self._data
        body = int(scene.link_bodies[plan.link - 1])
        inside = self._inside(body, rng)
        if plan.kind == "clamp":
            velocity = self._velocity(body, inside)
            speed = float(np.linalg.norm(velocity))
            if speed < CLAMP_SPEED:
                return None
            push = -velocity / speed
        else:
            push = rng.normal(size=3)
            push /= np.linalg.norm(push)
        origin = inside - 2.0 * push
        geom = np.full(1, -1, dtype=np.int32)
        distance = mujoco.mj_ray(
            scene.model, data, origin, push, self._groups, 1, -1, geom, np.zeros(3)
        )
        if distance < 0 or scene.model.geom_bodyid[geom[0]] != body:
            return None
        point = origin + distance * push
        if not self._reaches(plan, body, point, push):
            return None
        if plan.kind == "clamp" and not self._stops_soon(plan, row, body, point, push):
            return None
        return Target(row, body, point, push, self._velocity(body, point))

    def _reaches(self, plan: CollisionPlan, body: int, point: Array, push: Array) -> bool:
        """Whether some force of the plan's range gives a torque of its severity here."""
        if plan.severity is None or plan.force is None:
            return True
        model, jac = self._scene.model, np.zeros((3, self._scene.model.nv))
        mujoco.mj_jac(model, self._data, jac, None, point, body)
        lever = float(np.abs(push @ jac[:, self._scene.dof_adr[:4]]).max())
        low, high = plan.severity
        return low < lever * plan.force[1] and lever * plan.force[0] < high

    def _stops_soon(
        self, plan: CollisionPlan, row: int, body: int, point: Array, push: Array
    ) -> bool:
        """Whether the surface goes on for a little way only: it presses and does not sweep."""
        stride = max(1, round(CLAMP_STRIDE / float(self._motion.t[1])))
        stop = row + round((plan.duration + CLAMP_HOLD) / float(self._motion.t[1]))
        path = body_points(self._scene, self._motion.q[row:stop:stride], body, point, self._ahead)
        ahead = float((-(path - point) @ push).max())
        return CLAMP_TRAVEL[0] <= ahead <= CLAMP_TRAVEL[1]

    def _inside(self, body: int, rng: np.random.Generator) -> Array:
        """A point near the middle of one of the link's collision geoms."""
        model = self._scene.model
        geoms = np.flatnonzero(self._solid & (model.geom_bodyid == body))
        geom = geoms[int(rng.integers(len(geoms)))]
        axis = self._data.geom_xmat[geom].reshape(3, 3)[:, 2]
        reach = float(model.geom_size[geom, 1]) * 0.8
        inside: Array = self._data.geom_xpos[geom] + axis * rng.uniform(-reach, reach)
        return inside

    def _velocity(self, body: int, point: Array) -> Array:
        model, data = self._scene.model, self._data
        jac = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, jac, None, point, body)
        velocity: Array = jac @ data.qvel
        return velocity


def pulse_wrench(
    target: Target, com: Array, force: float, duration: float, dt: float, rows: int, begin: int
) -> Array:
    """A half-sine force at the target's point as a wrench about ``com``.

    Args:
        target: where and which way.
        com: centre of mass of the link while it is pushed, shape (rows, 3) [m].
        force: peak [N].
        duration: [s].
        dt: [s].
        rows: length of the table.
        begin: its first pushed row.

    Returns:
        Force [N] and torque [N m], world frame, shape (rows, 6).
    """
    table = np.zeros((rows, 6))
    steps = np.arange(rows) - begin
    during = (steps > 0) & (steps * dt < duration)
    size = np.where(during, np.sin(np.pi * np.clip(steps * dt / duration, 0, 1)), 0.0)
    table[:, :3] = force * size[:, None] * target.direction
    moved = target.point + np.outer(steps * dt, target.velocity)
    table[:, 3:] = np.cross(moved - com, table[:, :3])
    return table


def launch(target: Target, speed: float, radius: float) -> tuple[Array, Array]:
    """Start position and velocity of a striker that reaches the target after :data:`LEAD` seconds.

    ``speed`` is relative to the struck point, along the push.
    """
    velocity = target.velocity + speed * target.direction
    centre = target.point - radius * target.direction
    return centre - LEAD * velocity, velocity


def clamp_centre(target: Target, path: Array, depth: float, radius: float) -> Array:
    """Centre of a fixed sphere into which the reference motion runs ``depth`` metres.

    Args:
        target: the surface point that meets the sphere.
        path: of that point along the references while the clamp stands, shape (T, 3) [m].
        depth: how far the references would go past the sphere's surface [m].
        radius: of the sphere [m].
    """
    ahead = float((-(path - target.point) @ target.direction).max(initial=0.0))
    return target.point - (ahead - depth + radius) * target.direction


def body_points(
    scene: Scene,
    q: Array,
    body: int,
    point: Array | None = None,
    data: mujoco.MjData | None = None,
) -> Array:
    """World path of a body-fixed point along joint positions (T, n), shape (T, 3) [m].

    ``point`` is given in the world at ``q[0]``; the default is the body's centre of mass. ``data``
    is scratch space: where many short paths are asked for, making it costs more than they do.
    """
    model = scene.model
    data = mujoco.MjData(model) if data is None else data
    path, local = np.empty((len(q), 3)), None
    for row, position in enumerate(q):
        data.qpos[scene.qpos_adr] = position
        mujoco.mj_kinematics(model, data)
        frame = data.xmat[body].reshape(3, 3)
        if local is None:
            start = data.xipos[body] if point is None else point
            local = frame.T @ (start - data.xpos[body])
        path[row] = data.xpos[body] + frame @ local
    return path
