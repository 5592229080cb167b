"""Reactions to a collision: a wrapper that acts in place of the policy."""

from collections import deque
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from tauguard.arrays import Array
from tauguard.envs.gym.base import ArmEnv, arm_env
from tauguard.envs.gym.batch import Override
from tauguard.envs.gym.settings import one_of
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


class Reaction(gymnasium.Wrapper[Array, Array, Array, Array], RecordConstructorArgs):
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
        env: gymnasium.Env[Array, Array],
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
        RecordConstructorArgs.__init__(
            self, reaction=reaction, trigger=trigger, deceleration=deceleration
        )
        gymnasium.Wrapper.__init__(self, env)
        one_of("reaction", reaction, REACTIONS)
        one_of("trigger", trigger, TRIGGERS)
        self._arm: ArmEnv = arm_env(env)
        if trigger == "alarm" and self._arm.batch.sensing is None:
            raise ArgumentError("trigger 'alarm': the environment has no detector; pass detector=")
        self.reaction, self.trigger = reaction, trigger
        compiled = self._arm.compiled
        n = len(compiled.scene.joint_names)
        own = compiled.scene.facts.max_acceleration
        self._deceleration = np.resize(own if deceleration is None else deceleration, n)
        self._period = 1 / compiled.settings.control_rate
        # Critically damped gains: kp = w^2 M and kd = 2 w M.
        self._inertia = compiled.gains.kd**2 / (4 * compiled.gains.kp)
        self._dead = self._dead_zone()
        self._retract_steps = round(RETRACT_TIME / self._period)
        self._past: deque[Array] = deque(maxlen=round(2.0 / self._period))
        self._forget()

    def _dead_zone(self) -> Array:
        """Largest residual without contact [N m]; zero if the trigger is the true contact."""
        sensing = self._arm.batch.sensing
        if not sensing or self.trigger != "alarm":
            return np.zeros(len(self._deceleration))
        return sensing[0].bounds

    def _forget(self) -> None:
        self._since: float | None = None
        self._speed = np.zeros(len(self._deceleration))
        self._tau = self._measured = np.zeros(len(self._deceleration))
        self._returning: list[Array] | None = None
        self._past.clear()
        self._arm.batch.plants[0].override(Override.FREE, self._speed)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode."""
        self._forget()
        observation, info = self.env.reset(seed=seed, options=options)
        self._observe(info)
        return observation, info | {"reacting": self._since is not None}

    def step(self, action: Array) -> tuple[Array, Any, bool, bool, dict[str, Any]]:
        """Apply the action, or the reaction in its place."""
        if self._since is not None and self.reaction != "continue":
            kind, speed = self._react()
            self._arm.batch.plants[0].override(kind, speed)
            self._since += self._period
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._observe(info)
        info["reacting"] = self._since is not None
        return observation, reward, terminated, truncated, info

    def _observe(self, info: dict[str, Any]) -> None:
        """Store the arm's state, and decide whether the reaction begins."""
        n = len(self._deceleration)
        observation = self._arm.batch.observation[0]
        self._past.append(observation[:n].copy())
        self._measured = observation[n : 2 * n].copy()
        if self._since is None and (info["alarm"] if self.trigger == "alarm" else info["force"]):
            self._since = 0.0
            self._speed = self._measured
        self._tau = info["residual"] if self.trigger == "alarm" else info["tau_ext"]

    def _react(self) -> tuple[int, Array]:
        """The replacement of the next action: an :class:`Override`, joint velocities [rad/s]."""
        assert self._since is not None
        if self.reaction == "stop0":
            return (
                Override.LIMP if self._since < BRAKE_DELAY - 1e-9 else Override.BRAKE
            ), self._speed
        if self.reaction == "admittance":
            step = self._period / ADMITTANCE_INERTIA
            damping = ADMITTANCE_INERTIA / ADMITTANCE_TIME
            push = np.sign(self._tau) * np.maximum(np.abs(self._tau) - self._dead, 0)
            push = push / self._inertia
            # The damping is integrated implicitly, so this is stable for any period.
            self._speed = (self._speed + step * push) / (1 + step * damping)
            return Override.VELOCITY, self._speed
        stopped = self._slow_down()
        if self.reaction == "stop1" and stopped:
            return Override.BRAKE, self._speed
        if self.reaction == "retract" and stopped:
            return Override.VELOCITY, self._backward_velocity()
        return Override.VELOCITY, self._speed

    def _slow_down(self) -> bool:
        """Slow all joints together, so that the arm stays on its path; True once it stands still.

        If the contact has already slowed the arm down, the stop continues from the measured speed.
        A speed that depended on time alone would accelerate the arm against the person.
        """
        squared = float(self._speed @ self._speed)
        if squared > 0:
            fraction = float(self._measured @ self._speed) / squared
            self._speed = self._speed * min(max(fraction, 0.0), 1.0)
        fastest = (np.abs(self._speed) / self._deceleration).max()
        if fastest <= self._period:
            self._speed = np.zeros_like(self._speed)
            return True
        self._speed = self._speed * (1 - self._period / fastest)
        return False

    def _backward_velocity(self) -> Array:
        """Velocity backwards along the stored path; zero after the end of the retraction."""
        if self._returning is None:
            rows, each = np.array(self._past), round(1 / RETRACT_SPEED)
            assert self._since is not None
            gone = each * round(self._since / self._period)  # number of steps back to the trigger
            speeds = -np.diff(rows, axis=0)[::-1] / (each * self._period)
            back = np.repeat(speeds, each, axis=0)[: gone + self._retract_steps]
            self._returning = list(back)
        return self._returning.pop(0) if self._returning else np.zeros_like(self._speed)
