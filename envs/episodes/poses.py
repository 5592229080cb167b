"""Poses of the links and joints of a scene's arm, from joint positions."""

from collections.abc import Sequence

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.envs import _plant
from tauguard.envs.plant import make_physics
from tauguard.models import Scene


class Poses:
    """Forward kinematics of a scene over tables of joint positions, run natively."""

    def __init__(self, scene: Scene) -> None:
        """Prepare the arm of ``scene``; all other bodies are at their initial place."""
        self._scene, self._data = scene, mujoco.MjData(scene.model)
        self._physics = make_physics(scene.model, self._data)
        self._qpos = scene.qpos_adr.tolist()
        self._joints = scene.model.dof_jntid[scene.dof_adr].tolist()
        model, slide = scene.model, mujoco.mjtJoint.mjJNT_SLIDE
        #: Which joints are prismatic.
        self.sliding = [bool(model.jnt_type[joint] == slide) for joint in self._joints]
        #: The joints that move each link, base to tip.
        self.moving = [self._moving(int(body)) for body in scene.link_bodies]

    def body(self, q: Array, body: int) -> tuple[Array, Array]:
        """A body's origin [m], shape (T, 3), and rotation, shape (T, 3, 3), along ``q`` (T, n)."""
        position, rotation, _, _ = self._along(q, [body], [])
        return position[:, 0], rotation[:, 0]

    def joints(self, q: Array) -> tuple[Array, Array]:
        """A point on each joint's axis [m] and its direction along ``q`` (T, n), both (T, n, 3)."""
        _, _, anchor, axis = self._along(q, [], self._joints)
        return anchor, axis

    def points(self, q: Array, body: int, point: Array | None = None) -> Array:
        """World path of a body-fixed point along ``q`` (T, n), shape (T, 3) [m].

        ``point`` is given in the world at ``q[0]``; the default is the body's centre of mass.
        """
        position, rotation = self.body(q, body)
        if not len(q):
            return position
        if point is None:
            self.body(q[:1], body)  # leaves the pose of this row in the data
            point = self._data.xipos[body]
        return np.asarray(position + rotation @ (rotation[0].T @ (point - position[0])))

    def _moving(self, body: int) -> list[int]:
        model, chain = self._scene.model, set()
        while body > 0:
            chain.add(body)
            body = int(model.body_parentid[body])
        return [i for i, joint in enumerate(self._joints) if model.jnt_bodyid[joint] in chain]

    def _along(
        self, q: Array, bodies: Sequence[int], joints: Sequence[int]
    ) -> tuple[Array, Array, Array, Array]:
        rows = len(q)
        position, rotation = np.empty((rows, len(bodies), 3)), np.empty((rows, len(bodies), 3, 3))
        anchor, axis = np.empty((rows, len(joints), 3)), np.empty((rows, len(joints), 3))
        _plant.poses(
            self._physics,
            self._qpos,
            np.ascontiguousarray(q),
            bodies,
            joints,
            position=position,
            rotation=rotation,
            anchor=anchor,
            axis=axis,
        )
        return position, rotation, anchor, axis


def cross(a: Array, b: Array) -> Array:
    """Cross product along the last axis; for small arrays several times faster than numpy's."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)
