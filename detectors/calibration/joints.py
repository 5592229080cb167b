"""The joints of a log, and those of a robot file: names, order, and joints that the log lacks."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from tauguard.detectors.dynamics.robot import RobotNumbers, holding
from tauguard.findings import ArgumentError, Findings, LogError, MismatchError, cause, note
from tauguard.models import pin_model
from tauguard.traces.logs import Log
from tauguard.traces.trace import Trace


def robot_numbers(robot: Path) -> RobotNumbers:
    """The numbers of a robot file (URDF or MJCF).

    Raises:
        ArgumentError: the file cannot be read; the message names it.
    """
    try:
        return RobotNumbers.from_pin(pin_model(robot))
    except ValueError as error:
        name = "" if str(robot) in str(error) else f"{robot}: "
        raise ArgumentError(cause("robot-file", f"{name}{error}")) from None


def unnamed(count: int) -> tuple[str, ...]:
    """Names for joints that have none: ``joint_1``, ..."""
    return tuple(f"joint_{i}" for i in range(1, count + 1))


def of_log(
    numbers: RobotNumbers, joints: tuple[str, ...], robot: Path
) -> tuple[RobotNumbers, Findings]:
    """The numbers for the joints of a log, and a note on joints that it lacks (held at 0).

    Args:
        numbers: those of the file ``robot``.
        joints: joints of the log, in any order, or ``joint_1``, ...
        robot: the robot file, which the note names.

    Raises:
        MismatchError: joints that the robot does not have.
    """
    names = numbers.joint_names
    if len(joints) >= len(names):
        return numbers, Findings()
    kept = names[: len(joints)] if joints == unnamed(len(joints)) else joints
    if not set(kept) <= set(names):
        raise MismatchError(_other_joints(joints, names))
    lacking = [name for name in names if name not in kept]
    text = f"the log lacks {', '.join(lacking)} of {robot.name}: held fixed at 0"
    return holding(numbers, lacking), Findings([note("held-joint", text, *lacking)])


def matched(trace: Trace, names: tuple[str, ...]) -> Trace:
    """The trace with its joints in the robot's order.

    Raises:
        MismatchError: joints that do not match.
    """
    joints = trace.joint_names
    if len(joints) != len(names):
        text = (
            f"the log has {len(joints)} joints ({', '.join(joints)}), "
            f"the robot {len(names)} ({', '.join(names)})"
        )
        raise MismatchError(cause("joints", text, *joints))
    if joints == unnamed(len(joints)) or joints == names:
        return dataclasses.replace(trace, joint_names=names)
    if set(joints) != set(names):
        raise MismatchError(_other_joints(joints, names))
    order = [joints.index(name) for name in names]
    moved: dict[str, Any] = {name: values[:, order] for name, values in trace.signals.items()}
    return dataclasses.replace(trace, joint_names=names, **moved)


def _other_joints(joints: Iterable[str], names: Iterable[str]) -> Any:
    text = f"the log's joints are {', '.join(joints)}, the robot's {', '.join(names)}"
    return cause("joints", text, *joints)


def linear_axes(numbers: RobotNumbers, logs: Mapping[str, Log]) -> Findings:
    """A note on the units of linear axes; none for an arm without them.

    Args:
        numbers: the robot's numbers for the joints of the logs.
        logs: by name, with the column maps that read them.

    Raises:
        LogError: the columns of these axes are read in degrees.
    """
    pairs = zip(numbers.joint_names, numbers.prismatic, strict=True)
    axes = [name for name, is_linear in pairs if is_linear]
    if not axes:
        return Findings()
    linear = ", ".join(axes)
    in_degrees = [
        cause(
            "linear-axis",
            f"{name}: {linear} is a linear axis, but is read in degrees as the others: "
            'give a column map in which "degrees" is a list, false for this axis [m]',
            name,
            *axes,
        )
        for name, log in logs.items()
        if log.columns is not None and log.columns.degrees is True
    ]
    if in_degrees:
        raise LogError(*in_degrees)
    text = f"{linear}: linear, so its numbers are in m, m/s and N, not in rad, rad/s and N m"
    return Findings([note("linear-axis", text, *axes)])


def is_torque(trace: Trace) -> bool:
    """Whether a log holds joint torques instead of currents."""
    return trace.meta.get("effort") == "torque"
