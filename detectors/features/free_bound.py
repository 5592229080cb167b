"""What collision-free motion may leave of a joint's residual: prior knowledge of geared joints.

All bounds are multiples of the joint's friction level, since friction is what a model knows least:

* **At rest** static friction may hold any torque, so only its change counts: the residual's
  distance from the band of values that it has had of late. The band follows the residual outwards
  and closes behind it, so that what a push leaves is taken up, and letting go is no new push. For
  some seconds after the joint has stopped, or while others move, the controller's integral action
  and the change of load shift the torque: the bound is larger.
* **In motion** the residual itself counts. The bound grows with the inertial torque, and with what
  slow errors may still be (:mod:`~tauguard.detectors.estimation.slow_errors`). While a joint starts
  or creeps, its friction is between static and sliding: the bound is larger.

The constants were chosen on three real arms (UR10e, UR5, UR3); the free logs of an arm then scale
the two bounds of each joint (:mod:`~tauguard.detectors.methods.free_motion`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: A joint slower than this [rad/s] for so long [s] is at rest.
SLOW, WAIT = 0.02, 0.2
#: Bound at rest: deviations of the noise, and multiples of the friction level.
NOISE, REST = 8.0, 0.3
#: What a stop adds at first, and what others' motion adds at ``OTHERS_SPEED`` [rad/s] and above.
STOP, OTHERS, OTHERS_SPEED = 1.4, 1.2, 0.2
#: Time constant with which a stop, and others' motion, are forgotten [s].
SETTLES = 1.0
#: Time constants of the band: outwards, and closing [s].
FOLLOW, CLOSE = 0.3, 0.8
#: Bound in motion, and what a start or creeping at up to ``CREEP`` [rad/s] adds.
MOTION, START, CREEP = 0.5, 1.8, 0.04
#: Time constant with which a start is forgotten [s].
STARTED = 0.12
#: Share of the inertial torque, and for how long it counts [s].
INERTIAL, HELD = 0.2, 0.2


@dataclass(frozen=True, eq=False)
class Bound:
    """Numbers of one arm."""

    friction: Array  #: level of each joint's friction [N m], shape (n,)
    noise: Array  #: deviation of the residual of a joint at rest [N m], shape (n,)
    resting: Array  #: factors of the bound at rest, shape (n,)
    moving: Array  #: factors of the bound in motion, shape (n,)

    @property
    def floor(self) -> Array:
        """Bound of a joint that has long been at rest [N m], shape (n,)."""
        level: Array = np.maximum(NOISE * self.noise, REST * self.friction) * self.resting
        return level

    @property
    def sliding(self) -> Array:
        """Bound of a joint at constant speed, slow errors known [N m], shape (n,)."""
        level: Array = np.maximum(NOISE * self.noise, MOTION * self.friction) * self.moving
        return level


class JointRegimes:
    """What each joint does, what counts of its residual, and its bound; sample by sample.

    Attributes:
        rest: which joints are at rest, shape (n,).
        moved: how long each has been in motion [s], shape (n,).
        signal: what counts of the residual [N m], shape (n,).
        bound: [N m], shape (n,).
    """

    def __init__(self, bound: Bound) -> None:
        """Begin at rest."""
        n = len(bound.friction)
        self._of = bound
        self._slow_for, self.moved = np.full(n, 10.0), np.zeros(n)
        self._low, self._high = np.zeros(n), np.zeros(n)
        self._stirred, self._starting = np.full(n, STOP), np.ones(n)
        self._inertial = np.zeros(n)
        self._others = ~np.eye(n, dtype=np.bool_)
        self._first = True
        self.rest = np.ones(n, dtype=np.bool_)
        self.signal, self.bound = np.zeros(n), np.ones(n)

    def motion(self, qd: Array, inertial: Array, dt: float) -> None:
        """Take up speeds [rad/s] and inertial torques [N m], shape (n,), ``dt`` s after the last.

        Goes before :meth:`judge` of the same sample.
        """
        speed = np.abs(qd)
        slow = speed < SLOW
        self._slow_for = np.where(slow, self._slow_for + dt, 0.0)
        self.moved = np.where(slow, 0.0, self.moved + dt)
        self._stays = self.rest
        self.rest = self._slow_for >= WAIT
        others = np.where(self._others, speed, 0.0).max(axis=1)
        added = np.maximum(
            np.where(slow, 0.0, STOP), OTHERS * np.minimum(1.0, others / OTHERS_SPEED)
        )
        self._stirred = np.maximum(self._stirred * np.exp(-dt / SETTLES), added)
        self._starting = np.maximum(
            self._starting * np.exp(-dt / STARTED), 1 / (1 + (speed / CREEP) ** 2)
        )
        self._inertial = np.maximum(np.abs(inertial), self._inertial * np.exp(-dt / HELD))

    def judge(self, residual: Array, spread: Array, dt: float) -> Array:
        """The ratio of what counts to its bound, shape (n,).

        Args:
            residual: without slow errors [N m], shape (n,).
            spread: deviation that they leave [N m], shape (n,).
            dt: time since the last sample [s].
        """
        stays = self.rest & self._stays & (not self._first)
        self._first = False
        above, below = np.maximum(residual - self._high, 0), np.minimum(residual - self._low, 0)
        out, back = 1 - np.exp(-dt / FOLLOW), 1 - np.exp(-dt / CLOSE)
        self._high += np.where(above > 0, out * above, back * (residual - self._high))
        self._low += np.where(below < 0, out * below, back * (residual - self._low))
        self._high = np.where(stays, self._high, residual)
        self._low = np.where(stays, self._low, residual)
        keep = np.exp(-dt / FOLLOW)
        outside = np.where(stays, keep * (above + below), 0.0)
        self.signal = np.where(self.rest, outside, residual)
        of = self._of
        at_rest = of.floor + of.friction * self._stirred
        pushed = MOTION * of.friction + INERTIAL * self._inertial
        moving = np.maximum(NOISE * of.noise, pushed) * of.moving
        moving = moving + spread + START * of.friction * self._starting
        self.bound = np.where(self.rest, at_rest, moving)
        ratio: Array = np.abs(self.signal) / self.bound
        return ratio
