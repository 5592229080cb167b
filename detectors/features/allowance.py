"""How much residual collision-free motion may leave: a bound a joint, linear in what is measured.

Terms: 1; the sum of all speeds; the largest sum of all accelerations of late; how much the
rigid-body torque at the joint has changed within the last second or so; whether the joint has been
slow of late; and how lately any joint has moved. The fourth is for joints at rest: static friction
may take all of such a change or none of it, and no current tells which. The fifth is for joints
that start, stop or turn round, where friction is known least. The last is for joints at rest, too:
after a stop the arm swings out and friction gives way, later next to nothing happens. "Of late" is
the last ``HELD`` seconds, which a blow's residual and its confirmation take.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.optimize import linprog
from scipy.sparse import csr_array, eye_array, hstack

from tauguard.detectors.dynamics.robot import RobotNumbers, momentum_terms
from tauguard.detectors.estimation.observer import intervals, low_pass
from tauguard.detectors.thresholds.rates import block_maxima

Array = NDArray[np.float64]

TERMS = 6
#: Terms that count for a joint at rest, and for one in motion, whose friction is known.
AT_REST, IN_MOTION = (0, 1, 2, 3, 5), (0, 2, 4)
#: Rate at which a change of torque is forgotten, while static friction gives way [1/s].
FORGET = 1.0
#: How long accelerations and slowness count [s].
HELD = 0.2
#: Rate at which accelerations are seen [1/s]: as fast as the jolt of a hard stop comes.
JOLT = 100.0
#: Speed at which a joint is half slow [rad/s].
SLOW = 0.05
#: Rate at which a motion is forgotten once all joints are at rest [1/s].
SETTLES = 1.0
#: Share of the residual's peaks that the unscaled bound covers.
COVERED = 0.8
#: Share of its Coulomb friction that a joint's bound never goes below: friction changes by as much
#: while an arm warms up, and a payload brings more, whatever the training logs say.
LEAST = 0.1


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


def acceleration(t: Array, qd: Array) -> Array:
    """Velocity differentiated at the rate ``JOLT`` [rad/s^2], shape (T, n)."""
    qd = np.ascontiguousarray(qd)
    rate = np.full(qd.shape[1], JOLT)
    out: Array = low_pass(rate, intervals(t, len(t)), qd, np.zeros_like(qd))
    return out


def held(x: Array, samples: int) -> Array:
    """The largest of the last ``samples`` values along the first axis, shape of ``x``."""
    if samples <= 1:
        return x
    out: Array = maximum_filter1d(x, samples, axis=0, origin=(samples - 1) // 2, mode="nearest")
    return out


def stirred(rest: NDArray[np.bool_], dt: float) -> Array:
    """1 while any joint moves and at the start, then falling at the rate ``SETTLES``, shape (T,).

    Args:
        rest: which joints are at rest, shape (T, n).
        dt: sample interval [s].
    """
    index = np.arange(len(rest))
    moved = np.maximum.accumulate(np.where(rest.all(axis=1), 0, index))
    out: Array = np.exp(-SETTLES * dt * (index - moved))
    return out


def terms(
    qd: Array, acceleration: Array, change: Array, rest: NDArray[np.bool_], dt: float
) -> Array:
    """The terms of every joint, shape (T, n, TERMS); causal.

    Args:
        qd: [rad/s], shape (T, n).
        acceleration: [rad/s^2], shape (T, n).
        change: of the rigid-body torque of late [N m], shape (T, n).
        rest: which joints are at rest, shape (T, n).
        dt: sample interval [s].
    """
    speed, samples = np.abs(qd), max(1, round(HELD / dt))
    shaken = held(np.abs(acceleration).sum(axis=-1, keepdims=True), samples)
    slow = held(1 / (1 + (qd / SLOW) ** 2), samples)
    speeds, lately = speed.sum(axis=-1, keepdims=True), stirred(rest, dt)[:, None]
    columns = np.ones_like(qd), speeds, shaken, np.abs(change), slow, lately
    return np.stack([np.broadcast_to(c, qd.shape) for c in columns], axis=-1)


def quantile_bound(x: Array, y: Array, quantile: float) -> Array:
    """Weights, none below 0, of the linear function of ``x`` that ``quantile`` of ``y`` stay below.

    Koenker & Bassett 1978: the linear program that puts ``quantile`` of the weight of all
    differences above the function and the rest below.

    Args:
        x: shape (N, c), not negative.
        y: shape (N,).
        quantile: in (0, 1).

    Returns:
        Shape (c,).
    """
    rows, count = x.shape
    scale = np.maximum(x.mean(axis=0), 1e-9)
    one = eye_array(rows)
    cost = np.concatenate([np.zeros(count), np.full(rows, quantile), np.full(rows, 1 - quantile)])
    found = linprog(cost, A_eq=hstack([csr_array(x / scale), one, -one]), b_eq=y, method="highs")
    weights: Array = found.x[:count] / scale
    return weights


@dataclass(frozen=True, eq=False)
class Allowance:
    """A bound on each joint's residual."""

    weights: Array  #: not negative [N m per unit of each term], shape (n, TERMS)

    @classmethod
    def fit(cls, left: Array, terms: Array, rows: int, columns: Sequence[int]) -> Allowance:
        """A bound that ``COVERED`` of the peaks of ``left`` stay below.

        Args:
            left: level of the residual without collisions [N m], 0 where it does not count,
                shape (T, n). A joint that has no peak gets no more than 1e-9 N m.
            terms: shape (T, n, TERMS).
            rows: samples that have one peak.
            columns: terms to use.
        """
        weights = np.zeros((left.shape[1], TERMS))
        weights[:, 0] = 1e-9
        for j, level in enumerate(left.T):
            at = peaks(level, rows)
            if len(at):
                own = quantile_bound(terms[at, j][:, columns], level[at], COVERED)
                weights[j, columns] = own
                weights[j, 0] = max(weights[j, 0], 0.2 * float(level[at].mean()), 1e-9)
        return cls(weights)

    def where(self, own: NDArray[np.bool_], other: Allowance) -> Allowance:
        """This bound for the joints in ``own``, shape (n,), and ``other`` for the rest."""
        return Allowance(np.where(own[:, None], self.weights, other.weights))

    def scale(self, terms: Array) -> Array:
        """The bound [N m] at every sample, shape (T, n)."""
        bound: Array = np.einsum("tjc,jc->tj", terms, self.weights)
        return bound

    def at_least(self, level: Array) -> Allowance:
        """The constant term of each joint raised to a common multiple of ``level``.

        What friction leaves is alike in all joints when measured in their Coulomb friction, and
        no log shows all of it for every joint. The multiple is the joints' median, and at least
        ``LEAST``.

        Args:
            level: Coulomb friction [N m], shape (n,).
        """
        safe = np.maximum(level, 1e-9)
        common = max(float(np.quantile(self.weights[:, 0] / safe, 0.5)), LEAST)
        weights = self.weights.copy()
        weights[:, 0] = np.maximum(weights[:, 0], common * level)
        return Allowance(weights)

    def times(self, factors: Array) -> Allowance:
        """Each joint's bound times its factor, shape (n,)."""
        return Allowance(self.weights * factors[:, None])


def peaks(level: Array, rows: int) -> NDArray[np.intp]:
    """Index of the largest value above 0 of every ``rows`` samples of ``level``, shape (T,)."""
    high, where = block_maxima(level, rows)
    return where[high > 0]
