"""Whether a log's currents can be those of its motion: joints, signs, units and gains.

Without a collision, what the drives give less friction is what the rigid arm needs. Friction that
is not given, a load and gains that are half right leave a part of it; currents in milliamperes, of
other joints or with the other sign leave as much as there is.
"""

from __future__ import annotations

import numpy as np

from tauguard.arrays import Array, Bools
from tauguard.detectors.dynamics.robot import RobotNumbers, gravity_torque, momentum_terms
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.estimation.observer import intervals, low_pass
from tauguard.traces.trace import Trace

#: Share of the torque left over that is refused, and from which on it is said. A UR10e with
#: published gains and friction leaves 0.1 to 0.2, with gains alone up to 0.53, with two joints
#: exchanged 0.5 to 1.4, with another sign 1 to 1.9, in milliamperes 1.
REFUSED, DOUBTED = 0.7, 0.4
#: Torques are weighed against this share of what gravity can ask of the arm at least: in a pose
#: where it asks for nothing, friction is all there is.
STRENGTH = 0.4


def drive_torque(arm: ArmModel, trace: Trace) -> Array:
    """What the drives give to the joints, less the arm's friction [N m], shape (T, n)."""
    tau: Array = trace.current * arm.drive_gain
    if arm.friction is None:
        return tau
    asked = momentum_terms(arm.robot, trace.q, trace.qd)[1] if arm.friction.modelled else None
    return np.asarray(tau - arm.friction.torque(trace.q, trace.qd, tau, asked))


def plausible(
    robot: RobotNumbers,
    trace: Trace,
    tau: Array,
    residual: Array,
    rows: Bools,
    rate: float,
    touched: bool = False,
) -> tuple[str, ...]:
    """Notes on torques that the motion hardly explains.

    Args:
        robot: the arm.
        trace: a log.
        tau: torques at the joints less friction [N m], shape (T, n).
        residual: what an observer makes of them [N m], shape (T, n).
        rows: in which nothing touches the arm, shape (T,).
        rate: of that observer [1/s].
        touched: contacts may be in these rows after all.

    Raises:
        ValueError: more than ``REFUSED`` of the torque is left over.
    """
    if not rows.any():
        return ()
    n, dt = robot.joints, intervals(trace.t, len(trace.t))
    rates, nothing = np.full(n, rate), np.zeros_like(trace.q)
    needed = low_pass(rates, dt, *momentum_terms(robot, trace.q, trace.qd))
    given = -low_pass(rates, dt, nothing, nothing, np.ascontiguousarray(tau))
    poses = np.random.default_rng(0).uniform(-np.pi, np.pi, (200, n))
    most = STRENGTH * float(np.linalg.norm(np.abs(gravity_torque(robot, poses)).max(axis=0)))
    if most < 1e-6:
        return ()  # gravity asks for nothing: friction may be all there is
    sizes = [float(np.sqrt((x[rows] ** 2).sum(axis=1).mean())) for x in (residual, needed, given)]
    share = sizes[0] / max(*sizes[1:], most)
    where = "contacts included" if touched else "where nothing touches the arm"
    said = (
        f"{where}, {100 * share:.0f} % of the torque is not explained (the motion "
        f"needs {sizes[1]:.3g} N m, the drives give {sizes[2]:.3g} N m, root mean square over all "
        "joints)"
    )
    if share > REFUSED:
        raise ValueError(
            f"{said}: check the unit of the currents (milliamperes?), their signs, the order of "
            "the joints, the gains and the robot file"
        )
    return (
        (f"{said}: alarms mean little; a load, other gains, another order of the joints?",)
        if share > DOUBTED
        else ()
    )
