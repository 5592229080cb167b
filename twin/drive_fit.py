"""Friction, ripple and what repeats over the joint angle: linear least squares, joint by joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from tauguard.arrays import Array
from tauguard.twin.signals import SLOW, Motion

#: Candidates of the Stribeck velocity [rad/s].
STRIBECK = (0.02, 0.05, 0.1, 0.2, 0.4)
#: Harmonics over one revolution of the joint that the error of the model is expanded in.
HARMONICS = 8
#: Lines of torque ripple in cycles per motor revolution.
LINES = (1.0, 2.0, 4.0)
#: Resampled blocks of the logs behind each interval, and their length [s].
DRAWS, BLOCK = 40, 5.0
#: A harmonic's amplitude is believed to be about this fraction of Coulomb friction over its order.
BELIEF = 0.3


@dataclass(frozen=True, eq=False)
class DriveFit:
    """Of one joint; each number stands with the standard deviation that resampled blocks give."""

    coulomb: tuple[float, float]  #: [N m]
    static: tuple[float, float]  #: level at rest [N m]
    stribeck_velocity: float  #: [rad/s]
    load: tuple[float, float]  #: friction per transmitted torque [1]
    viscous: tuple[float, float]  #: [N m s/rad]
    offset: float  #: [N m]
    even: Array  #: cosine and sine of each harmonic [N m], shape (HARMONICS, 2)
    odd: Array  #: the same, of the part that changes sign with the velocity, (HARMONICS, 2)
    lines: Array  #: cosine and sine of each line of ripple [N m], shape (LINES, 2)
    rms: float  #: of what is left while the joint moves [N m]
    seconds: float  #: of motion of this joint [s]


def columns(q: Array, qd: Array, bodies: Array, gear: float, stribeck: float) -> Array:
    """The regression's columns along a motion of one joint, shape (T, c)."""
    sign = np.tanh(qd / SLOW)
    slip = np.exp(-((qd / stribeck) ** 2))
    first = [sign * (1 - slip), sign * slip, sign * np.abs(bodies), qd, np.ones_like(q)]
    orders = [*range(1, HARMONICS + 1)]
    even = [f(k * q) for k in orders for f in (np.cos, np.sin)]
    lines = [f(c * gear * q) for c in LINES for f in (np.cos, np.sin)]
    return np.stack([*first, *even, *(sign * x for x in even), *lines], axis=1)


def fit_joint(
    joint: int, motions: Sequence[Motion], torques: Sequence[Array], gear: float
) -> DriveFit | None:
    """What one joint loses; None where it moves for less than a block.

    Args:
        joint: its index.
        motions: of the logs.
        torques: gain times current [N m], shape (T, n) each.
        gear: ratio.
    """
    parts = [_moving(joint, m, tau) for m, tau in zip(motions, torques, strict=True)]
    blocks = [block for part in parts for block in part]
    if len(blocks) < 2:
        return None
    fits = [_solve(_grams(blocks, gear, width)) for width in STRIBECK]
    best = int(np.argmin([fit[1] for fit in fits]))
    grams = _grams(blocks, gear, STRIBECK[best])
    rng = np.random.default_rng(joint)
    picks = rng.integers(len(grams), size=(DRAWS, len(grams)))
    drawn = np.array([_solve([grams[k] for k in pick])[0] for pick in picks])
    x, rest = fits[best]
    spread = drawn.std(axis=0)
    rows = sum(len(b[0]) for b in blocks)
    own = [(float(a), float(s)) for a, s in zip(x[:4], spread[:4], strict=True)]
    h = 2 * HARMONICS
    return DriveFit(
        own[0], own[1], STRIBECK[best], own[2], own[3], float(x[4]),
        x[5 : 5 + h].reshape(-1, 2), x[5 + h : 5 + 2 * h].reshape(-1, 2),
        x[5 + 2 * h :].reshape(-1, 2), float(np.sqrt(rest / rows)),
        sum(float(b[4]) for b in blocks),
    )  # fmt: skip


Block = tuple[Array, Array, Array, Array, float]


def _moving(joint: int, motion: Motion, torque: Array) -> list[Block]:
    """Blocks of samples in which the joint moves."""
    found = []
    number = ((motion.t - motion.t[0]) / BLOCK).astype(int)
    moving, dt = motion.moving[:, joint], float(np.median(np.diff(motion.t)))
    for k in np.unique(number):
        rows = moving & (number == k)
        if rows.sum() * dt > 0.1 * BLOCK:
            q, qd, bodies = (a[rows, joint] for a in (motion.q, motion.qd, motion.bodies))
            found.append((q, qd, bodies, torque[rows, joint] - bodies, rows.sum() * dt))
    return found


def _grams(blocks: Sequence[Block], gear: float, stribeck: float) -> list[Array]:
    """Of each block the products of columns and target, shape (c + 1, c + 1)."""
    found = []
    for q, qd, bodies, left, _ in blocks:
        table = np.column_stack([columns(q, qd, bodies, gear, stribeck), left])
        found.append(table.T @ table)
    return found


def _solve(grams: Sequence[Array]) -> tuple[Array, float]:
    """Coefficients, friction not below 0, and the sum of squares that they leave."""
    total = np.sum(grams, axis=0)
    a, b, square = total[:-1, :-1].copy(), total[:-1, -1], float(total[-1, -1])
    # Believed size of harmonics: a fraction of friction, smaller for finer ones; a sample counts a
    # hundredth, as errors of the model last for about so many.
    rows = max(float(a[4, 4]), 1.0)
    level = max(square / rows, 1e-12)
    orders = np.repeat(np.arange(1.0, HARMONICS + 1), 2)
    deviation = BELIEF * np.sqrt(level) / orders
    a[np.diag_indices_from(a)] += 1e-9 * np.trace(a) / len(a)
    at = np.arange(5, 5 + 4 * HARMONICS)
    a[at, at] += 100 * 0.05 * level / np.tile(deviation, 2) ** 2
    root = np.linalg.cholesky(a)
    target = np.linalg.solve(root, b)
    low = np.full(len(b), -np.inf)
    low[:4] = 0.0
    x = lsq_linear(root.T, target, (low, np.inf)).x
    return x, float(square - 2 * x @ total[:-1, -1] + x @ total[:-1, :-1] @ x)
