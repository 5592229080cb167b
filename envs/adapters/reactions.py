"""Reactions to a collision: a wrapper that acts in place of the policy."""

from collections import deque
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import VectorEnv, VectorWrapper

from tauguard.arrays import Array
from tauguard.envs.gym.base import arm_env
from tauguard.envs.gym.batch import Batch, Override
from tauguard.envs.gym.rules import Rule
from tauguard.envs.gym.settings import one_of
from tauguard.envs.gym.vector import vector_arm_env
from tauguard.findings import ArgumentError

REACTIONS = ("continue", "stop0", "stop1", "stop2", "retract", "admittance")
#: Trigger of a reaction: the detector's alarm, or the true contact, which no real robot measures.
TRIGGERS = ("alarm", "contact")
#: Assumed delay from power-off until the brakes hold [s]. Data sheets state 10 to 50 ms.
BRAKE_DELAY = 0.02
#: A retraction goes back along the path at this fraction of the speed at which the arm came.
RETRACT_SPEED = 0.5
#: A retraction ends this time after it has passed the point where the reaction began [s].
RETRACT_TIME = 0.3
#: Virtual inertia of the admittance, as a fraction of the joint's inertia.
ADMITTANCE_INERTIA = 0.5
ADMITTANCE_TIME = 0.1  #: time constant of the admittance [s]


