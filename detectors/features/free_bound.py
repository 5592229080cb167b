"""What collision-free motion may leave of a joint's residual, in units of the joint's friction.

Friction is what a model knows least, so all bounds are multiples of each joint's friction level.

* **At rest** static friction may hold any torque, so only its change counts: the residual less a
  baseline that follows it. Motion of any joint stirs the torques of those that stand: the
  controllers' integral action, and loads that move.
* **In motion** the residual itself counts, without slow errors. Its bound is linear in speed and
  accelerations, by a quantile regression on left-out logs that is pulled towards a prior. While a
  joint starts, its friction is between static and sliding: the bound is larger.

``src/regimes.hpp`` says how the bounds are applied. The constants here and there were chosen on
three real arms (UR10e, UR5, UR3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.calibration.recording import Recording
from tauguard.detectors.dynamics.robot import gravity_torque
from tauguard.detectors.estimation.estimator import ArmModel

Array = NDArray[np.float64]

#: Bound at rest: deviations of the noise, and multiples of the friction level.
NOISE, REST = 8.0, 0.12
#: What motion of any joint adds to the bound at rest, and a start to that in motion.
STOP, START = 1.2, 1.0
#: The bound in motion over the 99 % quantile of left-out residuals, and its least value.
MARGIN, LEAST = 1.7, 0.6
#: Prior of that quantile, in friction levels per 1, rad/s, own and largest acceleration [rad/s^2].
PRIOR = np.array([0.3, 0.02, 0.05, 0.03])
#: A friction level from T seconds of motion is widened by hypot(1, this / T).
WIDENING_SECONDS = 40.0
#: Where the logs' gravity torques stand that the friction level is taken at.
LOADED = 0.9


@dataclass(frozen=True, eq=False)
class Bound:
    """Numbers of one arm."""

    friction: Array  #: level of each joint's friction [N m], shape (n,)
    noise: Array  #: deviation of the residual of a joint at rest [N m], shape (n,)
    quantile: Array
    """99 % of the residual in motion [N m per 1, rad/s, rad/s^2, rad/s^2], shape (n, 4)."""

    @classmethod
    def prior(cls, friction: Array) -> Bound:
        """Before any log was looked at."""
        return cls(friction, 0.02 * friction, friction[:, None] * PRIOR)

    @property
    def rest(self) -> Array:
        """Bound of a joint that has long been at rest [N m], shape (n,)."""
        level: Array = np.maximum(NOISE * self.noise, REST * self.friction)
        return level

    @property
    def stop(self) -> Array:
        """What motion of any joint adds to the bound at rest [N m], shape (n,)."""
        return STOP * self.friction

    @property
    def start(self) -> Array:
        """What a start adds to the bound in motion [N m], shape (n,)."""
        return START * self.friction

    @property
    def moving(self) -> Array:
        """Bound in motion per 1, |qd_j|, |qdd_j| and the largest |qdd|, shape (n, 4)."""
        return MARGIN * self.quantile

    @property
    def least(self) -> Array:
        """Least bound in motion [N m], shape (n,)."""
        level: Array = np.maximum(NOISE * self.noise, LEAST * self.friction)
        return level


def friction_level(arm: ArmModel, recordings: Sequence[Recording]) -> Array:
    """What a joint's bounds are measured in [N m], shape (n,).

    Friction at 0.1 rad/s under the load that gravity puts on the joint in the logs, or 1.5 times
    the error in motion where that is more. Without the load, a joint that carries the arm would
    count as one of half its friction. Widened by hypot(1, 40 s / T), chosen on a UR5 with 30 s; T:
    seconds of pieces in which a joint moves.
    """
    n = arm.robot.joints
    level = 1.5 * np.asarray(arm.noise)
    if arm.friction is not None:
        poses = np.concatenate([r.trace.q[:: max(1, len(r.trace.q) // 100)] for r in recordings])
        load = np.quantile(np.abs(gravity_torque(arm.robot, poses)), LOADED, axis=0)
        level = np.maximum(level, arm.friction.coulomb(load=load))
    seconds = sum(float(r.trace.t[-1] - r.trace.t[0]) for r in recordings)
    level = level * np.hypot(1.0, WIDENING_SECONDS / seconds)
    least: Array = np.maximum(level, max(0.02 * float(level.max()), 1e-3))
    assert least.shape == (n,)
    return least
