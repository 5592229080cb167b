"""Checks that logs fit the arm: signs and unit of the currents, and the weight of the arm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.calibration.recording import Recording, moves, moving_span
from tauguard.detectors.dynamics.robot import RobotNumbers, gravity_torque, momentum_terms
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.estimation.observer import intervals, lagged, low_pass
from tauguard.findings import Finding, Findings, cause
from tauguard.traces.trace import Trace


@dataclass(frozen=True)
class SignCheck:
    """Options of :func:`sign_findings`."""

    minimum_motion: float = 3.0  #: of a joint that is checked [s]
    minimum_speed: float = 0.05  #: of a checked sample [rad/s]
    reversal_speed: float = 0.05  #: over which the sign of friction changes [rad/s]
    filter_rate: float = 20.0  #: of torques and currents [1/s]
    minimum_drag: float = -1.0
    """A current with a smaller :func:`drag` has the wrong sign. The drag is at least 0.6 in every
    log of three real arms and 2 to 8 in most of them. A wrong sign negates it."""


def sign_findings(
    arm: ArmModel, logs: Mapping[str, Recording], options: SignCheck = SignCheck()
) -> Findings:
    """One error ``"signs"`` per log in which friction would push a joint instead of braking it.

    Args:
        arm: only the robot and the signs of the gains are used.
        logs: by name, collision-free.
        options: limits.
    """
    found = []
    for name, recording in logs.items():
        if not moves(recording.trace):
            continue
        drags = drag(arm.robot, recording.trace, np.sign(arm.drive_gain), options)
        pairs = zip(arm.robot.joint_names, drags, strict=True)
        if against := [joint for joint, value in pairs if value < options.minimum_drag]:
            text = (
                f"{name}: friction would push {', '.join(against)}: the sign of the current or "
                "torque, or of the velocity, is opposite to the robot file's; for currents, a "
                "negative number in `gains=` or in current_scale of the column map turns it, for "
                "torques one in torque_scale"
            )
            found.append(cause("signs", text, name, *against))
    return Findings(found)


def drag(robot: RobotNumbers, trace: Trace, sign: Array, options: SignCheck = SignCheck()) -> Array:
    """The part of each joint's current that depends on the direction of motion, shape (n,).

    It is divided by the standard deviation of the current that neither this part nor the rigid-body
    torque explains. Friction gives a value above 0. NaN for a joint that moves too little.
    """
    n, dt = robot.joints, intervals(trace.t, len(trace.t))
    rate = options.filter_rate
    torque = low_pass(rate, dt, *momentum_terms(robot, trace.q, trace.qd))
    direction = lagged(rate, dt, np.tanh(trace.qd / options.reversal_speed))
    current = lagged(rate, dt, trace.current * sign)
    rows, drags = moving_span(trace), np.full(n, np.nan)
    for j in range(n):
        on = rows & (np.abs(trace.qd[:, j]) > options.minimum_speed)
        if on.sum() * trace.dt < options.minimum_motion:
            continue
        x = np.column_stack([torque[on, j], direction[on, j], np.ones(on.sum())])
        scale = np.maximum(np.abs(x).max(axis=0), 1e-9)
        weight = np.linalg.lstsq(x / scale, current[on, j], rcond=None)[0] / scale
        left = float((current[on, j] - x @ weight).std())
        drags[j] = weight[1] * x[:, 1].std() / max(left, 1e-9)
    return drags


def torque_per_ampere(arm: ArmModel, traces: Sequence[Trace]) -> float:
    """RMS of the drive torques divided by the RMS of the logs' current columns [N m/A].

    Both are over all joints and samples, so the joints that carry the arm dominate, and wrist
    joints, whose gains are hardly identifiable, have little influence. The ratio is 0.9 to 1.1 if
    the columns contain joint torques, and 4 to 16 if they contain currents.
    """
    current = np.concatenate([trace.current for trace in traces])
    torque = current * arm.drive_gain
    return float(np.sqrt((torque**2).mean() / max(float((current**2).mean()), 1e-12)))


@dataclass(frozen=True)
class WeightCheck:
    """Options of :func:`gravity_finding` and :func:`unit_finding`."""

    minimum_ratio: float = 0.55
    """Of the calibrated arm's gravity torque to that of the robot file's arm. The ratio is 0.9 to
    1.5 for three real arms with the correct file, and 0.2 to 0.5 or 1.9 to 6.5 with the file of
    another of these arms."""
    maximum_ratio: float = 1.8  #: of the same torques
    maximum_torque_ratio: float = 30.0
    """Of the currents' torque to that of gravity and motion, root mean squares. The ratio is 0.9 to
    3 for four real arms, with friction. Milliamperes give 1,000 times as much."""


def gravity_finding(
    file: RobotNumbers,
    identified: RobotNumbers,
    traces: Sequence[Trace],
    options: WeightCheck = WeightCheck(),
) -> Finding | None:
    """An error ``"gravity"`` if the robot file's gravity torques differ from those of the logs.

    Args:
        file: the numbers of the robot file.
        identified: the identified numbers, from torques of known scale.
        traces: their positions are used.
        options: limits.
    """
    poses = np.concatenate([trace.q[:: max(1, len(trace.q) // 100)] for trace in traces])
    needed, shown = gravity_torque(file, poses), gravity_torque(identified, poses)
    need, has = (float(np.sqrt((torque**2).mean())) for torque in (needed, shown))
    if has >= 1e-6 and (needed * shown).sum() < 0:
        text = (
            "the logs show torques that pull with gravity instead of holding the arm: check the "
            "signs of the currents or torques, and of the gains"
        )
        return cause("gravity", text, accept="gravity")
    if has < 1e-6 or options.minimum_ratio < has / max(need, 1e-9) < options.maximum_ratio:
        return None
    text = (
        f"the logs show {has:.3g} N m against gravity (root mean square), the robot file's arm "
        f"needs {need:.3g} N m: the file of another arm, gains that are wrong, the order of the "
        "joints, or torques given as currents (`torque=True`)"
    )
    return cause("gravity", text, accept="gravity")


def unit_finding(
    arm: ArmModel, traces: Sequence[Trace], options: WeightCheck = WeightCheck()
) -> Finding | None:
    """An error ``"current-unit"`` if the currents mean torques far beyond those of any motion.

    Args:
        arm: of the robot file, with drive gains that do not come from these logs.
        traces: logs in which a joint moves.
        options: limits.
    """
    squares, count = np.zeros(2), 0
    for trace in traces:
        dt, rate = intervals(trace.t, len(trace.t)), SignCheck.filter_rate
        needed = low_pass(rate, dt, *momentum_terms(arm.robot, trace.q, trace.qd))
        squares += [((trace.current * arm.drive_gain) ** 2).sum(), (needed**2).sum()]
        count += len(trace.t)
    drives, needs = np.sqrt(squares / max(count, 1))
    if needs < 1e-6 or drives < options.maximum_torque_ratio * needs:
        return None
    text = (
        f"the currents times the gains are {drives:.3g} N m, gravity and motion need {needs:.3g} "
        'N m (root mean square over all joints): if they are milliamperes, add `mend="mA"`; else '
        "check the gains"
    )
    return cause("current-unit", text)
