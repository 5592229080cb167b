"""Probability and force of a contact at every point of the arm's surface, and the touched link.

A force f on a link at point p gives the joint torques J_p^T f. Fewer than six joints carry most
links, so a residual alone does not fix f and p (Haddadin, De Luca, Albu-Schaeffer 2017, IV-C).
Besides, a contact is on the surface, and it pushes. Every sampled surface point is therefore a
hypothesis, as in the contact particle filter (Manuelli & Tedrake 2016), but with a Gaussian prior
on the force instead of a friction cone. Then the evidence of a point and the mean of its force have
closed forms, and evidences can be compared between points and links. A point that needs an unlikely
force counts less, and so does one that could have explained any residual.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.arrays import Array
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.findings import ArgumentError
from tauguard.models.link_surface import LinkSurface

#: Equally likely standard deviations of the force along the normal, in the prior [N].
SCALES = np.array([10.0, 30.0, 100.0, 300.0])
#: Standard deviation of the tangential force divided by that of the normal force.
FRICTION = 0.5


@dataclass(frozen=True, eq=False)
class LinkPoses:
    """Poses of the links and axes of the joints in the world frame."""

    rotation: Array  #: shape (n, 3, 3)
    origin: Array  #: [m], shape (n, 3)
    axis: Array  #: of the joint, shape (n, 3)
    moved_by: NDArray[np.bool_]  #: [i, j]: joint j moves link i, shape (n, n)


def link_poses(robot: RobotNumbers, q: ArrayLike) -> LinkPoses:
    """Forward kinematics at ``q`` [rad], shape (n,).

    Raises:
        ArgumentError: another shape, or numbers that are not finite.
    """
    n = robot.joints
    at = np.asarray(q, dtype=np.float64)
    if at.shape != (n,) or not np.isfinite(at).all():
        raise ArgumentError(f"q: shape {at.shape}, expected ({n},) finite numbers")
    rotation, origin = np.empty((n, 3, 3)), np.empty((n, 3))
    moved_by = np.eye(n, dtype=np.bool_)
    for i in range(n):
        parent, own = int(robot.parent[i]), robot.axis[i]
        turned, place = robot.rotation[i], robot.translation[i]
        if robot.prismatic[i]:
            place = place + turned @ own * at[i]
        else:
            turned = turned @ _turn(own, float(at[i]))
        if parent >= 0:
            place = origin[parent] + rotation[parent] @ place
            turned = rotation[parent] @ turned
            moved_by[i] |= moved_by[parent]
        rotation[i], origin[i] = turned, place
    axis = np.einsum("nij,nj->ni", rotation, robot.axis)
    return LinkPoses(rotation, origin, axis, moved_by)


def _turn(axis: Array, angle: float) -> Array:
    """Rodrigues' rotation about a unit axis."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn: Array = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turn


def point_jacobians(
    robot: RobotNumbers, poses: LinkPoses, link: NDArray[np.int64], point: Array
) -> Array:
    """Jacobians of points that are fixed to links, shape (K, 3, n).

    Args:
        robot: the arm.
        poses: poses of its links.
        link: 0-based link that each point is fixed to, shape (K,).
        point: world frame [m], shape (K, 3).
    """
    lever = point[:, None, :] - poses.origin
    columns = np.cross(poses.axis, lever)
    columns[:, robot.prismatic] = poses.axis[robot.prismatic]
    columns *= poses.moved_by[link][:, :, None]
    return np.swapaxes(columns, 1, 2)


@dataclass(frozen=True, eq=False)
class ContactBelief:
    """Probability and force of a contact at every sampled point of the surface, one row each."""

    link: NDArray[np.int64]  #: 0-based, shape (K,)
    point: Array  #: world frame [m], shape (K, 3)
    probability: Array  #: probability that the contact is at the point, sums to 1, shape (K,)
    force: Array  #: mean force on the arm if the contact is there, world frame [N], shape (K, 3)
    prior: Array  #: probability of the point without the residual, shape (K,)

    def links(self, count: int) -> Array:
        """Probability of each link, shape (count,)."""
        fractions: Array = np.bincount(self.link, self.probability, minlength=count).astype(float)
        return fractions

    def on(self, link: int) -> tuple[Array, Array]:
        """Mean force [N] of a contact on a link, and the surface point next to its mean point [m].

        Raises:
            ArgumentError: a link without surface.
        """
        rows = np.flatnonzero(self.link == link)
        if not len(rows):
            raise ArgumentError(f"link {link}: no surface was sampled there")
        weight = self.probability[rows] + 1e-300
        weight = weight / weight.sum()
        force, middle = weight @ self.force[rows], weight @ self.point[rows]
        away = np.linalg.norm(self.point[rows] - middle, axis=1)
        return force, self.point[rows[int(away.argmin())]]