class Reaction(gymnasium.Wrapper[Any, Array, Any, Array], RecordConstructorArgs):
    """Let the policy act until the trigger, and the reaction from then to the end of the episode.

    * ``continue``: the policy goes on.
    * ``stop0``: stop category 0 of IEC 60204-1: power off at once, brakes after
      :data:`BRAKE_DELAY`.
    * ``stop1``: category 1: the drives stop the arm along its path, then power off and brakes.
      By default the drives decelerate at the arm's limit, more gently than the brakes. So the
      peak force, which occurs within 50 ms of the contact, is higher than with ``stop0``.
      ``stop2`` and ``retract`` begin with the same stop and have the same peak.
    * ``stop2``: category 2: the drives stop the arm and hold it.
    * ``retract``: the arm stops as with ``stop2``, goes back along its path past the place where
      the reaction was triggered, and holds.
    * ``admittance``: ``M dv/dt = tau - D v`` in every joint, so that the arm yields. tau is the
      part of the residual beyond the detector's thresholds, or the true external torque if the
      trigger is the contact.

    ``info["reacting"]`` states whether the reaction has begun.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Array],
        reaction: str = "stop2",
        trigger: str = "alarm",
        deceleration: float | None = None,
    ) -> None:
        """Choose the reaction.

        Args:
            env: an environment of tauguard; with trigger "alarm" it needs a detector.
            reaction: one of :data:`REACTIONS`.
            trigger: one of :data:`TRIGGERS`.
            deceleration: deceleration of every joint [rad/s^2] (default: the arm's own limits).

        Raises:
            ArgumentError: an unknown reaction or trigger, or trigger "alarm" without a detector.
        """
        settings: dict[str, Any] = {
            "reaction": reaction,
            "trigger": trigger,
            "deceleration": deceleration,
        }
        RecordConstructorArgs.__init__(self, **settings)
        gymnasium.Wrapper.__init__(self, env)
        arm_env(env).rules.add(Reacting, **settings)


class VectorReaction(VectorWrapper):
    """:class:`Reaction` of every copy of a vector environment."""

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any],
        reaction: str = "stop2",
        trigger: str = "alarm",
        deceleration: float | None = None,
    ) -> None:
        """Choose the reaction; arguments and errors as for :class:`Reaction`."""
        super().__init__(env)
        settings: dict[str, Any] = {
            "reaction": reaction,
            "trigger": trigger,
            "deceleration": deceleration,
        }
        vector_arm_env(env).rules.add(Reacting, **settings)


@dataclass
class Course:
    """The reaction of one copy until now."""

    past: deque[Array]  #: positions of the last two seconds [rad]
    speed: Array  #: commanded speed [rad/s]
    measured: Array  #: speed of the joints [rad/s]
    tau: Array  #: what the admittance yields to [N m]
    since: float | None = None  #: time since the trigger [s]; None: not triggered
    returning: list[Array] | None = None  #: speeds of the rest of a retraction [rad/s]


class Reacting(Rule):
    """Replaces actions after the trigger; see :class:`Reaction`."""

    def __init__(
        self, batch: Batch, reaction: str, trigger: str, deceleration: float | None
    ) -> None:
        """Choose the reaction."""
        super().__init__(batch)
        one_of("reaction", reaction, REACTIONS)
        one_of("trigger", trigger, TRIGGERS)
        if trigger == "alarm" and batch.sensing is None:
            raise ArgumentError("trigger 'alarm': the environment has no detector; pass detector=")
        self.reaction, self.trigger = reaction, trigger
        compiled = batch.compiled
        n = len(compiled.scene.joint_names)
        usual = compiled.scene.facts.max_acceleration
        self._deceleration = np.resize(usual if deceleration is None else deceleration, n)
        self._period = 1 / compiled.settings.control_rate
        # Critically damped gains: kp = w^2 M and kd = 2 w M.
        self._inertia = compiled.gains.kd**2 / (4 * compiled.gains.kp)
        sensing = batch.sensing if trigger == "alarm" else None
        #: Largest residual without contact [N m]; zero if the trigger is the true contact.
        self._dead = sensing[0].bounds if sensing else np.zeros(n)
        self._retract_steps = round(RETRACT_TIME / self._period)
        self.columns["reacting"] = np.zeros(batch.rows, dtype=np.bool_)

    def begin(self, i: int) -> None:
        """Let the policy act."""
        none = np.zeros(len(self._deceleration))
        past: deque[Array] = deque(maxlen=round(2.0 / self._period))
        self.memory[i] = Course(past, none, none, none)
        self.batch.plants[i].override(Override.FREE, none)
        self.look(i)

    def act(self, i: int) -> None:
        """Replace the action once the reaction has begun."""
        course = self.memory[i]
        if course.since is not None and self.reaction != "continue":
            kind, speed = self._react(course)
            self.batch.plants[i].override(kind, speed)
            course.since += self._period

    def look(self, i: int) -> None:
        """Store the arm's state, and decide whether the reaction begins."""
        batch, course, n = self.batch, self.memory[i], len(self._deceleration)
        alarm = self.trigger == "alarm"
        course.past.append(batch.observation[i, :n].copy())
        course.measured = batch.observation[i, n : 2 * n].copy()
        if course.since is None and (batch.alarm[i] if alarm else batch.metrics["force"][i]):
            course.since, course.speed = 0.0, course.measured
        course.tau = (batch.residual if alarm else batch.tau_ext)[i].copy()
        self.columns["reacting"][i] = course.since is not None

    def _react(self, course: Course) -> tuple[int, Array]:
        """The replacement of the next action: an :class:`Override`, joint velocities [rad/s]."""
        assert course.since is not None
        if self.reaction == "stop0":
            return (
                Override.LIMP if course.since < BRAKE_DELAY - 1e-9 else Override.BRAKE
            ), course.speed
        if self.reaction == "admittance":
            step = self._period / ADMITTANCE_INERTIA
            damping = ADMITTANCE_INERTIA / ADMITTANCE_TIME
            push = np.sign(course.tau) * np.maximum(np.abs(course.tau) - self._dead, 0)
            push = push / self._inertia
            # The damping is integrated implicitly, so this is stable for any period.
            course.speed = (course.speed + step * push) / (1 + step * damping)
            return Override.VELOCITY, course.speed
        stopped = self._slow_down(course)
        if self.reaction == "stop1" and stopped:
            return Override.BRAKE, course.speed
        if self.reaction == "retract" and stopped:
            return Override.VELOCITY, self._backward_velocity(course)
        return Override.VELOCITY, course.speed

    def _slow_down(self, course: Course) -> bool:
        """Slow all joints together, so that the arm stays on its path; True once it stands still.

        If the contact has already slowed the arm down, the stop continues from the measured speed.
        A speed that depended on time alone would accelerate the arm against the person.
        """
        squared = float(course.speed @ course.speed)
        if squared > 0:
            fraction = float(course.measured @ course.speed) / squared
            course.speed = course.speed * min(max(fraction, 0.0), 1.0)
        fastest = (np.abs(course.speed) / self._deceleration).max()
        if fastest <= self._period:
            course.speed = np.zeros_like(course.speed)
            return True
        course.speed = course.speed * (1 - self._period / fastest)
        return False

    def _backward_velocity(self, course: Course) -> Array:
        """Velocity backwards along the stored path; zero after the end of the retraction."""
        if course.returning is None:
            rows, each = np.array(course.past), round(1 / RETRACT_SPEED)
            assert course.since is not None
            gone = each * round(course.since / self._period)  # number of steps back to the trigger
            speeds = -np.diff(rows, axis=0)[::-1] / (each * self._period)
            back = np.repeat(speeds, each, axis=0)[: gone + self._retract_steps]
            course.returning = list(back)
        return course.returning.pop(0) if course.returning else np.zeros_like(course.speed)
