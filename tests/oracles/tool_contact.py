"""Contacts of an arm's tool with a body region, by MuJoCo's own contact between two balls.

The arm moves straight in joint space. The region's ball stands in the way and is fixed, or slides
along the direction of the contact. After a delay the reference slows down along its path.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from tauguard.envs import SimulationLoop
from tauguard.envs.episodes.simulate import workspace
from tauguard.models import BodyProxy, SceneObject, SceneSpec, Shape, compose

TOOL_RADIUS, BODY_RADIUS, TOOL_LENGTH, TOOL_MASS = 0.03, 0.07, 0.1, 0.5
GAP, LEAD = 5e-4, 0.25  # gap before the touch [m], time before it [s]


@dataclass(frozen=True)
class Hit:
    """A contact of the tool and its forces."""

    q: np.ndarray  #: at the first touch [rad], shape (n,)
    qd: np.ndarray  #: at the first touch [rad/s], shape (n,)
    normal: np.ndarray  #: towards the person, shape (3,)
    force: np.ndarray  #: at every step from the first touch on [N]


def first_contact(force: np.ndarray) -> np.ndarray:
    """Forces until the bodies part for the first time; later touches are other contacts."""
    parted = np.flatnonzero(force[1:] <= 0)
    return force[: parted[0] + 1] if len(parted) else force


class ToolContacts:
    """Draws and simulates contacts of one arm with one region."""

    def __init__(self, arm: str, region: str, clamped: bool, timestep: float = 5e-4) -> None:
        ball = SceneObject(
            "held_ball",
            (Shape("sphere", (TOOL_RADIUS,)),),
            position=(0, 0, TOOL_LENGTH),
            motion="held",
            mass=TOOL_MASS,
        )
        proxy = BodyProxy(region, (5, 5, 5), radius=BODY_RADIUS, clamped=clamped)
        self.scene = compose(
            SceneSpec(arm=arm, objects=(ball,), proxies=(proxy,), timestep=timestep)
        )
        model = self.scene.model
        self.clamped, self.region = clamped, region
        self.loop = SimulationLoop(self.scene, self.scene.facts.nominal)
        self.space = workspace(self.scene)
        last = int(self.scene.link_bodies[-1])
        balls = np.flatnonzero(
            (model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE)
            & (np.abs(model.geom_size[:, 0] - TOOL_RADIUS) < 1e-12)
            & (model.body_weldid[model.geom_bodyid] == last)
        )
        self.tool = int(balls[-1])
        self.body, self.geom = model.body(region).id, model.geom(region).id
        self._data = mujoco.MjData(model)

    def _tool(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Place of the tool's ball, its Jacobian and the mass matrix of the arm."""
        model, data, dofs = self.scene.model, self._data, self.scene.dof_adr
        data.qpos[self.scene.qpos_adr] = q
        mujoco.mj_fwdPosition(model, data)
        jac, mass = np.zeros((3, model.nv)), np.zeros((model.nv, model.nv))
        place = data.geom_xpos[self.tool].copy()
        mujoco.mj_jac(model, data, jac, None, place, int(model.geom_bodyid[self.tool]))
        mujoco.mj_fullM(model, data, mass)
        return place, jac[:, dofs], mass[np.ix_(dofs, dofs)]

    def draw(
        self, rng: np.random.Generator, speed: float, delay: float, deceleration: float
    ) -> Hit:
        """A contact at a random pose and direction at which nothing else of the arm is near."""
        while True:
            q = rng.uniform(self.space.low, self.space.high)
            if not self.space.allowed(q):
                continue
            place, jacobian, mass = self._tool(q)
            normal = rng.normal(size=3)
            normal /= np.linalg.norm(normal)
            # The tool's ball moves along the normal, so that the balls meet head on.
            reach = np.linalg.solve(mass, jacobian.T)
            qd = speed * reach @ np.linalg.solve(jacobian @ reach, normal)
            if (np.abs(qd) > self.space.max_speed).any():
                continue
            centre = place + normal * (TOOL_RADIUS + BODY_RADIUS + GAP)
            start = q - LEAD * qd
            if self._free(start, centre, normal):
                hit = self._run(start, qd, normal, delay, deceleration)
                if hit is not None:
                    return hit

    def repeat(self, hit: Hit, factor: float, delay: float, deceleration: float) -> Hit | None:
        """The same contact at another speed; None if the arm does not reach the body."""
        place = self._tool(hit.q)[0]
        centre = place + hit.normal * (TOOL_RADIUS + BODY_RADIUS + GAP)
        start = hit.q - LEAD * factor * hit.qd
        if not self._free(start, centre, hit.normal):
            return None
        return self._run(start, factor * hit.qd, hit.normal, delay, deceleration)

    def _free(self, q: np.ndarray, centre: np.ndarray, normal: np.ndarray) -> bool:
        model, data = self.scene.model, self.loop.data
        self.loop.reset(q)
        if self.clamped:
            data.mocap_pos[model.body_mocapid[self.body]] = centre
        else:
            model.body_pos[self.body] = centre
            model.jnt_axis[model.body_jntadr[self.body]] = normal
        mujoco.mj_forward(model, data)
        others = {int(g) for g in model.pair_geom1} - {self.tool}
        return all(
            mujoco.mj_geomDistance(model, data, g, self.geom, 0.06, None) > 0.02 for g in others
        )

    def _run(
        self, start: np.ndarray, qd: np.ndarray, normal: np.ndarray, delay: float, slow: float
    ) -> Hit | None:
        loop, scene = self.loop, self.scene
        dt = float(scene.model.opt.timestep)
        rows = round((LEAD + 0.65) / dt)
        q_des = start + np.arange(1, rows + 1)[:, None] * dt * qd
        qd_des = np.tile(qd, (rows, 1))
        ahead = self._bias(start + LEAD * qd, qd)
        still = self._bias(start + LEAD * qd, 0 * qd)
        place = loop.data.mocap_pos.copy()
        onset = None
        for run in (0, 1):
            loop.reset(start)
            loop.data.mocap_pos[:] = place
            loop.data.qvel[scene.dof_adr] = qd
            share = (qd_des @ qd) / (qd @ qd)
            feed = still + share[:, None] ** 2 * (ahead - still)
            out = loop.run(q_des, qd_des, feed)
            force = np.linalg.norm(out.contact[:, :, 1:4].sum(axis=1), axis=1)
            if run == 0:
                if not force.any():
                    return None
                onset = int(np.flatnonzero(force)[0])
                begin = onset + round(delay / dt) if np.isfinite(delay) else rows
                v = qd.copy()
                for row in range(begin, rows):
                    longest = float(np.abs(v).max()) / slow
                    v = v * (1 - dt / longest) if longest > dt else 0 * v
                    q_des[row] = q_des[row - 1] + dt * v
                    qd_des[row] = v
        assert onset is not None
        end = onset + round(0.6 / dt)
        return Hit(out.q[onset], out.qd[onset], normal, force[onset:end])

    def _bias(self, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        data, scene = self._data, self.scene
        data.qpos[scene.qpos_adr] = q
        data.qvel[scene.dof_adr] = qd
        mujoco.mj_forward(scene.model, data)
        bias: np.ndarray = data.qfrc_bias[scene.dof_adr].copy()
        return bias
