"""Draws from what a residual says about a contact's force: how sure its size is.

The mean force of :mod:`~tauguard.detectors.diagnosis.contact_force` hides how little a residual may
say: a force through the joints' axes turns none of them. Draws over points, scales and forces keep
that: where the size is not identifiable, theirs spread as far as the prior.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import log_ndtr, ndtr, ndtri

from tauguard.arrays import Array
from tauguard.detectors.diagnosis.contact_force import (
    FRICTION,
    SCALES,
    link_poses,
    point_jacobians,
)
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.models.link_surface import LinkSurface

#: Draws, and their seed: the same residual has the same answer.
DRAWS, SEED = 600, 5


def force_draws(
    robot: RobotNumbers,
    surface: LinkSurface,
    q: ArrayLike,
    residual: Array,
    noise: Array,
    probability: Array,
    count: int = DRAWS,
) -> Array:
    """Forces on the arm that a residual may come from, world frame [N], shape (count, 3).

    Args:
        robot: the arm.
        surface: its sampled surface.
        q: positions [rad], shape (n,).
        residual: estimate of tau_ext [N m], shape (n,).
        noise: its standard deviation [N m], shape (n,).
        probability: of a contact at each of the surface's points, shape (K,).
        count: of draws.
    """
    rng = np.random.default_rng(SEED)
    places = (np.arange(count) + 0.5) / count
    chosen = np.searchsorted(np.cumsum(probability) / probability.sum(), places)
    chosen = np.minimum(chosen, len(probability) - 1)
    poses, link = link_poses(robot, q), surface.link[chosen]
    turn = poses.rotation[link]
    point = poses.origin[link] + np.einsum("kij,kj->ki", turn, surface.point[chosen])
    inward = -np.einsum("kij,kj->ki", turn, surface.normal[chosen])
    columns = point_jacobians(robot, poses, link, point).transpose(0, 2, 1) / noise[:, None]
    # A standardised force is the same length in all likely directions.
    along = np.einsum("knj,kj->kn", columns, inward)
    columns = FRICTION * columns + (1 - FRICTION) * along[:, :, None] * inward[:, None]
    force = _drawn(columns, residual / noise, inward, rng)
    pushing = np.einsum("kj,kj->k", force, inward)[:, None] * inward
    return np.asarray(FRICTION * force + (1 - FRICTION) * pushing)


def _drawn(columns: Array, y: Array, inward: Array, rng: np.random.Generator) -> Array:
    """One standardised force a row: a scale by its evidence, then a Gaussian cut at the surface.

    Args:
        columns: joint torques in units of the noise for a unit force, shape (K, n, 3).
        y: residual in units of the noise, shape (n,).
        inward: unit normals, shape (K, 3).
        rng: of the draws.
    """
    seen, known = np.einsum("kni,n->ki", columns, y), np.einsum("kni,knj->kij", columns, columns)
    scales = np.array(SCALES)
    precision = known[:, None] + np.eye(3) / scales[:, None, None] ** 2  # (K, S, 3, 3)
    covariance = np.linalg.inv(precision)
    mean = np.einsum("ksij,kj->ksi", covariance, seen)
    spread = np.sqrt(np.einsum("ki,ksij,kj->ks", inward, covariance, inward))
    alpha = np.einsum("ksi,ki->ks", mean, inward) / spread
    log = np.einsum("ksi,ki->ks", mean, seen) - np.linalg.slogdet(precision)[1]
    log = 0.5 * (log - 6 * np.log(scales)) + log_ndtr(alpha)
    weight = np.cumsum(np.exp(log - log.max(axis=1, keepdims=True)), axis=1)
    at = (rng.random(len(weight))[:, None] * weight[:, -1:] > weight).sum(axis=1)
    rows = np.arange(len(weight))
    covariance, mean, spread = covariance[rows, at], mean[rows, at], spread[rows, at]
    factor = np.linalg.cholesky(covariance)
    free = mean + np.einsum("kij,kj->ki", factor, rng.standard_normal(mean.shape))
    # The component along the normal anew, above 0; the others follow it as they are correlated.
    middle = np.einsum("ki,ki->k", mean, inward)
    most = ndtr(middle / spread)
    pressed = middle - spread * ndtri(np.maximum(rng.random(len(rows)) * most, 1e-300))
    missing = pressed - np.einsum("ki,ki->k", free, inward)
    follows = np.einsum("kij,kj->ki", covariance, inward) / spread[:, None] ** 2
    drawn: Array = free + follows * missing[:, None]
    return drawn
