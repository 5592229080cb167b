"""The touched link, from the evidence of surface points over several samples or the usual rule."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.detectors.diagnosis.contact_force import ContactBelief, contact_belief
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.models.link_surface import LinkSurface

#: A torque is significant in the usual rule if it exceeds this number of standard deviations and
#: this fraction of the largest torque. Both were best on simulated arms that no study uses.
SIGNIFICANT, NOTICED = 6.0, 0.05
#: Number of samples that are used besides the sample with the strongest residual, and the least
#: level of such a sample, as a fraction of the strongest.
MOMENTS, FRACTION = 3, 0.4


@dataclass(frozen=True)
class Trust:
    """Uncertainty of a residual while something touches the arm.

    It consists of the noise of free motion and of errors that grow with the contact's torque:
    friction that changes its sign, errors of the gains, and motion of the links.
    """

    free: float = 3.0  #: factor of the standard deviation in free motion
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
    """Combine the residuals of several samples of one contact.

    The contact point is fixed on its link, while the force can change. So the evidences of each
    point are multiplied. A sample with little information has little influence.

    Args:
        robot: the arm.
        surface: its sampled surface.
        q: positions [rad], shape (M, n).
        residual: estimates of tau_ext [N m], shape (M, n).
        noise: standard deviations of the residuals [N m], shape (M, n).

    Returns:
        The belief, with the points and forces of the last sample.

    Raises:
        ValueError: no sample, or shapes that do not fit.
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
    """Choose samples with a level near the highest one; the sample of the highest level is last.

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

    A contact on a link causes no torque at the joints beyond the link (De Luca et al. 2006).

    Args:
        residual: [N m], shape (n,).
        deviation: standard deviation of the residual in free motion [N m], shape (n,).
        significant: threshold in standard deviations.
        fraction: threshold as a fraction of the largest residual; both have to be exceeded.
    """
    least = np.hypot(significant * deviation, fraction * np.abs(residual).max())
    found = np.flatnonzero(np.abs(residual) > least)
    return int(found[-1]) + 1 if len(found) else 0
