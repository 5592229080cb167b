"""How much of a log's torque the arm model explains, for a log in which contacts are sought."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tauguard.arrays import Array, Bools
from tauguard.detectors.dynamics.robot import RobotNumbers, gravity_torque, momentum_terms
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.estimation.observer import LOG_GAIN, intervals, lagged, low_pass
from tauguard.findings import Finding, cause, note
from tauguard.traces.trace import Trace


@dataclass(frozen=True)
class TorqueCheck:
    """Options of :func:`torque_finding`.

    For a UR10e the unexplained fraction of the torque is 0.1 to 0.2 with published gains and
    friction, at most 0.53 with gains alone, 0.5 to 1.4 with two joints exchanged, 1 to 1.9 with a
    wrong sign, and 1 in milliamperes.
    """

    doubtful_fraction: float = 0.4  #: unexplained, above which there is a note
    maximum_fraction: float = 0.7  #: unexplained, above which the log is refused
    minimum_torque: float = 0.4
    """Least denominator of the fraction, relative to the arm's largest gravity torque, because in a
    pose without gravity torque the drives give only friction."""


def drive_torque(arm: ArmModel, trace: Trace) -> Array:
    """Torque of the drives at the joints minus friction [N m], shape (T, n)."""
    tau: Array = trace.current * arm.drive_gain
    if arm.friction is None:
        return tau
    asked = momentum_terms(arm.robot, trace.q, trace.qd)[1] if arm.friction.modelled else None
    return np.asarray(tau - arm.friction.torque(trace.q, trace.qd, tau, asked))


def torque_finding(
    robot: RobotNumbers,
    trace: Trace,
    tau: Array,
    residual: Array,
    rows: Bools,
    touched: bool = False,
    options: TorqueCheck = TorqueCheck(),
) -> Finding | None:
    """A note or an error ``"unexplained"`` on torques that the motion does not explain well.

    Args:
        robot: the arm.
        trace: a log.
        tau: torques at the joints minus friction [N m], shape (T, n).
        residual: residual of an observer with :data:`LOG_GAIN` [N m], shape (T, n).
        rows: rows in which nothing touches the arm, shape (T,).
        touched: True if there can be contacts in these rows.
        options: limits.
    """
    if not rows.any():
        return None
    n, dt = robot.joints, intervals(trace.t, len(trace.t))
    needed = low_pass(LOG_GAIN, dt, *momentum_terms(robot, trace.q, trace.qd))
    drives = lagged(LOG_GAIN, dt, tau)
    poses = np.random.default_rng(0).uniform(-np.pi, np.pi, (200, n))
    gravity = float(np.linalg.norm(np.abs(gravity_torque(robot, poses)).max(axis=0)))
    if options.minimum_torque * gravity < 1e-6:
        return None  # no gravity torque: the torque may be friction alone
    left, need, gives = (
        float(np.sqrt((x[rows] ** 2).sum(axis=1).mean())) for x in (residual, needed, drives)
    )
    fraction = left / max(need, gives, options.minimum_torque * gravity)
    if not fraction > options.doubtful_fraction:
        return None
    where = "contacts included" if touched else "where nothing touches the arm"
    share = (
        f"{where}, {100 * fraction:.0f} % of the torque is not explained (the motion "
        f"needs {need:.3g} N m, the drives give {gives:.3g} N m, root mean square over all joints)"
    )
    if fraction > options.maximum_fraction:
        return cause(
            "unexplained",
            f"{share}: check the unit of the currents (milliamperes?), their signs, the order of "
            "the joints, the gains and the robot file",
        )
    return note(
        "unexplained",
        f"{share}: alarms mean little; a load, other gains, another order of the joints?",
    )
