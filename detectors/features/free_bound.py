"""``Bound``, the bound of the residual in free motion, and the quantile fit that learns it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors import _observer
from tauguard.detectors.calibration.recording import Recording
from tauguard.detectors.dynamics.robot import gravity_torque
from tauguard.detectors.estimation.estimator import ArmModel, Estimator, Unknowns


@dataclass(frozen=True)
class LoadDeviation:
    """How uncertain the carried load is."""

    mass: float = 0.0  #: standard deviation [kg]
    moment: float = 0.0  #: of each axis of the first moment [kg m]


#: The deviation of a load that is not known.
UNKNOWN_LOAD = LoadDeviation(3.0, 0.3)

#: More rows than this are thinned out.
ROWS = 2000


def upper_quantile(
    x: Array, y: Array, quantile: float, prior: Array, weight: Array, rows: int = ROWS
) -> Array:
    """Coefficients c >= 0 so that ``x @ c`` is about the quantile of ``y``.

    They minimise the pinball loss and ``weight @ |c - prior|``: what the rows do not show keeps
    the prior. The linear programme is solved in its dual, whose constraints are as few as the
    coefficients.

    Args:
        x: at least 0, shape (R, k).
        y: shape (R,).
        quantile: between 0 and 1.
        prior: shape (k,).
        weight: of the distance from the prior, in rows of x = 1 that say less, shape (k,).
        rows: how many are used; the sum of the loss stays that of all.

    Returns:
        Shape (k,).

    Raises:
        ValueError: the programme has no solution: numbers that are not finite.
    """
    from scipy.optimize import linprog

    k, stride = x.shape[1], max(1, -(-len(y) // rows))
    x, y = x[::stride], y[::stride]
    # max a (y - x prior) - m prior over a in [-(1 - quantile), quantile] stride and m >= 0 with
    # |x^T a + m| <= pull; c - prior is what its constraints cost.
    columns = np.vstack([x, np.eye(k)]).T
    pull = np.maximum((1 - quantile) * weight, 1e-9)
    each = (-(1 - quantile) * stride, quantile * stride)
    found = linprog(
        np.concatenate([x @ prior - y, prior]),
        A_ub=np.vstack([columns, -columns]),
        b_ub=np.tile(pull, 2),
        bounds=[each] * len(y) + [(0.0, None)] * k,
        method="highs",
    )
    if found.x is None:
        raise ValueError(f"quantile regression: {found.message}")
    cost = found.ineqlin.marginals
    coefficients: Array = np.maximum(prior - (cost[:k] - cost[k:]), 0.0)
    return coefficients


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
    """Bound of one arm's residual in collision-free motion, at rest and while joints move."""

    friction: Array  #: level of each joint's friction [N m], shape (n,)
    noise: Array  #: deviation of the residual of a joint at rest [N m], shape (n,)
    quantile: Array
    """99 % of the residual in motion [N m per 1, rad/s, rad/s^2, rad/s^2], shape (n, 4)."""

    @classmethod
    def prior(cls, friction: Array) -> Bound:
        """The bound to start from, before it is fitted to recordings."""
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


#: Rate of the observer [1/s].
FREE_GAIN = 30.0

#: Error of the model in motion, in friction levels: the noise of the estimator.
ERROR = 0.3

#: A joint slower than this [rad/s] for a while is at rest.
SLOW = _observer.REGIME_SLOW


def native(arm: ArmModel, bound: Bound, load: LoadDeviation) -> _observer.FreeMotion:
    """The native detector of one recording.

    Args:
        arm: calibrated, with friction.
        bound: of its joints.
        load: how uncertain the carried load is.
    """
    unknowns = Unknowns.for_logs(load.mass, load.moment)
    believed = replace(arm, noise=ERROR * bound.friction, sensors=None)
    return _observer.FreeMotion(
        Estimator(believed, FREE_GAIN, unknowns=unknowns).native,
        bound.rest.tolist(),
        bound.stop.tolist(),
        bound.least.tolist(),
        bound.moving.ravel().tolist(),
        bound.start.tolist(),
    )
