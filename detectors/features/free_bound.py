"""``Bound``, the bound of the residual in free motion, and the quantile fit that learns it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tauguard.arrays import Array, Bools
from tauguard.detectors import _observer
from tauguard.detectors.calibration.recording import LoadDeviation, Recording
from tauguard.detectors.dynamics.robot import gravity_torque
from tauguard.detectors.estimation.estimator import ArmModel, Estimator, Unknowns

#: More rows than this are thinned out.
ROWS = 2000


def upper_quantile(
    x: Array, y: Array, quantile: float, prior: Array, weight: Array, rows: int = ROWS
) -> Array:
    """Coefficients c >= 0 so that ``x @ c`` is about the quantile of ``y``.

    They minimise the pinball loss plus ``weight @ |c - prior|``, so coefficients without data keep
    the prior. The linear programme is solved in its dual, which has few constraints.

    Args:
        x: at least 0, shape (R, k).
        y: shape (R,).
        quantile: between 0 and 1.
        prior: shape (k,).
        weight: weight of the distance from the prior, as a number of rows of x = 1, shape (k,).
        rows: number of rows that are used; the loss is scaled to that of all rows.

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
        bounds=np.vstack([np.tile(each, (len(y), 1)), np.tile((0.0, np.inf), (k, 1))]),
        method="highs",
    )
    if found.x is None:
        raise ValueError(f"quantile regression: {found.message}")
    cost = found.ineqlin.marginals
    coefficients: Array = np.maximum(prior - (cost[:k] - cost[k:]), 0.0)
    return coefficients


#: Bound at rest: deviations of the noise, and multiples of the friction level.
NOISE, REST = 6.5, 0.12

#: Additions to bounds: by motion of any joint to that at rest, by a contact to that of a joint that
#: it turned, and by a start to that in motion.
STOP, TURNED, START = 1.2, 0.6, 1.0

#: The bound in motion over the 99 % quantile of left-out residuals, and its least value.
MARGIN, LEAST = 1.7, 0.6

#: Prior of that quantile, in friction levels per 1, rad/s, own and largest acceleration [rad/s^2],
#: and slowness, exp(-|qd| / CREEP).
PRIOR = np.array([0.3, 0.02, 0.05, 0.03, 0.3])

#: A friction level from T seconds of motion is widened by hypot(1, this / T).
WIDENING_SECONDS = 40.0

#: Motion of a joint [s] above a speed [rad/s] at which its own friction counts half.
KNOWN_SECONDS, FULL_SPEED = 4.0, 0.05

#: Least motion of a joint whose motion counts as known [s]. Another joint may stand only where it
#: stood in the logs, within this distance [rad].
SHOWN_SECONDS, BEYOND, ANYWHERE = 1.0, 0.1, 1e6
_ENDS = ("min", "max")

#: Quantile of the logs' gravity torques at which the friction level is taken.
LOADED = 0.9


@dataclass(frozen=True, eq=False)
class Bound:
    """Bound of one arm's residual in collision-free motion, at rest and while joints move."""

    friction: Array  #: level of each joint's error in motion [N m], shape (n,)
    static: Array  #: friction that may hold each joint at rest [N m], shape (n,)
    noise: Array  #: deviation of the residual of a joint at rest [N m], shape (n,)
    quantile: Array
    """99 % of the residual in motion [N m per 1, rad/s, rad/s^2, rad/s^2, 1], shape (n, 5)."""
    low: Array
    """Least position of joints that move in no log [rad], -ANYWHERE for others, shape (n,)."""
    high: Array  #: their largest position, ANYWHERE for others
    fast: Array  #: speed that the logs show, :data:`ANYWHERE` for any [rad/s], (n,)
    hard: Array  #: the same of the acceleration [rad/s^2], (n,)
    scale: Array
    """Factors from held-out logs on the prior bounds: at rest, added by motion, and in motion,
    shape (3, n)."""

    def __post_init__(self) -> None:
        """Refuse speeds or accelerations of which no multiple is a number: no alarm would come."""
        for name in ("fast", "hard"):
            own = getattr(self, name)
            if not (np.isfinite(own) & (own > 0)).all():
                raise ValueError(f"{name} {own}: expected finite numbers above 0")

    @classmethod
    def prior(cls, friction: Array, static: Array, low: Array, high: Array) -> Bound:
        """The bound to start from, before it is fitted to recordings."""
        return cls(
            friction,
            static,
            0.02 * static,
            friction[:, None] * PRIOR,
            low,
            high,
            np.full(len(friction), ANYWHERE),
            np.full(len(friction), ANYWHERE),
            np.ones((3, len(friction))),
        )

    @property
    def shown(self) -> Bools:
        """Which joints' motion the logs show, shape (n,)."""
        return self.high >= ANYWHERE

    @property
    def rest(self) -> Array:
        """Bound of a joint that has long been at rest [N m], shape (n,)."""
        least = np.where(self.shown | ~self.shown.any(), REST, REST + STOP)
        level: Array = np.maximum(NOISE * self.noise, self.scale[0] * least * self.static)
        return level

    @property
    def stop(self) -> Array:
        """What motion of any joint adds to the bound at rest [N m], shape (n,)."""
        added: Array = STOP * self.scale[1] * self.static
        return added

    @property
    def start(self) -> Array:
        """What a start adds to the bound in motion [N m], shape (n,)."""
        return START * self.static

    @property
    def moving(self) -> Array:
        """Bound in motion per 1, |qd_j|, |qdd_j|, the largest |qdd| and slowness, (n, 5)."""
        bound: Array = MARGIN * self.scale[2][:, None] * self.quantile
        return bound

    @property
    def least(self) -> Array:
        """Least bound in motion [N m], shape (n,)."""
        level: Array = np.maximum(NOISE * self.noise, LEAST * self.scale[2] * self.friction)
        return level


