"""Impulse and peak force of a contact, with intervals from draws of the force given a residual.

A mean force does not show its uncertainty: a force whose line intersects the joint axes causes no
torque. Draws of points, scales and forces show it. If the force is not identifiable, the draws are
spread as widely as the prior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array
from tauguard.detectors.diagnosis.contact_force import (
    FRICTION,
    SCALES,
    ContactBelief,
    Trust,
    link_poses,
    point_jacobians,
)
from tauguard.detectors.diagnosis.post_alarm import PostAlarmWindow
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.models.link_surface import LinkSurface
from tauguard.report import two_digits

#: Number of draws, and the seed, so that the same residual gives the same result.
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
    """Draw forces on the arm that explain a residual, world frame [N], shape (count, 3).

    Args:
        robot: the arm.
        surface: its sampled surface.
        q: positions [rad], shape (n,).
        residual: estimate of tau_ext [N m], shape (n,).
        noise: standard deviation of the residual [N m], shape (n,).
        probability: probability of a contact at each point of the surface, shape (K,).
        count: number of draws.
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
    # Tangential parts are scaled by the friction, so that the prior of the force is isotropic.
    along = np.einsum("knj,kj->kn", columns, inward)
    columns = FRICTION * columns + (1 - FRICTION) * along[:, :, None] * inward[:, None]
    force = _drawn(columns, residual / noise, inward, rng)
    pushing = np.einsum("kj,kj->k", force, inward)[:, None] * inward
    return np.asarray(FRICTION * force + (1 - FRICTION) * pushing)


def _drawn(columns: Array, y: Array, inward: Array, rng: np.random.Generator) -> Array:
    """Draw one force for each candidate point, in standardised units.

    A scale of the prior is drawn by its evidence, then the force from the Gaussian posterior of
    that scale, restricted to forces that push inward.

    Args:
        columns: joint torques in units of the noise for a unit force, shape (K, n, 3).
        y: residual in units of the noise, shape (n,).
        inward: unit normals, shape (K, 3).
        rng: generator of the draws.
    """
    from scipy.special import log_ndtr, ndtr, ndtri

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
    # Draw the normal component again, above 0; shift the tangential ones by their correlation.
    middle = np.einsum("ki,ki->k", mean, inward)
    most = ndtr(middle / spread)
    pressed = middle - spread * ndtri(np.maximum(rng.random(len(rows)) * most, 1e-300))
    missing = pressed - np.einsum("ki,ki->k", free, inward)
    follows = np.einsum("kij,kj->ki", covariance, inward) / spread[:, None] ** 2
    drawn: Array = free + follows * missing[:, None]
    return drawn


#: Probability that an interval contains the true value.
COVERAGE = 0.9

#: The torque is averaged over this number of time constants of the observer before and after each
#: sample.
SMOOTHED = 0.3

#: For long contacts at the tool, the average is over this fraction of the contact's duration,
#: because joints that slip cause peaks.
LONG = 0.1

#: A contact is where the torque is above this fraction of its peak.
CONTACT_FRACTION = 0.15

#: Standard deviation of the force's logarithm besides noise and point: changing directions, errors
#: of gains. Chosen on simulated arms and seeds that no study uses.
SPREAD = 0.2

#: An estimate is not identifiable if the ends of its interval differ by more than this factor.
IDENTIFIABLE = 6.0

#: Largest value of ``ContactTorque.hidden``, the fraction that the samples do not resolve.
UNRESOLVED = 0.9


@dataclass(frozen=True)
class Interval90:
    """An estimate and the interval that contains the true value with probability COVERAGE."""

    value: float  #: the median
    low: float
    high: float

    @classmethod
    def of(cls, draws: Array) -> Interval90:
        """The interval of draws, shape (K,)."""
        low, middle, high = np.quantile(draws, ((1 - COVERAGE) / 2, 0.5, (1 + COVERAGE) / 2))
        return cls(float(middle), float(low), float(high))

    @property
    def identifiable(self) -> bool:
        """Whether the estimate is identifiable, see :data:`IDENTIFIABLE`."""
        return self.high <= IDENTIFIABLE * self.low

    def to_dict(self) -> dict[str, Any]:
        """The interval as JSON values."""
        return {
            "value": self.value,
            "low": self.low,
            "high": self.high,
            "identifiable": self.identifiable,
        }

    def text(self, unit: str) -> str:
        """``120 N [90, 180]``, or ``at least 7 N`` if the estimate is not identifiable."""
        if not self.identifiable:
            return f"at least {two_digits(self.low)} {unit}"
        return f"{two_digits(self.value)} {unit} [{two_digits(self.low)}, {two_digits(self.high)}]"


