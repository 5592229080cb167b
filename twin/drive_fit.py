"""Friction of each joint by Bayesian linear least squares with coefficients of 0 or more.

By the prior, friction at rest equals friction at low speed, and friction does not depend on speed.
The standard deviation of each prior is :data:`BELIEF` times the joint's median friction.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from tauguard.arrays import Array, Bools
from tauguard.twin.signals import Motion

#: Candidates of the Stribeck velocity [rad/s].
STRIBECK = (0.02, 0.05, 0.1, 0.2, 0.4)
#: Candidates of the relative rise of friction at the median load.
LOADS = np.array([0.0, 0.05, 0.1, 0.2, 0.4, 0.8])
#: Speed constants of the friction terms that rise with speed, as of a gear's lubricant [rad/s].
SLOPES = (0.03, 0.1, 0.3, 1.0)
#: A joint is fitted if it moves for at least this time [s].
LEAST = 1.0
#: Standard deviation of the priors, relative to the median friction.
BELIEF = 0.3
#: A sample has the weight 1/SOFTNESS^2, as in the calibration, because errors are not white.
SOFTNESS = 5.0
#: A number counts as not identified if its variance exceeds this fraction of the prior variance.
SHOWN = 0.5


@dataclass(frozen=True, eq=False)
class FrictionFit:
    """Friction of one joint."""

    coulomb: float  #: Coulomb friction [N m]
    static: float  #: friction at rest [N m]
    load: float  #: relative rise of the friction per rigid-body torque [1/(N m)]
    viscous: float  #: [N m s/rad]
    slope: tuple[float, ...]  #: rise of the friction over each speed of :data:`SLOPES` [N m]
    stribeck_velocity: float  #: [rad/s]
    priors: tuple[str, ...] = ()  #: fields that the logs do not identify


def fit_friction(
    joint: int, motions: Sequence[Motion], torques: Sequence[Array]
) -> FrictionFit | None:
    """Friction of one joint; None if it moves for less than :data:`LEAST`.

    Args:
        joint: index of the joint.
        motions: motions of the logs.
        torques: gain times current [N m], shape (T, n) each.
    """
    rows = [m.moving[:, joint] for m in motions]
    dt = np.median(np.concatenate([np.diff(m.t) for m in motions]))
    if sum(r.sum() for r in rows) * dt < LEAST:
        return None
    qd = np.concatenate([m.qd[r, joint] for m, r in zip(motions, rows, strict=True)])
    load = np.concatenate([m.load[r, joint] for m, r in zip(motions, rows, strict=True)])
    left = np.concatenate(
        [(tau - m.bodies)[r, joint] for m, tau, r in zip(motions, torques, rows, strict=True)]
    )
    usual = float(np.median(np.abs(left)))
    fits = [
        (*_solve(qd, load, left, width, rise, usual), rise, width)
        for width in STRIBECK
        for rise in LOADS / max(float(np.median(np.abs(load))), 1e-9)
    ]
    x, _, shown, rise, width = min(fits, key=lambda fit: fit[1])
    names = ("static", "viscous")
    priors = tuple(name for name, seen in zip(names, shown, strict=True) if not seen)
    return FrictionFit(
        float(x[0]), float(x[1]), rise, float(x[2]), tuple(x[3 : 3 + len(SLOPES)]), width, priors
    )


def _solve(
    qd: Array, load: Array, left: Array, stribeck: float, rise: float, usual: float
) -> tuple[Array, float, Bools]:
    """Coefficients, norm of the residual including the priors, and two flags.

    The last two coefficients are a positive and a negative offset. The flags say whether static
    friction minus Coulomb friction, and viscous friction, are identified.
    """
    sign, slip, one = np.sign(qd), np.exp(-((qd / stribeck) ** 2)), np.ones_like(qd)
    more, rises = 1 + rise * np.abs(load), [np.tanh(qd / speed) for speed in SLOPES]
    level = [more * part for part in (sign * (1 - slip), sign * slip, *rises)]
    table = np.stack([*level[:2], qd, *level[2:], one, -one, left], axis=1)
    products = table.T @ table  # its Cholesky factor is a small system with the same residual norms
    products[np.diag_indices_from(products)] *= 1 + 1e-9
    # Rows of the priors: static minus Coulomb friction, viscous friction, slopes.
    about = np.zeros((2 + len(SLOPES), table.shape[1]))
    about[0, :2], about[1:, 2 : 3 + len(SLOPES)] = (-1, 1), np.eye(1 + len(SLOPES))
    noise = _norm(products) / np.sqrt(len(qd))
    about *= SOFTNESS * noise / max(BELIEF * usual, 1e-9)
    products += about.T @ about
    root = np.linalg.cholesky(products).T
    x, rest = nnls(root[:, :-1], root[:, -1])
    spread = np.linalg.pinv(products[:-2, :-2])  # without the negative offset
    both = about[:2, :-2]
    return x, float(rest), np.einsum("ij,jk,ik->i", both, spread, both) < SHOWN


def _norm(products: Array) -> float:
    """Norm of the residual of non-negative least squares."""
    root = np.linalg.cholesky(products).T
    return float(nnls(root[:, :-1], root[:, -1])[1])
