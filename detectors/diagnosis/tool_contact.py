"""The force of a contact whose place is known: the tool, as in most handling and pushing.

If the place is known, the torques of six joints determine the three components of the force. These
torques are uncertain, because static friction at a joint at rest hides a part of the push. The
prior of the force is a mixture of Gaussians of several sizes, weighted by their likelihood.
"""

from __future__ import annotations

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.diagnosis.contact_force import link_poses, point_jacobians
from tauguard.detectors.diagnosis.post_alarm import PostAlarmWindow
from tauguard.detectors.diagnosis.severity import (
    DRAWS,
    SEED,
    ContactTorque,
    Interval90,
    Severity,
)
from tauguard.detectors.estimation.estimator import ArmModel

#: Sizes of the force that the prior weighs equally [N].
SIZES = np.geomspace(5.0, 400.0, 9)
#: Standard deviations: of any joint's torque [N m]; of a torque, relative; of the torque that
#: static friction hides, relative to that friction; of gains and levers (log).
LEAST, OWN, HIDDEN, SCALE = 0.15, 0.05, 0.5, 0.15
#: Speed below which a joint counts as at rest [rad/s].
AT_REST = 0.02


def tool_severity(arm: ArmModel, after: PostAlarmWindow) -> tuple[Severity, Array]:
    """Impulse and peak of a contact at the origin of the last link, and its mean force.

    Args:
        arm: with friction, if joints are geared.
        after: the residual around the alarm.

    Returns:
        The severity, and the force on the arm at its peak, world frame [N], shape (3,).
    """
    torque = ContactTorque.of(after)
    q, row, n = after.q[torque.row], torque.row, arm.robot.joints
    poses = link_poses(arm.robot, q)
    jacobian = point_jacobians(arm.robot, poses, np.array([n - 1]), poses.origin[-1:])[0]
    rest = np.abs(after.qd[row]) < AT_REST
    friction = np.zeros(n) if arm.friction is None else arm.friction.coulomb()
    deviation = np.sqrt(
        LEAST**2 + (OWN * np.abs(torque.peak)) ** 2 + (HIDDEN * friction * rest) ** 2
    )
    force = _draws(jacobian, torque.peak, deviation)
    rng = np.random.default_rng((SEED, 2))
    peak = np.linalg.norm(force, axis=1) * np.exp(SCALE * rng.standard_normal(len(force)))
    mean = peak / torque.shape * torque.seconds
    return Severity(Interval90.of(mean), Interval90.of(peak), torque), force.mean(axis=0)


def _draws(jacobian: Array, torque: Array, deviation: Array) -> Array:
    """Forces [N] that joint torques [N m] may come from, shape (DRAWS, 3).

    Args:
        jacobian: of the place, shape (3, n).
        torque: shape (n,).
        deviation: deviation of the torques [N m], shape (n,).
    """
    rng, columns, seen = np.random.default_rng(SEED), (jacobian / deviation).T, torque / deviation
    known, logs, drawn = columns.T @ columns, [], []
    for size in SIZES:
        covariance = size**2 * columns @ columns.T + np.eye(len(seen))
        logs.append(-0.5 * (seen @ np.linalg.solve(covariance, seen)))
        logs[-1] -= 0.5 * np.linalg.slogdet(covariance)[1]
        spread = np.linalg.inv(known + np.eye(3) / size**2)
        drawn.append(rng.multivariate_normal(spread @ columns.T @ seen, spread, DRAWS))
    weight = np.exp(np.array(logs) - max(logs))
    chosen = rng.choice(len(SIZES), size=DRAWS, p=weight / weight.sum())
    forces: Array = np.array(drawn)[chosen, np.arange(DRAWS)]
    return forces