def contact_belief(
    robot: RobotNumbers,
    surface: LinkSurface,
    q: ArrayLike,
    residual: Array,
    noise: Array,
) -> ContactBelief:
    """Probability and force of a contact at every surface point, given a residual.

    A priori all links are equally likely, and so are the points of a link and the scales of the
    force.

    Args:
        robot: the arm.
        surface: its sampled surface.
        q: positions [rad], shape (n,).
        residual: estimate of tau_ext [N m], shape (n,).
        noise: standard deviation of the residual without contact [N m], shape (n,).

    Raises:
        ArgumentError: shapes that do not fit, noise that is not above 0, a surface of another arm.
    """
    n = robot.joints
    y, sigma = np.asarray(residual, dtype=float), np.asarray(noise, dtype=float)
    if y.shape != (n,) or sigma.shape != (n,) or not np.isfinite(y).all() or not (sigma > 0).all():
        raise ArgumentError(f"residual, noise: expected ({n},) finite numbers, noise above 0")
    if surface.link.max() >= n:
        raise ArgumentError(f"the surface has link {surface.link.max() + 1}, the robot {n} joints")
    poses = link_poses(robot, q)
    turn = poses.rotation[surface.link]
    point = poses.origin[surface.link] + np.einsum("kij,kj->ki", turn, surface.point)
    inward = -np.einsum("kij,kj->ki", turn, surface.normal).T
    jacobian = point_jacobians(robot, poses, surface.link, point)
    torque = np.ascontiguousarray(jacobian.transpose(2, 1, 0)) / sigma[:, None, None]  # (n, 3, K)
    # Forces in units of their standard deviations are isotropic.
    normal = np.einsum("nik,ik->nk", torque, inward)
    torque = FRICTION * torque + (1 - FRICTION) * normal[:, None] * inward
    log, force = _explain(torque, y / sigma, inward)
    force = FRICTION * force + (1 - FRICTION) * (force * inward).sum(axis=0) * inward
    count = np.bincount(surface.link, minlength=n)
    prior = 1.0 / ((count > 0).sum() * count[surface.link])
    weight = prior * np.exp(log - log.max())
    return ContactBelief(surface.link, point, weight / weight.sum(), force.T, prior)


def _explain(torque: Array, y: Array, inward: Array) -> tuple[Array, Array]:
    """Log evidence (K,) and mean standardised force (3, K) of every point.

    The standardised force is Gaussian with one of :data:`SCALES` as its standard deviation,
    restricted to forces that push inward. Probability and mean of a Gaussian that one plane
    truncates have closed forms. The scales are equally likely a priori, and weighted by their
    evidence.

    Args:
        torque: joint torques in units of the noise for a unit force, shape (n, 3, K).
        y: residual in units of the noise, shape (n,).
        inward: unit normals, shape (3, K).
    """
    from scipy.special import log_ndtr

    seen = np.tensordot(y, torque, 1)
    loose = 1 / SCALES[:, None] ** 2
    xx, yy, zz = ((torque[:, i] ** 2).sum(axis=0) + loose for i in range(3))
    xy, xz, yz = ((torque[:, i] * torque[:, j]).sum(axis=0) for i, j in ((0, 1), (0, 2), (1, 2)))
    # Cofactors invert many 3 x 3 matrices in a tenth of the time of factorisations.
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    d, e, f = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    determinant = xx * a + xy * b + xz * c

    def solved(v: Array) -> Array:
        columns = (a * v[0] + b * v[1] + c * v[2], b * v[0] + d * v[1] + e * v[2])
        found: Array = np.stack([*columns, c * v[0] + e * v[1] + f * v[2]]) / determinant
        return found  # (3, S, K)

    mean, along = solved(seen), solved(inward)
    spread = np.sqrt((along * inward[:, None]).sum(axis=0))
    alpha = (mean * inward[:, None]).sum(axis=0) / spread
    pushing = log_ndtr(alpha)
    log = (mean * seen[:, None]).sum(axis=0) - np.log(determinant) - 6 * np.log(SCALES)[:, None]
    log = 0.5 * log + pushing
    mean += np.exp(-0.5 * alpha**2 - 0.5 * np.log(2 * np.pi) - pushing) / spread * along
    highest = log.max(axis=0)
    weight = np.exp(log - highest)
    whole = weight.sum(axis=0)
    return highest + np.log(whole), (mean * weight).sum(axis=1) / whole


#: In :func:`last_joint`, a torque is significant if it exceeds SIGNIFICANT standard deviations and
#: NOTICED times the largest torque. Both were best on simulated arms that no study uses.
SIGNIFICANT, NOTICED = 6.0, 0.05
MOMENTS = 3  # number of samples that are used besides the one with the strongest residual
FRACTION = 0.4  # least level of such a sample, as a fraction of the strongest


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
        ArgumentError: no sample, or shapes that do not fit.
    """
    if not len(q) or not len(q) == len(residual) == len(noise):
        raise ArgumentError(
            f"q, residual, noise: {len(q)}, {len(residual)} and {len(noise)} moments, "
            "expected as many of each, at least one"
        )
    each = [contact_belief(robot, surface, *row) for row in zip(q, residual, noise, strict=True)]
    prior = each[0].prior
    log = sum(np.log(one.probability + 1e-300) - np.log(prior) for one in each) + np.log(prior)
    weight = np.exp(log - log.max())
    return replace(each[-1], probability=weight / weight.sum())


def moments(level: Array) -> NDArray[np.int64]:
    """Samples whose level (M,) is near the highest; the one with the highest level is last."""
    strong = np.flatnonzero(level >= FRACTION * level.max())
    spread = strong[np.unique(np.linspace(0, len(strong) - 1, MOMENTS).round().astype(np.int64))]
    return np.append(spread, int(level.argmax()))


def last_joint(residual: Array, deviation: Array) -> int:
    """The link of the last joint with a significant residual, 1-based; 0 if none.

    A contact on a link causes no torque at the joints beyond the link (De Luca et al. 2006).

    Args:
        residual: [N m], shape (n,).
        deviation: standard deviation of the residual in free motion [N m], shape (n,).
    """
    least = np.hypot(SIGNIFICANT * deviation, NOTICED * np.abs(residual).max())
    found = np.flatnonzero(np.abs(residual) > least)
    return int(found[-1]) + 1 if len(found) else 0
