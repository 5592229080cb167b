"""The force of a contact at the tool, where most contacts of handling and pushing are.

The torques of six joints determine the three components of a force at a known point. The
The torques of six joints determine the three components of a force at a known point. The
uncertainty is in the torques. Friction of a joint at rest takes up part of a push. If the servo
drives the joint back against the push, friction adds to it. The displacement since the contact
began shows which of the two happens, because positions are measured to 1e-5 rad and friction
reverses within 1e-4 rad.
sizes, weighted by their likelihood.
"""

from __future__ import annotations

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.diagnosis.contact_force import link_poses, point_jacobians
from tauguard.detectors.diagnosis.post_alarm import PostAlarmWindow
from tauguard.detectors.diagnosis.severity import (
    CONTACT_FRACTION,
    DRAWS,
    LONG,
    SEED,
    ContactTorque,
    Interval90,
    Severity,
)
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.models.link_surface import LinkSurface

#: Equally likely standard deviations of the force in the prior [N].
SIZES = np.geomspace(5.0, 400.0, 9)
#: Parts of a torque's standard deviation: of every joint [N m]; relative to the torque; for a joint
#: at rest, relative to its largest friction.
LEAST, OWN, HIDDEN = 0.15, 0.05, 0.58
#: Standard deviation of the force's logarithm due to errors of gains and lever arms.
SCALE = 0.15
#: A joint slower than this is at rest [rad/s].
AT_REST = 0.02
#: Length of the tool [m], and number of equally likely contact points along it.
TOOL, PLACES = 0.2, 5
#: Displacement over which friction at rest reverses [rad].
PRESLIDING = 1e-4


def tool_severity(
    arm: ArmModel, after: PostAlarmWindow, surface: LinkSurface | None = None
) -> tuple[Severity, Array]:
    """Impulse and peak of a contact at the tool, and its mean force.

    The tool is on the last joint's axis, up to :data:`TOOL` beyond the end of the last link.

    Args:
        arm: with friction, if joints are geared.
        after: the residual around the alarm.
        surface: surface of the last link, to find its end (default: the end is at its joint).

    Returns:
        The severity, and the force on the arm at its peak, world frame [N], shape (3,).
    """
    torque = ContactTorque.of(after, LONG)
    q, row, n = after.q[torque.row], torque.row, arm.robot.joints
    poses = link_poses(arm.robot, q)
    heights = np.zeros(1) if surface is None else surface.point @ arm.robot.axis[-1]
    side = 1.0 if heights.mean() >= 0 else -1.0
    levers = side * (np.max(side * heights) + np.linspace(0.0, TOOL, PLACES))
    places = poses.origin[-1] + levers[:, None] * poses.axis[-1]
    jacobians = point_jacobians(arm.robot, poses, np.full(PLACES, n - 1), places)
    rest = (np.abs(after.qd[: row + 1]) < AT_REST).all(axis=0)
    friction = rest * (0.0 if arm.friction is None else arm.friction.coulomb())
    turned = friction * _turned(after.q)
    turned = turned - rest * after.residual[0]  # friction of joints at rest before the contact
    peak = torque.peak + turned[row]
    mean = torque.mean + turned[torque.first : torque.last + 1].mean(axis=0)
    deviation = np.sqrt(LEAST**2 + (OWN * np.abs(torque.peak)) ** 2 + (HIDDEN * friction) ** 2)
    along = peak / deviation**2
    # Initial residual and friction are subtracted, so the mean may be small or negative.
    level = float(np.clip(mean @ along / max(float(peak @ along), 1e-12), CONTACT_FRACTION, 1.0))
    force = _draws(jacobians, peak, deviation)
    rng = np.random.default_rng((SEED, 2))
    size = np.linalg.norm(force, axis=1) * np.exp(SCALE * rng.standard_normal(len(force)))
    impulse = size * level * torque.seconds
    return Severity(Interval90.of(impulse), Interval90.of(size), torque), force.mean(axis=0)


def _turned(q: Array) -> Array:
    """Change of friction of joints at rest, relative to the largest friction, shape (M, n).

    Args:
        q: positions [rad], shape (M, n).
    """
    state, before = np.zeros(q.shape[1]), q[0]
    out = np.empty_like(q)
    for k, now in enumerate(q):
        state = np.clip(state + (now - before) / PRESLIDING, -1, 1)
        out[k], before = state, now
    return out


def _draws(jacobians: Array, torque: Array, deviation: Array) -> Array:
    """Draws of the force [N] given joint torques [N m], shape (DRAWS, 3).

    Args:
        jacobians: Jacobians of the possible contact points, shape (P, 3, n).
        torque: shape (n,).
        deviation: deviation of the torques [N m], shape (n,).
    """
    rng, columns, seen = np.random.default_rng(SEED), jacobians / deviation, torque / deviation
    known = columns @ np.swapaxes(columns, 1, 2)
    precision = known[:, None] + np.eye(3) / SIZES[:, None, None] ** 2  # (P, S, 3, 3)
    covariance = np.linalg.inv(precision)
    toward = columns @ seen
    mean = np.einsum("psij,pj->psi", covariance, toward)
    logs = np.einsum("psi,pi->ps", mean, toward) - np.linalg.slogdet(precision)[1]
    logs = (0.5 * logs - 3 * np.log(SIZES)).ravel()
    weight = np.exp(logs - logs.max())
    chosen = rng.choice(len(logs), size=DRAWS, p=weight / weight.sum())
    spread = np.linalg.cholesky(covariance).reshape(-1, 3, 3)[chosen]
    about = np.einsum("kij,kj->ki", spread, rng.standard_normal((DRAWS, 3)))
    forces: Array = mean.reshape(-1, 3)[chosen] + about
    return forces
