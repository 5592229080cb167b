"""How much residual collision-free motion may leave: a bound a joint, linear in what is measured.

Terms: 1; the joint's speed; the sums of all speeds and of all accelerations; and how much the
rigid-body torque at the joint has changed within the last second or so. The last one is for joints
at rest: static friction may take all of such a change or none of it, and no current tells which.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from tauguard.detectors.numbers import RobotNumbers, momentum_terms
from tauguard.detectors.observer import intervals, low_pass

Array = NDArray[np.float64]

TERMS = 5
#: Rate at which a change of torque is forgotten, as the tracked offset follows it [1/s].
FORGET = 1.0


def torque_change(robot: RobotNumbers, t: Array, q: Array, qd: Array, gain: float) -> Array:
    """Rigid-body torque less its own slow average [N m], shape (T, n).

    Args:
        robot: calibrated.
        t: [s], shape (T,).
        q: [rad], shape (T, n).
        qd: [rad/s], shape (T, n).
        gain: of the observer, whose filter the torque passes through [1/s].
    """
    n, dt = robot.joints, intervals(t, len(t))
    torque = low_pass(np.full(n, gain), dt, *momentum_terms(robot, q, qd))
    start = torque[min(len(torque) - 1, int(np.searchsorted(t, t[0] + 5 / gain)))]
    shifted = torque - start
    nothing = np.zeros_like(torque)
    slow = low_pass(np.full(n, FORGET), dt, nothing, nothing, np.ascontiguousarray(-shifted))
    change: Array = shifted - slow
    return change


def terms(qd: Array, acceleration: Array, change: Array) -> Array:
    """The terms of every joint, shape (T, n, TERMS)."""
    speed = np.abs(qd)
    shaken = np.abs(acceleration).sum(axis=-1, keepdims=True)
    columns = np.ones_like(qd), speed, speed.sum(axis=-1, keepdims=True), shaken, np.abs(change)
    return np.stack([np.broadcast_to(c, qd.shape) for c in columns], axis=-1)


@dataclass(frozen=True, eq=False)
class Allowance:
    """A bound on each joint's residual."""

    weights: Array  #: not negative [N m per unit of each term], shape (n, TERMS)

    @classmethod
    def fit(cls, left: Array, terms: Array, use: NDArray[np.bool_]) -> Allowance:
        """Non-negative least squares of ``|left|``.

        Args:
            left: residual without collisions [N m], shape (T, n).
            terms: shape (T, n, TERMS).
            use: rows of each joint that count, shape (T, n); a joint with fewer than 50 takes all.
        """
        weights = np.zeros((left.shape[1], TERMS))
        for j in range(left.shape[1]):
            rows = use[:, j] if use[:, j].sum() >= 50 else np.ones(len(left), dtype=np.bool_)
            size = np.abs(left[rows, j])
            weights[j] = nnls(terms[rows, j], size)[0]
            weights[j, 0] = max(weights[j, 0], 0.1 * float(size.mean()), 1e-9)
        return cls(weights)

    def scale(self, terms: Array) -> Array:
        """The bound [N m] at every sample, shape (T, n)."""
        bound: Array = np.einsum("tjc,jc->tj", terms, self.weights)
        return bound

    def at_least(self, level: Array, pooled: float = 0.5) -> Allowance:
        """The constant term of each joint raised to a common multiple of ``level``.

        What friction leaves is alike in all joints when measured in their Coulomb friction, and
        no log shows all of it for every joint.

        Args:
            level: Coulomb friction [N m], shape (n,).
            pooled: quantile of the joints' ratios that becomes the common multiple; 1: the largest.
        """
        safe = np.maximum(level, 1e-9)
        common = float(np.quantile(self.weights[:, 0] / safe, pooled))
        weights = self.weights.copy()
        weights[:, 0] = np.maximum(weights[:, 0], common * level)
        return Allowance(weights)

    def times(self, factors: Array) -> Allowance:
        """Each joint's bound times its factor, shape (n,)."""
        return Allowance(self.weights * factors[:, None])
