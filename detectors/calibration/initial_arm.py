"""The arm model before an identification: the robot file's numbers, and drive gains."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tauguard.detectors.calibration.arm_file import load_arm
from tauguard.detectors.calibration.assessment import start_gains
from tauguard.detectors.calibration.joints import is_torque
from tauguard.detectors.calibration.robot_names import robot_name_finding
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.findings import ArgumentError, MismatchError, RefusedError, cause
from tauguard.traces.logs import Recording
from tauguard.traces.trace import Trace

#: Joint torque per motor current [N m/A], one number per joint, by the name of the column preset.
DRIVES = {
    # Mamedov et al. 2020 (doi 10.3389/frobt.2020.571574), identified on one arm. Another source
    # gives gains up to 50 % higher: identify your own arm's gains if you can.
    "ur10e": (10.0, 10.70, 8.46, 9.00, 9.48, 10.12),
    # Ratio of the target torques to the target currents of a UR5's controller, by least squares
    # over its logs. The last joint's gain is not identifiable; the last two joints have the same
    # drive.
    "ur5": (12.0, 10.6, 11.1, 9.9, 10.3, 10.3),
}


def preset_gains(logs: Sequence[Trace]) -> tuple[float, ...]:
    """Drive gains of the preset of the logs' columns; empty: not known.

    Raises:
        MismatchError: the logs have columns of different presets, and the drive of one is known.
    """
    names = sorted({log.meta.get("columns", "no preset") for log in logs})
    if len(names) > 1 and not DRIVES.keys().isdisjoint(names):
        text = (
            f"logs of {', '.join(names)}, whose drive gains differ: give logs of one preset, "
            "or `gains=`"
        )
        raise MismatchError(cause("gains", text))
    return DRIVES.get(names[0], ()) if names else ()


def initial_arm(
    numbers: RobotNumbers,
    recordings: Sequence[Recording],
    gains: Sequence[float],
    scale: str,
) -> tuple[ArmModel, str]:
    """The initial arm of a calibration, and what fixes the scale of its torques.

    Args:
        numbers: the robot file's geometry and inertia.
        recordings: logs with their loads.
        gains: the given drive gains [N m/A], one per joint; empty: none.
        scale: "gains", "payload", "masses", or "auto": given gains, else a known payload, else the
            preset's gains, else masses.

    Returns:
        The arm, and "torques", "gains", "preset", "payload" or "masses".

    Raises:
        ArgumentError: not one gain per joint.
        MismatchError: logs of different presets.
        RefusedError: gains cannot be estimated, see
            :func:`~tauguard.detectors.calibration.assessment.start_gains`.
    """
    gains = tuple(gains)
    if is_torque(recordings[0].trace):
        if gains:
            raise ArgumentError(
                "`gains=`: the logs hold joint torques, by the names of their columns, and torques "
                "need no gains; if they are motor currents, give `columns=` a JSON file whose "
                "`current` lists these columns"
            )
        return ArmModel(numbers, np.ones(numbers.joints)), "torques"
    traces = [r.trace for r in recordings]
    preset = () if gains else preset_gains(traces)
    known = any(r.load is not None and r.load.mass > 0 for r in recordings)
    if scale == "auto":
        otherwise = "payload" if known else "masses"
        scale = "gains" if gains or (preset and not known) else otherwise
    if preset:
        gains = preset
        scale = "preset" if scale == "gains" else scale
    _check_count(gains, numbers)
    if not gains and scale == "gains":
        raise ArgumentError(f"`gains=`: give {numbers.joints} numbers, N m of torque per ampere")
    begin = np.array(gains) if gains else start_gains(numbers, traces)
    return ArmModel(numbers, begin), scale


def known_arm(
    robot: Path,
    numbers: RobotNumbers,
    recordings: Sequence[Recording],
    gains: Sequence[float],
) -> tuple[ArmModel, str]:
    """The initial arm for the method free-motion, and the source of its gains as text.

    The gains are the given ones, else those of a calibrated robot file, else those of
    :func:`initial_arm`.

    Raises:
        ArgumentError: as for :func:`initial_arm`.
        MismatchError: torque logs with an arm calibrated on currents, or logs of different presets.
        RefusedError: the preset of another arm.
    """
    gains = tuple(gains)
    arm = None if gains else load_arm(robot)
    if arm is not None:
        if is_torque(recordings[0].trace) and not (arm.drive_gain == 1).all():
            text = f"{robot.name} was calibrated on currents, the logs hold torques"
            raise MismatchError(cause("torques", text))
        return arm, f"those of the calibration in {robot.name}"
    if not gains and (other := robot_name_finding(robot, [r.trace for r in recordings])):
        raise RefusedError(other)
    arm, scale = initial_arm(numbers, recordings, gains, "gains")
    words = {"gains": "those given", "torques": "none, the log holds torques"}
    preset = recordings[0].trace.meta.get("columns")
    return arm, words.get(scale, f"those of the preset {preset}")


def _check_count(gains: Sequence[float], numbers: RobotNumbers) -> None:
    if gains and len(gains) != numbers.joints:
        raise ArgumentError(f"`gains=`: {len(gains)} numbers for {numbers.joints} joints")
    if gains and not (np.isfinite(gains).all() and np.all(gains)):
        raise ArgumentError(f"`gains=` {gains}: every number must be finite and not 0")