def friction_levels(arm: ArmModel, recordings: Sequence[Recording]) -> tuple[Array, Array]:
    """The units of a joint's bounds, in motion and at rest [N m], shapes (n,).

    At rest it is the joint's friction at 0.1 rad/s under the gravity torque in the logs; without
    that torque, a joint that carries the arm would count as one with half its friction. In motion
    it is the same, or 1.5 times the error if that is larger. Both are widened by
    hypot(1, 40 s / T) for T seconds of motion. A joint's own friction has the weight
    T_j / (T_j + 4 s), and the arm's largest friction has the rest.
    """
    n = arm.robot.joints
    error = 1.5 * np.asarray(arm.noise)
    static = np.zeros(n)
    if arm.friction is not None:
        poses = np.concatenate([r.trace.q[:: max(1, len(r.trace.q) // 100)] for r in recordings])
        load = np.quantile(np.abs(gravity_torque(arm.robot, poses)), LOADED, axis=0)
        static = arm.friction.coulomb(load=load)
    seconds = sum(float(r.trace.t[-1] - r.trace.t[0]) for r in recordings)
    own = motion_seconds(recordings)
    known = own / (own + KNOWN_SECONDS)
    levels = []
    for level in (np.maximum(error, static), static):
        widened = level * np.hypot(1.0, WIDENING_SECONDS / seconds)
        most = float((known * widened).max())
        widened = known * widened + (1 - known) * most
        levels.append(np.maximum(widened, max(0.02 * most, 1e-3)))
        assert levels[-1].shape == (n,)
    return levels[0], levels[1]


def motion_seconds(recordings: Sequence[Recording]) -> Array:
    """How long each joint moved faster than :data:`FULL_SPEED` [s], shape (n,)."""
    own = [(np.abs(r.trace.qd) > FULL_SPEED).sum(axis=0) * r.trace.dt for r in recordings]
    return np.asarray(np.sum(own, axis=0), dtype=np.float64)


def standing_positions(recordings: Sequence[Recording]) -> tuple[Array, Array]:
    """Positions of joints that hardly moved, a little beyond, as in :class:`Bound` [rad]."""
    shown = motion_seconds(recordings) >= SHOWN_SECONDS
    q = [r.trace.q for r in recordings]
    low, high = (getattr(np, name)([getattr(x, name)(axis=0) for x in q], axis=0) for name in _ENDS)
    return np.where(shown, -ANYWHERE, low - BEYOND), np.where(shown, ANYWHERE, high + BEYOND)


#: Rate of the observer [1/s].
FREE_GAIN = 30.0

#: Error of the model in motion, in friction levels: the noise of the estimator.
ERROR = 0.3

#: A joint slower than this [rad/s] for a while is at rest.
SLOW = _observer.REGIME_SLOW

#: Slowness of a joint falls to 1/e at this speed [rad/s].
CREEP = _observer.REGIME_CREEP


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
        (TURNED * bound.static).tolist(),
        bound.fast.tolist(),
        bound.hard.tolist(),
        bound.friction.tolist(),
        bound.low.tolist(),
        bound.high.tolist(),
    )
