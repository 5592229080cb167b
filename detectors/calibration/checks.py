"""Checks that logs fit the arm: signs and order of the currents, and the weight of the arm."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from tauguard.arrays import Array, Bools
from tauguard.detectors.calibration.recording import Recording, cut, moves, moving_span
from tauguard.detectors.dynamics.robot import RobotNumbers, gravity_torque, momentum_terms
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.estimation.observer import LOG_GAIN, intervals, lagged, low_pass
from tauguard.findings import RefusedError
from tauguard.traces.trace import Trace

FAST = 0.05  # least speed of a checked joint [rad/s]
REVERSAL = 0.05  # speed over which the sign of friction changes [rad/s]

#: A joint's current has the wrong sign if :func:`drag` is below this. Its result is at least 0.6 in
#: every log of three real arms and 2 to 8 in most of them. A wrong sign negates the result.
AGAINST = -1.0

#: Rate of the filter of torques and currents [1/s].
DRAG_RATE = 20.0

#: Least motion of a joint that is checked [s].
ENOUGH = 3.0

#: Limits of the ratio of the calibrated arm's gravity torque to that of the robot file's arm. It is
#: 0.9 to 1.5 for three real arms with the correct file, and 0.2 to 0.5 or 1.9 to 6.5 with the file
#: of another of these arms.
LIGHTEST, HEAVIEST = 0.55, 1.8


def check_signs(arm: ArmModel, logs: Mapping[str, Recording]) -> None:
    """Refuse a log in which friction would push a joint instead of braking it.

    Args:
        arm: only the robot and the signs of the gains are used.
        logs: by name, collision-free.

    Raises:
        RefusedError: names log and joints.
    """
    for name, recording in logs.items():
        if not moves(recording.trace):
            continue
        drags = drag(arm.robot, recording.trace, np.sign(arm.drive_gain))
        pairs = zip(arm.robot.joint_names, drags, strict=True)
        if against := [joint for joint, value in pairs if value < AGAINST]:
            raise RefusedError(
                f"{name}: friction would push {', '.join(against)}: the sign of the current or "
                "torque, or of the velocity, is opposite to the robot file's; for currents, a "
                "negative number in --gains or in current_scale of the column map turns it, for "
                "torques one in torque_scale"
            )


def drag(robot: RobotNumbers, trace: Trace, sign: Array) -> Array:
    """The part of each joint's current that depends on the direction of motion, shape (n,).

    It is divided by the standard deviation of the current that neither this part nor the rigid-body
    torque explains. Friction gives a value above 0. NaN for a joint that moves for less than
    :data:`ENOUGH`.
    """
    n, dt = robot.joints, intervals(trace.t, len(trace.t))
    torque = low_pass(DRAG_RATE, dt, *momentum_terms(robot, trace.q, trace.qd))
    direction = lagged(DRAG_RATE, dt, np.tanh(trace.qd / REVERSAL))
    current = lagged(DRAG_RATE, dt, trace.current * sign)
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


#: Least motion of both joints [s], and limit. Two joints are reported as exchanged if exchanging
#: their currents, or all their columns, lowers the logarithm of the unexplained variance by more
#: than the limit. In correct logs of 13 arms, this lowers it by at most 0.05 (currents) and 0.83
#: (columns). With exchanged currents it is mostly 2.9 or more. With exchanged columns of wrist
#: joints it is less than the limit, so they are not found.
EXCHANGED = {"currents": (6.0, 1.0), "columns": (20.0, 1.25)}
#: Least motion [s] for exchanged columns if the arm is calibrated. The logarithm is then lowered by
#: at most 0.11 in correct logs, and by 2.4 or more in nearly all logs with exchanged columns.
EXCHANGED_KNOWN = 6.0
#: As EXCHANGED, for one joint whose columns are negated. In correct logs, negating lowers the
#: logarithm by 0.3 (currents) and 0.94 (columns) at most. Negated currents give 0.7 to 8, negated
#: columns of joints that carry the arm mostly 3 or more.
NEGATED = {"currents": (6.0, 1.0), "columns": (6.0, 2.0)}

#: Sample interval in the check of the order [s].
THINNED = 0.02


def check_order(arm: ArmModel, logs: Mapping[str, Recording]) -> None:
    """Refuse logs in which the columns of two joints are exchanged, or one joint's are negated.

    Raises:
        RefusedError: names the joints, see :func:`misread`.
    """
    if found := misread(arm, logs):
        raise RefusedError(found)


def misread(arm: ArmModel, logs: Mapping[str, Recording]) -> str:
    """Which joints' columns seem exchanged or negated; empty: none.

    Each joint's current is fitted by an offset and, with weights of at least 0, by the joint's
    rigid-body torque, the direction of motion and the speed. Then the currents, or all columns, of
    two joints are exchanged, or those of one joint negated, and the unexplained variances compared.
    Only joints that move for long enough (:data:`EXCHANGED`, :data:`NEGATED`) are checked.

    Args:
        arm: arm of the robot file, or calibrated; of the gains, only the signs are used.
        logs: by name, mostly free of collisions.
    """
    traces = [one.trace for one in logs.values() if moves(one.trace)]
    least, a, b, what = min(_misreadings(arm, traces), default=(0.0, 0, 0, ""))
    if least > -1:
        return ""
    names = arm.robot.joint_names
    if a == b:
        return (
            f"the {what} of {names[a]} seem to have the opposite sign: if negated, they fit the "
            "arm of the robot file better; use the signs of the robot file's axes"
        )
    return (
        f"the {what} of {names[a]} and {names[b]} seem exchanged: if swapped, they fit the arm of "
        "the robot file better; give the columns in the order of the robot file's joints"
    )


def _misreadings(arm: ArmModel, traces: Sequence[Trace]) -> Iterator[tuple[float, int, int, str]]:
    """Change of the logarithm of the unexplained variance over the limit, joints, kind of column.

    The columns of two different joints are exchanged; for equal joints they are negated.
    """
    if not traces:
        return
    n, sign = arm.robot.joints, np.sign(arm.drive_gain)
    steps = [slice(None, None, max(1, round(THINNED / trace.dt))) for trace in traces]
    span = np.concatenate([moving_span(trace)[s] for trace, s in zip(traces, steps, strict=True)])
    traces = [cut(trace, s) for trace, s in zip(traces, steps, strict=True)]
    every = [intervals(trace.t, len(trace.t)) for trace in traces]

    def late(quantity: Callable[[Trace], Array]) -> Array:
        pairs = zip(traces, every, strict=True)
        return np.concatenate([lagged(LOG_GAIN, dt, quantity(trace)) for trace, dt in pairs])

    direction = late(lambda trace: np.tanh(trace.qd / REVERSAL))
    speed, current = late(lambda trace: trace.qd), late(lambda trace: trace.current)
    fast = span[:, None] & (np.abs(np.concatenate([trace.qd for trace in traces])) > FAST)

    def torque(order: Sequence[int], signs: Array) -> Array:
        found = []
        for trace, dt in zip(traces, every, strict=True):
            q, qd = (np.ascontiguousarray(x[:, order] * signs) for x in (trace.q, trace.qd))
            found.append(low_pass(LOG_GAIN, dt, *momentum_terms(arm.robot, q, qd)))
        return np.concatenate(found) * signs

    def left(torques: Array, joint: int, motion: int, column: int, given: float = 1.0) -> float:
        on = fast[:, motion]
        x = (torques[on, joint], direction[on, motion], speed[on, motion])
        return _unexplained(np.column_stack(x), current[on, column] * sign[joint] * given)

    each = np.repeat([trace.dt for trace in traces], [len(trace.t) for trace in traces])
    same, seconds = range(n), each @ fast
    as_given = torque(same, np.ones(n))
    own = [left(as_given, j, j, j) for j in same]
    for a, b in itertools.combinations_with_replacement(same, 2):
        least, limits = float(min(seconds[a], seconds[b])), NEGATED if a == b else EXCHANGED
        if not (least >= limits["currents"][0] and math.isfinite(own[a] + own[b])):
            continue
        change = (
            left(as_given, a, a, a, -1.0) - own[a]
            if a == b
            else left(as_given, a, a, b) + left(as_given, b, b, a) - own[a] - own[b]
        )
        yield change / limits["currents"][1], a, b, "currents"
        if least < (EXCHANGED_KNOWN if arm.friction is not None else limits["columns"][0]):
            continue
        order = [b if j == a else a if j == b else j for j in same]
        other = torque(order, np.where((a == b) & (np.arange(n) == a), -1.0, 1.0))
        changes = [left(other, j, order[j], order[j]) - own[order[j]] for j in same]
        yield float(np.nansum(changes)) / limits["columns"][1], a, b, "columns"


def _unexplained(x: Array, current: Array) -> float:
    """Logarithm of the fraction of a current's variance that x and an offset do not explain.

    The weights of the columns of x are at least 0. NaN if the joint moves too little.
    """
    from scipy.optimize import nnls

    if len(x) * THINNED < ENOUGH:
        return math.nan
    one = np.ones((len(x), 1))
    columns = np.hstack([x, one, -one])
    columns /= np.maximum(np.linalg.norm(columns, axis=0), 1e-6)
    left = nnls(columns, current)[1] ** 2 / len(x)
    return math.log(max(left, 1e-12) / max(float(current.var()), 1e-12))


def torque_per_ampere(arm: ArmModel, traces: Sequence[Trace]) -> float:
    """RMS of the drive torques divided by the RMS of the logs' current columns [N m/A].

    Both are over all joints and samples, so the joints that carry the arm dominate, and wrist
    joints, whose gains are hardly identifiable, have little influence. The ratio is 0.9 to 1.1 if
    the columns contain joint torques, and 4 to 16 if they contain currents.
    """
    current = np.concatenate([trace.current for trace in traces])
    torque = current * arm.drive_gain
    return float(np.sqrt((torque**2).mean() / max(float((current**2).mean()), 1e-12)))


def check_weight(file: RobotNumbers, found: RobotNumbers, traces: Sequence[Trace]) -> None:
    """Refuse a robot file whose gravity torques differ from those of the logs.

    Args:
        file: the numbers of the robot file.
        found: the identified numbers, from torques of known scale.
        traces: their positions are used.

    Raises:
        RefusedError: the ratio of the gravity torques is outside its limits.
    """
    poses = np.concatenate([trace.q[:: max(1, len(trace.q) // 100)] for trace in traces])
    needed, shown = gravity_torque(file, poses), gravity_torque(found, poses)
    need, has = (float(np.sqrt((torque**2).mean())) for torque in (needed, shown))
    if has >= 1e-6 and (needed * shown).sum() < 0:
        raise RefusedError(
            "the logs show torques that pull with gravity instead of holding the arm: check the "
            "signs of the currents or torques, and of the gains"
        )
    if has < 1e-6 or LIGHTEST < has / max(need, 1e-9) < HEAVIEST:
        return
    raise RefusedError(
        f"the logs show {has:.3g} N m against gravity (root mean square), the robot file's arm "
        f"needs {need:.3g} N m: the file of another arm, gains that are wrong, the order of the "
        "joints, or torques given as currents (--torque)"
    )


#: A log is refused if the unexplained fraction of the torque is above REFUSED, and gets a note if
#: it is above DOUBTED. For a UR10e the fraction is 0.1 to 0.2 with published gains and friction,
#: at most 0.53 with gains alone, 0.5 to 1.4 with two joints exchanged, 1 to 1.9 with a wrong sign,
#: and 1 in milliamperes.
REFUSED, DOUBTED = 0.7, 0.4

#: Least denominator of this fraction, relative to the arm's largest gravity torque, because in a
#: pose without gravity torque the drives give only friction.
STRENGTH = 0.4


def drive_torque(arm: ArmModel, trace: Trace) -> Array:
    """Torque of the drives at the joints minus friction [N m], shape (T, n)."""
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
    touched: bool = False,
) -> tuple[str, ...]:
    """Notes on torques that the motion does not explain well.

    Args:
        robot: the arm.
        trace: a log.
        tau: torques at the joints minus friction [N m], shape (T, n).
        residual: residual of an observer with :data:`LOG_GAIN` [N m], shape (T, n).
        rows: rows in which nothing touches the arm, shape (T,).
        touched: True if there can be contacts in these rows.

    Raises:
        RefusedError: an unexplained fraction above ``REFUSED``.
    """
    if not rows.any():
        return ()
    n, dt = robot.joints, intervals(trace.t, len(trace.t))
    needed = low_pass(LOG_GAIN, dt, *momentum_terms(robot, trace.q, trace.qd))
    given = lagged(LOG_GAIN, dt, tau)
    poses = np.random.default_rng(0).uniform(-np.pi, np.pi, (200, n))
    most = STRENGTH * float(np.linalg.norm(np.abs(gravity_torque(robot, poses)).max(axis=0)))
    if most < 1e-6:
        return ()  # no gravity torque: the torque may be friction alone
    sizes = [float(np.sqrt((x[rows] ** 2).sum(axis=1).mean())) for x in (residual, needed, given)]
    fraction = sizes[0] / max(*sizes[1:], most)
    where = "contacts included" if touched else "where nothing touches the arm"
    said = (
        f"{where}, {100 * fraction:.0f} % of the torque is not explained (the motion "
        f"needs {sizes[1]:.3g} N m, the drives give {sizes[2]:.3g} N m, root mean square over all "
        "joints)"
    )
    if fraction > REFUSED:
        raise RefusedError(
            f"{said}: check the unit of the currents (milliamperes?), their signs, the order of "
            "the joints, the gains and the robot file"
        )
    return (
        (f"{said}: alarms mean little; a load, other gains, another order of the joints?",)
        if fraction > DOUBTED
        else ()
    )