@dataclass(frozen=True, eq=False)
class ContactTorque:
    """Torques of a contact at the joints, from its beginning to the end of the window."""

    row: int  #: row of the peak among the window's samples
    seconds: float  #: duration of the contact within the window [s]
    impulse: Array  #: integral of tau_ext [N m s], shape (n,)
    peak: Array  #: tau_ext at its peak [N m], shape (n,)
    shape: float  #: peak over mean
    hidden: float  #: fraction of the duration that the samples do not resolve
    goes_on: bool = False  #: the contact had not ended at the end of the window
    first: int = 0  #: first row of the contact
    last: int = -1  #: last row of the contact

    @property
    def mean(self) -> Array:
        """Mean tau_ext [N m], shape (n,)."""
        value: Array = self.impulse / self.seconds
        return value

    def text(self, names: Sequence[str]) -> str:
        """The joint with the largest torque, in a few words."""
        joint = int(np.abs(self.peak).argmax())
        return f"{two_digits(abs(float(self.peak[joint])))} N m at {names[joint]}"

    def to_dict(self) -> dict[str, Any]:
        """Duration, peak torques and impulses, as JSON values."""
        return {
            "contact_s": self.seconds,
            "contact_goes_on": self.goes_on,
            "peak_torque_nm": self.peak.tolist(),
            "joint_impulse_nms": self.impulse.tolist(),
        }

    @classmethod
    def of(cls, after: PostAlarmWindow, smooth: float = 0.0) -> ContactTorque:
        """The torques from the residual around an alarm.

        Args:
            after: the residual.
            smooth: the torque is averaged over this fraction of the contact's duration, if that is
                more than twice :data:`SMOOTHED` lags.
        """
        width, torque, top, along, first, last = _followed(after, 0.0)
        wider = smooth * float(after.t[last] - after.t[first])
        if wider > 2 * width:
            _, torque, top, along, first, last = _followed(after, wider)
        part = slice(first, last + 1)
        seconds = float(after.t[last] - after.t[first])
        step = after.residual[last] - after.residual[first]
        whole = np.trapezoid(after.residual[part], after.t[part], axis=0) + after.lag * step
        shape = along[top] / max(float(along[part].mean()), 1e-12)
        hidden = min(width / seconds, UNRESOLVED)
        goes_on = bool(last == len(after.t) - 1)
        return cls(top, seconds, whole, torque[top], float(shape), hidden, goes_on, first, last)


@dataclass(frozen=True, eq=False)
class Severity:
    """Severity of one contact, from its beginning to the end of the window."""

    impulse: Interval90  #: norm of the force's integral [N s]
    peak: Interval90  #: largest force [N]
    torque: ContactTorque  #: torques, which do not depend on the point of contact

    def text(self, kind: str, names: Sequence[str]) -> str:
        """The severity in a few words, with the impulse of a transient contact.

        If the force has no useful upper bound, the joint torque, which is measured, comes first.

        Args:
            kind: kind of the contact.
            names: names of the joints.
        """
        force = f"peak force {self.peak.text('N')}"
        if kind == "transient":
            force = f"impulse {self.impulse.text('N s')}, {force}"
        if self.peak.identifiable:
            return force
        return f"{self.torque.text(names)}, {force} (more if it acts where it causes little torque)"


def severity(
    robot: RobotNumbers,
    surface: LinkSurface,
    after: PostAlarmWindow,
    belief: ContactBelief,
    moments: int,
    trust: Trust,
) -> Severity:
    """Impulse and peak force over all possible contact points.

    Args:
        robot: the arm.
        surface: its sampled surface.
        after: the residual around the alarm.
        belief: probability of the contact at each point.
        moments: number of samples combined in ``belief``. The root of this order of the belief is
            used, because the errors of the samples are not independent.
        trust: errors of a residual.
    """
    contact_torque = ContactTorque.of(after)
    noise = trust.noise(contact_torque.mean, after.deviation[contact_torque.row])
    place = belief.probability ** (1 / moments)
    force = force_draws(
        robot, surface, after.q[contact_torque.row], contact_torque.mean, noise, place
    )
    rng, spread = np.random.default_rng((SEED, 1)), SPREAD * (1 + contact_torque.hidden)
    size = np.linalg.norm(force, axis=1) * np.exp(spread * rng.standard_normal(len(force)))
    sharper = 1 / (1 - contact_torque.hidden * rng.random(len(force)))
    peak = size * contact_torque.shape * sharper
    return Severity(
        Interval90.of(size * contact_torque.seconds), Interval90.of(peak), contact_torque
    )


def _followed(after: PostAlarmWindow, least: float) -> tuple[float, Array, int, Array, int, int]:
    """Averaging time, averaged torque and its peak, first and last row of a contact."""
    width, torque = _without_lag(after, least)
    top = int(np.linalg.norm(torque / after.deviation, axis=1).argmax())
    along = torque @ (torque[top] / after.deviation[top] ** 2)
    return width, torque, top, along, *_contact(along, top)


def _without_lag(after: PostAlarmWindow, least: float) -> tuple[float, Array]:
    """Averaging time [s], and tau_ext without the observer's lag [N m], shape (M, n)."""
    dt = float(np.median(np.diff(after.t)))
    half = max(1, round(max(SMOOTHED * after.lag, least / 2) / dt))
    raw = after.residual + after.lag * np.gradient(after.residual, after.t, axis=0)
    kernel = np.full(2 * half + 1, 1 / (2 * half + 1))
    padded = np.pad(raw, ((half, half), (0, 0)), mode="edge")
    smooth = [np.convolve(column, kernel, "valid") for column in padded.T]
    return (2 * half + 1) * dt, np.stack(smooth, axis=1)


def _contact(along: Array, top: int) -> tuple[int, int]:
    """First and last sample of a contact; its torque is highest at sample ``top``."""
    weak = along < CONTACT_FRACTION * along[top]
    before, later = np.flatnonzero(weak[:top]), np.flatnonzero(weak[top:])
    first = int(before[-1]) if len(before) else 0
    last = top + int(later[0]) if len(later) else len(along) - 1
    return first, max(last, first + 1)
