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
from tauguard.findings import ArgumentError

#: More rows than this are thinned out.
ROWS = 2000


def upper_quantile(
    x: Array, y: Array, quantile: float, prior: Array, weight: Array, rows: int = ROWS
) -> Array:
    """Coefficients c >= 0 so that ``x @ c`` is about the quantile of ``y``.

    They minimise the pinball loss plus ``weight @ |c - prior|``, so coefficients without data equal
    the prior. The dual of the linear programme is solved, because it has few constraints.

    Args:
        x: at least 0, shape (R, k).
        y: shape (R,).
        quantile: probability, between 0 and 1.
        prior: shape (k,).
        weight: of ``|c - prior|``, as a number of rows of x = 1, shape (k,).
        rows: number of rows that are used; the loss is scaled to that of all rows.

    Returns:
        Shape (k,).

    Raises:
        ArgumentError: the programme has no solution, because numbers are not finite.
    """
    from scipy.optimize import linprog

    k, stride = x.shape[1], max(1, -(-len(y) // rows))
    x, y = x[::stride], y[::stride]
    # Maximise a (y - x prior) - m prior over a in [-(1 - quantile), quantile] stride and m >= 0,
    # with |x^T a + m| <= pull. The multipliers of this constraint are c - prior.
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
        raise ArgumentError(f"quantile regression: {found.message}")
    cost = found.ineqlin.marginals
    coefficients: Array = np.maximum(prior - (cost[:k] - cost[k:]), 0.0)
    return coefficients


#: The bound at rest is the larger of NOISE standard deviations and REST friction levels.
NOISE, REST = 6.5, 0.12

#: Additions to a bound, in friction levels. STOP: to the bound at rest by motion of any joint.
#: TURNED: to the bound of a joint that a contact turned. START: to the bound in motion by a start.
STOP, TURNED, START = 1.2, 0.6, 1.0

#: The bound in motion is MARGIN times the 99 % quantile of left-out residuals, at least LEAST
#: friction levels.
MARGIN, LEAST = 1.7, 0.6

#: Prior coefficients of that quantile [friction levels], for 1, |qd| [rad/s], |qdd| of the joint
#: and largest |qdd| of all joints [rad/s^2], and exp(-|qd| / CREEP), the slowness.
PRIOR = np.array([0.3, 0.02, 0.05, 0.03, 0.3])

#: A friction level from logs of T seconds is multiplied by hypot(1, WIDENING_SECONDS / T).
WIDENING_SECONDS = 40.0

KNOWN_SECONDS = 4.0  # motion of a joint after which its own friction has half of the weight [s]
FULL_SPEED = 0.05  # speed above which this motion counts [rad/s]

SHOWN_SECONDS = 1.0  # least motion of a joint in the logs for its motion to count as known [s]
BEYOND = 0.1  # distance within which any other joint has to stay at its positions in the logs [rad]
ANYWHERE = 1e6  # value of an unlimited position, speed or acceleration
_ENDS = ("min", "max")

#: Quantile of the gravity torques of a joint in the logs at which its friction is computed.
LOADED = 0.9


@dataclass(frozen=True, eq=False)
class Bound:
    """Bound of one arm's residual in collision-free motion, at rest and while joints move."""

    friction: Array  #: friction level, the unit of each joint's error in motion [N m], shape (n,)
    static: Array  #: friction level of each joint at rest [N m], shape (n,)
    noise: Array  #: standard deviation of the residual of a joint at rest [N m], shape (n,)
    quantile: Array
    """Coefficients of the 99 % quantile of the residual in motion, see :data:`PRIOR`
    [N m per 1, rad/s, rad/s^2, rad/s^2, 1], shape (n, 5)."""
    low: Array
    """Least position of joints that move in no log, -ANYWHERE for all other joints [rad], (n,)."""
    high: Array  #: largest position of these joints, ANYWHERE for all other joints [rad], (n,)
    fast: Array  #: speed that the logs reach, :data:`ANYWHERE` if unlimited [rad/s], (n,)
    hard: Array  #: acceleration that the logs reach, ANYWHERE if unlimited [rad/s^2], (n,)
    scale: Array
    """Factors from held-out logs on the bound at rest, on the addition by motion, and on the bound
    in motion, shape (3, n)."""

    def __post_init__(self) -> None:
        """Refuse ``fast`` and ``hard`` that are not finite or not above 0: ``ArgumentError``."""
        for name in ("fast", "hard"):
            own = getattr(self, name)
            if not (np.isfinite(own) & (own > 0)).all():
                raise ArgumentError(f"{name} {own}: expected finite numbers above 0")

    @classmethod
    def prior(cls, friction: Array, static: Array, low: Array, high: Array) -> Bound:
        """The bound before it is fitted to recordings."""
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
        """Whether each joint moves in the logs, shape (n,)."""
        return self.high >= ANYWHERE

    @property
    def rest(self) -> Array:
        """Bound of a joint that has long been at rest [N m], shape (n,)."""
        least = np.where(self.shown | ~self.shown.any(), REST, REST + STOP)
        level: Array = np.maximum(NOISE * self.noise, self.scale[0] * least * self.static)
        return level

    @property
    def stop(self) -> Array:
        """Addition to the bound at rest by motion of any joint [N m], shape (n,)."""
        added: Array = STOP * self.scale[1] * self.static
        return added

    @property
    def start(self) -> Array:
        """Addition to the bound in motion by a start of the joint [N m], shape (n,)."""
        return START * self.static

    @property
    def moving(self) -> Array:
        """Coefficients of the bound in motion, ordered as ``quantile``, shape (n, 5)."""
        bound: Array = MARGIN * self.scale[2][:, None] * self.quantile
        return bound

    @property
    def least(self) -> Array:
        """Least bound in motion [N m], shape (n,)."""
        level: Array = np.maximum(NOISE * self.noise, LEAST * self.scale[2] * self.friction)
        return level


def friction_levels(arm: ArmModel, recordings: Sequence[Recording]) -> tuple[Array, Array]:
    """Friction levels in motion and at rest, the units of a joint's bounds [N m], shapes (n,).

    At rest, the level is the joint's friction at 0.1 rad/s under the gravity torque in the logs.
    Without that torque, a joint that carries the arm could have half its friction. In motion, the
    level is the same, or 1.5 times the error if that is larger. Both are multiplied by
    hypot(1, 40 s / T) for logs of T seconds in all. Both are weighted means of the joint's own
    level, with the weight T_j / (T_j + 4 s) for T_j seconds of motion, and the arm's largest level.
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
    """Time for which each joint moved faster than :data:`FULL_SPEED` [s], shape (n,)."""
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

#: Error of the model in motion, in friction levels; it is the noise of the estimator.
ERROR = 0.3
#: Largest speed of a joint at rest [rad/s].
SLOW = _observer.REGIME_SLOW
#: Speed at which the slowness of a joint is 1/e [rad/s].
CREEP = _observer.REGIME_CREEP


def native(arm: ArmModel, bound: Bound, load: LoadDeviation) -> _observer.FreeMotion:
    """The native detector of one recording.

    Args:
        arm: calibrated, with friction.
        bound: bound of its joints.
        load: uncertainty of the load.
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
