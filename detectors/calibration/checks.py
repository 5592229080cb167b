"""Whether logs can be those of the arm: the sign of each current, and the arm's own weight."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tauguard.arrays import Array, Bools
from tauguard.detectors.calibration.recording import moves, moving_span
from tauguard.detectors.dynamics.robot import RobotNumbers, gravity_torque, momentum_terms
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.estimation.observer import intervals, low_pass
from tauguard.traces.trace import Trace

#: A joint is judged where it is faster than this [rad/s], and changes direction over that.
FAST, REVERSAL = 0.05, 0.05

#: Drag below this many deviations of what is left: of another sign. Three real arms have 0.6 at
#: least in every log and 2 to 8 as a rule; a current of the other sign has the negative of that.
AGAINST = -1.0

#: Seconds of motion of a joint that say something.
ENOUGH = 3.0

#: Gravity torque of the calibrated arm over the robot file's. The right files of three real arms
#: give 0.9 to 1.5, files of the other two 0.2 to 0.5 and 1.9 to 6.5.
LIGHTEST, HEAVIEST = 0.55, 1.8


def check_signs(arm: ArmModel, name: str, trace: Trace) -> None:
    """Refuse a log in which a joint's torque drives its friction instead of being braked by it.

    Args:
        arm: its gains' signs count.
        name: of the log.
        trace: collision-free.

    Raises:
        ValueError: names log and joints.
    """
    if not moves(trace):
        return
    against = [
        arm.robot.joint_names[j]
        for j, value in enumerate(drag(arm.robot, trace, np.sign(arm.drive_gain)))
        if value < AGAINST
    ]
    if against:
        raise ValueError(
            f"{name}: friction would push {', '.join(against)}: the sign of the current or torque, "
            "or of the velocity, is the other one than the robot file's"
        )


def drag(robot: RobotNumbers, trace: Trace, sign: Array, rate: float = 20.0) -> Array:
    """What of each joint's current follows the direction of motion, shape (n,).

    In deviations of what neither that nor the rigid-body torque explains; above 0 for friction;
    NaN for a joint that moves for less than :data:`ENOUGH`.
    """
    n, dt = robot.joints, intervals(trace.t, len(trace.t))
    rates, nothing = np.full(n, rate), np.zeros_like(trace.q)
    torque = low_pass(rates, dt, *momentum_terms(robot, trace.q, trace.qd))
    direction = -low_pass(rates, dt, nothing, nothing, np.tanh(trace.qd / REVERSAL))
    current = -low_pass(rates, dt, nothing, nothing, np.ascontiguousarray(trace.current * sign))
    rows, found = moving_span(trace), np.full(n, np.nan)
    for j in range(n):
        on = rows & (np.abs(trace.qd[:, j]) > FAST)
        if on.sum() * trace.dt < ENOUGH:
            continue
        x = np.column_stack([torque[on, j], direction[on, j], np.ones(on.sum())])
        scale = np.maximum(np.abs(x).max(axis=0), 1e-9)
        weight = np.linalg.lstsq(x / scale, current[on, j], rcond=None)[0] / scale
        left = float((current[on, j] - x @ weight).std())
        found[j] = weight[1] * x[:, 1].std() / max(left, 1e-9)
    return found


def torque_per_ampere(arm: ArmModel, traces: Sequence[Trace]) -> float:
    """What the drives give over what the columns hold, root mean square [N m/A].

    Over all joints and samples, so the joints that carry the arm count, not a wrist joint whose
    gain nothing fixes. 0.9 to 1.1 for joint torques given as currents, 4 to 16 for currents.
    """
    current = np.concatenate([trace.current for trace in traces])
    torque = current * arm.drive_gain
    return float(np.sqrt((torque**2).mean() / max(float((current**2).mean()), 1e-12)))


def check_weight(file: RobotNumbers, found: RobotNumbers, traces: Sequence[Trace]) -> None:
    """Refuse a robot file whose arm needs other torques against gravity than the logs show.

    Args:
        file: the numbers of the robot file.
        found: those that were identified, with the scale of the torques given.
        traces: for poses.

    Raises:
        ValueError: an arm of another weight.
    """
    poses = np.concatenate([trace.q[:: max(1, len(trace.q) // 100)] for trace in traces])
    need, has = (float(np.sqrt((gravity_torque(r, poses) ** 2).mean())) for r in (file, found))
    if has < 1e-6 or LIGHTEST < has / max(need, 1e-9) < HEAVIEST:
        return
    raise ValueError(
        f"the logs show {has:.3g} N m against gravity (root mean square), the robot file's arm "
        f"needs {need:.3g} N m: the file of another arm, gains that are wrong, or torques given as "
        "currents (--torque)"
    )


#: Fraction of the torque left over that is refused, and from which on it is said. A UR10e with
#: published gains and friction leaves 0.1 to 0.2, with gains alone up to 0.53, with two joints
#: exchanged 0.5 to 1.4, with another sign 1 to 1.9, in milliamperes 1.
REFUSED, DOUBTED = 0.7, 0.4

#: Torques are weighed against this fraction of what gravity can ask of the arm at least: in a pose
#: where it asks for nothing, friction is all there is.
STRENGTH = 0.4


def drive_torque(arm: ArmModel, trace: Trace) -> Array:
    """What the drives give to the joints, less the arm's friction [N m], shape (T, n)."""
    tau: Array = trace.current * arm.drive_gain
    if arm.friction is None:
        return tau
    asked = momentum_terms(arm.robot, trace.q, trace.qd)[1] if arm.friction.modelled else None
    return np.asarray(tau - arm.friction.torque(trace.q, trace.qd, tau, asked))


def check_torques(
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
    fraction = sizes[0] / max(*sizes[1:], most)
    where = "contacts included" if touched else "where nothing touches the arm"
    said = (
        f"{where}, {100 * fraction:.0f} % of the torque is not explained (the motion "
        f"needs {sizes[1]:.3g} N m, the drives give {sizes[2]:.3g} N m, root mean square over all "
        "joints)"
    )
    if fraction > REFUSED:
        raise ValueError(
            f"{said}: check the unit of the currents (milliamperes?), their signs, the order of "
            "the joints, the gains and the robot file"
        )
    return (
        (f"{said}: alarms mean little; a load, other gains, another order of the joints?",)
        if fraction > DOUBTED
        else ()
    )
