"""A contact in MuJoCo: the arm with its drives, and the person's spring as an applied force."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.envs.episodes.loop import SimulationLoop
from tauguard.envs.plant import Gains
from tauguard.speed.arm_states import ContactArm
from tauguard.speed.contact import Integration
from tauguard.speed.reaction import Stop
from tauguard.speed.tool import Spring


@dataclass(frozen=True)
class SimulatedContact:
    """One contact to simulate, from its first touch on."""

    q: Array  #: [rad], shape (n,)
    qd: Array  #: [rad/s], shape (n,)
    point: int  #: index of the point of the arm
    normal: Array  #: unit normal towards the person, shape (3,)
    spring: Spring  #: of arrays of shape ()
    person_mass: float  #: [kg]
    delay: float  #: from the first touch to the reaction [s]
    ends: float = float("inf")  #: when the program itself stops, after the first touch [s]


class ContactBench:
    """Simulates contacts of one arm."""

    def __init__(self, arm: ContactArm, settings: Integration = Integration()) -> None:  # noqa: B008
        """Bind the arm's scene; ``settings`` gives the duration."""
        self._arm, self._settings = arm, settings
        nominal, gains = arm.scene.facts.nominal, arm.gains
        brakes = Gains(settings.brake_stiffness * gains.kp, settings.brake_damping * gains.kd)
        limp = Gains(0 * gains.kp, 0 * gains.kd)
        self._loops = {
            name: SimulationLoop(arm.scene, nominal, each)
            for name, each in (("servo", gains), ("brakes", brakes), ("limp", limp))
        }

    def force(self, case: SimulatedContact, reaction: Stop) -> Array:
        """Contact force [N] at every step, shape (T,).

        The reference moves on at the velocity of the first touch until the reaction. The torque of
        gravity and of the motion is compensated as at the first touch.
        """
        arm, loop = self._arm, self._loops["servo"]
        dt = float(arm.scene.model.opt.timestep)
        lead = round(self._settings.run_up / dt)
        start = case.q - lead * dt * case.qd
        loop.reset(start)
        loop.data.qvel[arm.scene.dof_adr] = case.qd
        path = start + np.arange(1, lead + 1)[:, None] * dt * case.qd
        ahead = self._bias(case.q, 0 * case.qd), self._bias(case.q, case.qd)
        loop.run(path, np.tile(case.qd, (lead, 1)), np.tile(ahead[1], (lead, 1)))
        return self._touch(case, reaction, ahead)

    def _touch(self, case: SimulatedContact, reaction: Stop, ahead: tuple[Array, Array]) -> Array:
        """Forces from the first touch on; ``ahead``: torques at rest and at the first speed."""
        arm, loop = self._arm, self._loops["servo"]
        body, local = int(arm.body[case.point]), arm.local[case.point]
        dt = float(arm.scene.model.opt.timestep)
        forces = np.zeros(round(self._settings.duration / dt))
        person = person_speed = 0.0
        place, centre = _place(loop, body, local)
        touch = float(case.normal @ place)
        reference = _Reference(arm, loop, case.qd, reaction)
        wrench, out = np.zeros((1, 6)), loop.room_for(1)
        for k in range(len(forces)):
            depth = float(case.normal @ place) - touch - person
            force = float(case.spring.force(np.asarray(depth)))
            forces[k] = force
            person_speed += dt * force / case.person_mass
            person += dt * person_speed
            wrench[0, :3] = -force * case.normal
            wrench[0, 3:] = np.cross(place - centre, wrench[0, :3])
            if k * dt >= case.ends:
                reference.end()
            mode, q, qd = reference.next(k * dt - case.delay, dt)
            if self._loops[mode] is not loop:
                saved, loop = loop.save(), self._loops[mode]
                loop.restore(saved)
                reference.moved_to(loop)
            # Along the path, centrifugal and Coriolis torques grow with the square of the speed.
            share = float(qd @ case.qd) / float(case.qd @ case.qd)
            torque = ahead[0] + share**2 * (ahead[1] - ahead[0])
            loop.run(q[None], qd[None], (mode != "limp") * torque[None], wrench, body, out)
            place, centre = _place(loop, body, local)
        return forces

    def _bias(self, q: Array, qd: Array) -> Array:
        """Torque of gravity and of the velocity at a pose [N m], shape (n,)."""
        scene = self._arm.scene
        data = mujoco.MjData(scene.model)
        data.qpos[scene.qpos_adr] = q
        data.qvel[scene.dof_adr] = qd
        mujoco.mj_forward(scene.model, data)
        return np.asarray(data.qfrc_bias[scene.dof_adr].copy())


class _Reference:
    """The controller's reference after the first touch."""

    def __init__(self, arm: ContactArm, loop: SimulationLoop, qd: Array, reaction: Stop) -> None:
        self._scene, self._loop, self._reaction = arm.scene, loop, reaction
        self._q, self._qd = self._position().copy(), qd.copy()
        self._came, self._mode, self._begun = qd.copy(), "servo", False

    def _position(self) -> Array:
        return np.asarray(self._loop.data.qpos[self._scene.qpos_adr])

    def moved_to(self, loop: SimulationLoop) -> None:
        """The arm goes on in another loop."""
        self._loop = loop

    def end(self) -> None:
        """The program stops, unless the reaction has begun."""
        if not self._begun:
            self._qd = np.zeros_like(self._qd)

    def next(self, since: float, dt: float) -> tuple[str, Array, Array]:
        """Mode, position [rad] and velocity [rad/s] of the next step."""
        reaction = self._reaction
        if since >= 0 and not self._begun:
            self._begun = True
            if reaction.category == 0 or reaction.start == "measured":
                self._q = self._position().copy()
                self._qd = self._loop.data.qvel[self._scene.dof_adr].copy()
        if self._begun and self._mode == "servo":
            self._slow_down(dt)
        self._q = self._q + dt * self._qd
        still = not self._qd.any()
        if self._begun and reaction.category < 2 and (reaction.category == 0 or still):
            wait = reaction.brake_delay if reaction.category == 0 else 0.0
            if since >= wait and self._mode != "brakes":
                self._mode, self._q = "brakes", self._position().copy()
            elif since < wait:
                self._mode = "limp"
            self._qd = np.zeros_like(self._qd)
        return self._mode, self._q, self._qd

    def _slow_down(self, dt: float) -> None:
        if self._reaction.category == 0:
            self._qd = np.zeros_like(self._qd)
            return
        if float(self._qd @ self._came) < 0:
            return  # going back
        slowest = float(np.abs(self._qd).max()) / self._reaction.deceleration
        if slowest > dt:
            self._qd = self._qd * (1 - dt / slowest)
        else:
            self._qd = (-0.5 if self._reaction.retract else 0.0) * self._came


def _place(loop: SimulationLoop, body: int, local: Array) -> tuple[Array, Array]:
    """The point and its body's centre of mass in the world [m] after the last step."""
    model, data = loop.model, loop.data
    mujoco.mj_kinematics(model, data)
    frame = data.xmat[body].reshape(3, 3)
    return data.xpos[body] + frame @ local, data.xipos[body].copy()


def single_spring(spring: Spring, case: int) -> Spring:
    """The spring of one contact of a batch."""
    return replace(spring, tissue=np.asarray(spring.tissue[case]))
