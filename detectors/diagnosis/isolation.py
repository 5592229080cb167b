"""Which link was touched: every surface point judged over several moments, and the usual rule."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.detectors.diagnosis.contact_force import ContactBelief, contact_belief
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.models.link_surface import LinkSurface

#: The usual rule counts torques above this number of deviations and this fraction of the largest
#: torque. These values were best on simulated arms that no study uses.
SIGNIFICANT, NOTICED = 6.0, 0.05
#: Number of moments that are used besides the strongest one, and the fraction of its level that
#: they need.
MOMENTS, FRACTION = 3, 0.4


@dataclass(frozen=True)
class Trust:
    """Uncertainty of a residual while something touches the arm.

    The noise of free motion is one part. A contact adds errors that grow with it: friction that
    changes sign, errors of the gain, and motion of the links.
    """

    free: float = 3.0  #: deviations of free motion
    own: float = 0.05  #: fraction of the joint's own residual
    largest: float = 0.03  #: fraction of the largest residual of all joints

    def noise(self, residual: Array, deviation: Array) -> Array:
        """Standard deviations [N m], shape (..., n), for residuals of the same shape."""
        size = np.abs(residual)
        most = size.max(axis=-1, keepdims=True)
        value: Array = np.sqrt(
            (self.free * deviation) ** 2 + (self.own * size) ** 2 + (self.largest * most) ** 2
        )
        return value


def isolate(
    robot: RobotNumbers,
    surface: LinkSurface,
    q: Array,
    residual: Array,
    noise: Array,
) -> ContactBelief:
    """Combine several moments of one contact.

    The point stays the same on its link while the force may change, so the evidences of a point
    multiply. A moment with little information changes little.

    Args:
        robot: the arm.
        surface: its sampled surface.
        q: positions [rad], shape (M, n).
        residual: estimates of tau_ext [N m], shape (M, n).
        noise: their standard deviations [N m], shape (M, n).

    Returns:
        The belief: points and forces are those of the last moment.

    Raises:
        ValueError: no moment, or shapes that do not fit.
    """
    if not len(q) or not len(q) == len(residual) == len(noise):
        raise ValueError(
            f"q, residual, noise: {len(q)}, {len(residual)} and {len(noise)} moments, "
            "expected as many of each, at least one"
        )
    each = [contact_belief(robot, surface, *row) for row in zip(q, residual, noise, strict=True)]
    prior = each[0].prior
    log = sum(np.log(one.probability + 1e-300) - np.log(prior) for one in each) + np.log(prior)
    weight = np.exp(log - log.max())
    return replace(each[-1], probability=weight / weight.sum())


def moments(level: Array, most: int = MOMENTS, fraction: float = FRACTION) -> NDArray[np.int64]:
    """Choose samples: spread over those near the highest level, which comes last.

    Args:
        level: strength of the residual, shape (M,).
        most: number of samples besides the highest one.
        fraction: least level of a sample, as a fraction of the highest.
    """
    strong = np.flatnonzero(level >= fraction * level.max())
    spread = strong[np.unique(np.linspace(0, len(strong) - 1, most).round().astype(np.int64))]
    return np.append(spread, int(level.argmax()))


def last_joint(
    residual: Array, deviation: Array, significant: float = SIGNIFICANT, fraction: float = NOTICED
) -> int:
    """The usual rule: the link of the last joint with a significant residual, 1-based; 0 if none.

    A contact on a link moves no joint behind it (De Luca et al. 2006).

    Args:
        residual: [N m], shape (n,).
        deviation: its standard deviation in free motion [N m], shape (n,).
        significant: threshold in standard deviations.
        fraction: threshold as a fraction of the largest residual; both are combined.
    """
    least = np.hypot(significant * deviation, fraction * np.abs(residual).max())
    found = np.flatnonzero(np.abs(residual) > least)
    return int(found[-1]) + 1 if len(found) else 0
