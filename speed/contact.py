"""A contact over time: the arm in joint space, the servo, the torque limits and the reaction.

The arm's inertia and the direction of the contact stay those of the first touch. Each joint is
pulled towards its reference by the servo, within its torque limit, against its friction, while the
spring of the contact pushes back. All contacts of a batch are integrated at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tauguard.arrays import Array, in_a_line
from tauguard.speed.arm_states import ContactArm
from tauguard.speed.reaction import Stop
from tauguard.speed.tool import Spring

#: Speed over which the compensated Coulomb friction changes its sign [rad/s], as in the servo.
SMOOTHING = 0.02


@dataclass(frozen=True)
class Contacts:
    """A batch of C contacts at their first touch."""

    __repr__ = in_a_line

    inverse_mass: Array  #: [1/(kg m^2)], shape (C, n, n)
    gravity: Array  #: [N m], shape (C, n)
    lever: Array  #: J^T n, joint torque of 1 N at the contact [m], shape (C, n)
    qd: Array  #: [rad/s], shape (C, n)
    spring: Spring  #: its arrays have shape (C,)
    person_mass: Array  #: [kg], infinite where the person is clamped, shape (C,)
    delay: Array  #: from the first touch to the reaction [s], infinite: none, shape (C,)
    ends: Array  #: when the program itself stops the reference, after the first touch [s], (C,)


@dataclass(frozen=True)
class Course:
    """What a batch of contacts does to the person."""

    __repr__ = in_a_line

    peak: Array  #: largest force [N], shape (C,)
    lasting: Array  #: largest force after :attr:`Integration.transient_time` [N], shape (C,)
    force: Array | None  #: force at every step [N], shape (T, C), if it was asked for


@dataclass(frozen=True)
class Integration:
    """Settings of the integration."""

    step: float = 5e-4  #: [s]
    duration: float = 0.6  #: [s]
    transient_time: float = 0.5
    """The limits of a transient contact hold this long, those of a quasi-static contact after it
    [s] (ISO/TS 15066:2016, 5.5.5.3)."""
    run_up: float = 0.25  #: motion before the first touch in MuJoCo, until the servo follows [s]
    brake_stiffness: float = 10.0  #: of the brakes, relative to the servo's
    brake_damping: float = 3.0  #: of the brakes, relative to the servo's


def follow(
    arm: ContactArm,
    contacts: Contacts,
    reaction: Stop,
    settings: Integration = Integration(),
    keep: bool = False,
) -> Course:
    """Integrate contacts from their first touch on.

    Args:
        arm: servo, torque limits and friction.
        contacts: C contacts.
        reaction: what the robot does ``delay`` after the first touch.
        settings: time step and duration.
        keep: return the force at every step.
    """
    dt, steps = settings.step, round(settings.duration / settings.step)
    inverse = np.ascontiguousarray(np.moveaxis(contacts.inverse_mass, 0, -1))  # (n, n, C)
    lever, gravity = contacts.lever.T.copy(), contacts.gravity.T.copy()
    servo = _Servo(arm, contacts, reaction, settings)
    friction = _Friction(arm, contacts.qd.T)
    x, v = np.zeros_like(lever), contacts.qd.T.copy()
    person, person_speed = np.zeros_like(contacts.person_mass), np.zeros_like(contacts.person_mass)
    peak, lasting = np.zeros_like(person), np.zeros_like(person)
    kept = np.empty((steps, len(person))) if keep else None
    force = np.zeros_like(person)
    for k in range(steps):
        t = k * dt
        torque = servo.torque(x, v, gravity, t, dt)
        torque -= friction.torque(v, dt) + lever * force
        push = inverse[:, 0] * torque[0]
        for j in range(1, len(torque)):
            push += inverse[:, j] * torque[j]
        v = v + dt * push
        x = x + dt * v
        person_speed = person_speed + dt * force / contacts.person_mass
        person = person + dt * person_speed
        force = contacts.spring.force((lever * x).sum(axis=0) - person)
        np.maximum(peak, force, out=peak)
        if t >= settings.transient_time:
            np.maximum(lasting, force, out=lasting)
        if kept is not None:
            kept[k] = force
    return Course(peak, lasting, kept)


class _Friction:
    """Joint friction as in the simulation: bristles with a Coulomb level, and viscous drag."""

    def __init__(self, arm: ContactArm, qd: Array) -> None:
        friction = arm.friction
        n = len(qd)
        zero = np.zeros((n, 1))
        self._level = zero if friction is None else friction.coulomb[:, None]
        self._stiffness = zero if friction is None else friction.bristle_stiffness[:, None]
        self._viscous = zero if friction is None else friction.viscous[:, None]
        slack = np.divide(
            self._level, self._stiffness, out=np.zeros((n, 1)), where=self._stiffness > 0
        )
        self._slack = np.where(slack > 0, slack, 1.0)
        self._bristle = slack * np.sign(qd)

    def torque(self, v: Array, dt: float) -> Array:
        """Friction torque against the motion [N m]; the bristles take a step."""
        self._bristle = (self._bristle + dt * v) / (1 + dt * np.abs(v) / self._slack)
        return np.asarray(self._stiffness * self._bristle + self._viscous * v)


class _Servo:
    """Position control towards a reference that the reaction stops."""

    def __init__(
        self, arm: ContactArm, contacts: Contacts, reaction: Stop, settings: Integration
    ) -> None:
        qd, self._delay, self._ends = contacts.qd.T.copy(), contacts.delay, contacts.ends
        gains, facts = arm.gains, arm.scene.facts
        self._kp, self._kd = gains.kp[:, None], gains.kd[:, None]
        self._limit = arm.torque_limit[:, None]
        self._reaction, self._settings = reaction, settings
        friction = arm.friction
        known = 0.0 if friction is None else facts.compensation
        self._known_level = known * (friction.coulomb[:, None] if friction is not None else 0.0)
        self._known_viscous = known * (friction.viscous[:, None] if friction is not None else 0.0)
        # In steady motion the servo's lead makes up for the friction that is not compensated.
        steady = np.zeros_like(qd)
        if friction is not None:
            steady = friction.coulomb[:, None] * np.sign(qd) + friction.viscous[:, None] * qd
        self._x, self._v = (steady - self._compensated(qd)) / self._kp, qd.copy()
        self._came = qd.copy()
        self._begun = np.zeros(qd.shape[1], dtype=bool)
        self._braked = np.zeros(qd.shape[1], dtype=bool)

    def torque(self, x: Array, v: Array, gravity: Array, t: float, dt: float) -> Array:
        """Torque of drives less gravity [N m], (n, C), ``t`` [s] after the first touch."""
        reaction, since = self._reaction, t - self._delay
        begins = (since >= 0) & ~self._begun
        if begins.any():
            self._begun |= begins
            if reaction.category == 0 or reaction.start == "measured":
                self._v[:, begins], self._x[:, begins] = v[:, begins], x[:, begins]
        ended = (t >= self._ends) & ~self._begun
        if ended.any():
            self._v = np.where(ended, 0.0, self._v)
        if self._begun.any():
            self._slow_down(dt)
        self._x = self._x + dt * self._v
        kp, kd, powered = self._kp, self._kd, np.ones(x.shape[1], dtype=bool)
        if reaction.category < 2 and self._begun.any():
            off = reaction.brake_delay if reaction.category == 0 else 0.0
            stopped = self._begun & (reaction.category == 0 or (self._v == 0).all(axis=0))
            brakes = stopped & (since >= off) & ~self._braked
            self._x[:, brakes], self._v[:, brakes] = x[:, brakes], 0.0
            self._braked |= brakes
            powered = ~stopped
            kp = np.where(self._braked, self._settings.brake_stiffness * kp, kp)
            kd = np.where(self._braked, self._settings.brake_damping * kd, kd)
        known = self._compensated(self._v)
        pull = kp * (self._x - x) + kd * (self._v - v)
        drive = np.clip(pull + known + gravity, -self._limit, self._limit)
        held = np.where(self._braked, pull + gravity, 0.0)  # brakes hold more than the drives
        return np.asarray(np.where(powered, drive, held) - gravity)

    def _compensated(self, v: Array) -> Array:
        """Friction torque that the controller adds at a reference speed [N m]."""
        return np.asarray(self._known_level * np.tanh(v / SMOOTHING) + self._known_viscous * v)

    def _slow_down(self, dt: float) -> None:
        """Slow the references of the contacts whose reaction has begun, along their paths."""
        reaction = self._reaction
        if reaction.category == 0:
            self._v[:, self._begun] = 0.0
            return
        slowest = np.abs(self._v).max(axis=0) / reaction.deceleration  # time to stand still [s]
        factor = np.where(slowest > dt, 1 - dt / np.maximum(slowest, dt), 0.0)
        stopped = self._begun & (slowest <= dt)
        slower = np.where(self._begun, factor, 1.0) * self._v
        if reaction.retract:
            slower[:, stopped] = -0.5 * self._came[:, stopped]
            going_back = (self._v * self._came).sum(axis=0) < 0
            slower[:, going_back] = self._v[:, going_back]
        self._v = slower
