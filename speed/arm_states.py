"""Mass matrix, velocities and mobilities of points on the arm along a program."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array, in_a_line
from tauguard.envs.plant import Gains
from tauguard.findings import ArgumentError
from tauguard.models import Friction, Robot, Scene, SceneObject, SceneSpec, Shape, compose, load_arm
from tauguard.models.link_surface import link_surface
from tauguard.speed.tool import Tool

#: Radius of the ball that stands for the tool's mass in the scene [m].
TOOL_RADIUS = 0.03


@dataclass(frozen=True)
class ContactArm:
    """An arm with its tool, and the points on its surface that can touch somebody."""

    __repr__ = in_a_line

    scene: Scene
    body: NDArray[np.int64]  #: body of each point, shape (K,)
    local: Array  #: points in the frames of their bodies [m], shape (K, 3)
    link: NDArray[np.int64]  #: 1-based link of each point; 0: the tool, shape (K,)
    gains: Gains  #: of the servo

    @classmethod
    def of(
        cls, robot: str | Robot, tool: Tool, timestep: float = 5e-4, points: int = 12
    ) -> ContactArm:
        """An arm with ``points`` points on each link, and the tool's contact point.

        Raises:
            ArgumentError: the robot cannot be used.
        """
        position = (0.0, 0.0, tool.length)
        ball = SceneObject(
            "speed_tool", (Shape("sphere", (TOOL_RADIUS,)),), position=position, motion="held",
            mass=tool.mass,
        )  # fmt: skip
        scene = compose(SceneSpec(arm=robot, objects=(ball,), timestep=timestep, labels=False))
        model = scene.model
        last = int(scene.link_bodies[-1])
        geom = _tool_geom(model, last)
        surface = link_surface(load_arm(robot).spec, points)
        bodies = scene.link_bodies[surface.link]
        pivots = model.jnt_pos[[model.joint(name).id for name in scene.joint_names]]
        return cls(
            scene=scene,
            body=np.append(bodies, model.geom_bodyid[geom]),
            local=np.vstack([surface.point + pivots[surface.link], model.geom_pos[geom]]),
            link=np.append(surface.link + 1, 0),
            gains=Gains.for_scene(scene),
        )

    @property
    def torque_limit(self) -> Array:
        """[N m], shape (n,)."""
        return np.asarray(self.scene.drive.torque_limit)

    @property
    def friction(self) -> Friction | None:
        """Friction of the simulated joints, the file's included."""
        return self.scene.facts.nominal.friction

    @property
    def armature_source(self) -> str:
        """Where the rotors' inertia comes from, as text."""
        return self.scene.facts.sources.get("armature", "the robot file")


def _tool_geom(model: mujoco.MjModel, last: int) -> int:
    """The ball of the tool: the last sphere of its size on the last link or a body welded to it."""
    fits = (model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE) & (
        np.abs(model.geom_size[:, 0] - TOOL_RADIUS) < 1e-12
    )
    fits &= model.body_weldid[model.geom_bodyid] == model.body_weldid[last]
    return int(np.flatnonzero(fits)[-1])


@dataclass(frozen=True)
class ArmStates:
    """An arm at S samples of a program: what a contact at K points meets."""

    __repr__ = in_a_line

    q: Array  #: [rad], shape (S, n)
    qd: Array  #: [rad/s], shape (S, n)
    inverse_mass: Array  #: M^-1 with the rotors' inertia [1/(kg m^2)], shape (S, n, n)
    gravity: Array  #: torque that gravity asks of the drives [N m], shape (S, n)
    jacobian: Array  #: of the points, shape (S, K, 3, n)

    @classmethod
    def of(cls, arm: ContactArm, q: Array, qd: Array) -> ArmStates:
        """Evaluate the arm at positions and velocities of shape (S, n).

        Raises:
            ArgumentError: another number of joints than the arm's.
        """
        scene, model = arm.scene, arm.scene.model
        n = len(scene.joint_names)
        if q.ndim != 2 or q.shape[1] != n or qd.shape != q.shape:
            raise ArgumentError(f"q, qd: shapes {q.shape}, {qd.shape}; the arm has {n} joints")
        data, dofs = mujoco.MjData(model), scene.dof_adr
        bodies, which = np.unique(arm.body, return_inverse=True)
        mass = np.empty((len(q), n, n))
        gravity = np.empty_like(q)
        linear, angular = np.empty((2, len(q), len(bodies), 3, n))
        arms = np.empty((len(q), len(arm.body), 3))
        whole = np.zeros((model.nv, model.nv))
        jacp, jacr = np.zeros((2, 3, model.nv))
        for row, pose in enumerate(q):
            data.qpos[scene.qpos_adr] = pose
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)  # at rest: the bias force is gravity's
            mujoco.mj_fullM(model, data, whole)
            mass[row] = whole[np.ix_(dofs, dofs)]
            gravity[row] = data.qfrc_bias[dofs]
            for k, body in enumerate(bodies):
                mujoco.mj_jacBody(model, data, jacp, jacr, int(body))
                linear[row, k], angular[row, k] = jacp[:, dofs], jacr[:, dofs]
            frames = data.xmat[arm.body].reshape(-1, 3, 3)
            arms[row] = np.einsum("kij,kj->ki", frames, arm.local)
        turning = np.cross(angular[:, which], arms[..., None], axisa=2, axisb=2, axisc=2)
        return cls(
            q, qd, np.asarray(np.linalg.inv(mass), np.float64), gravity, linear[:, which] + turning
        )

    @cached_property
    def velocity(self) -> Array:
        """Velocities of the points [m/s], shape (S, K, 3)."""
        return np.asarray(np.einsum("skij,sj->ski", self.jacobian, self.qd))

    @cached_property
    def mobility(self) -> Array:
        """J M^-1 J^T of the points [1/kg], shape (S, K, 3, 3)."""
        half = self.jacobian @ self.inverse_mass[:, None]
        return np.asarray(half @ np.swapaxes(self.jacobian, -1, -2))
