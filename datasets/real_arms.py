"""A real arm's numbers, from its robot file, published drive gains and the command's flags."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.datasets.drives import preset_gains
from tauguard.detectors import ArmModel, RobotNumbers
from tauguard.detectors.calibration.arm_file import load_arm
from tauguard.detectors.calibration.assessment import (
    OUTLYING,
    OUTLYING_IN_DOUBT,
    UNEXPLAINED_LADEN,
    Unexplained,
    outlier,
    start_gains,
    unexplained_notes,
)
from tauguard.detectors.calibration.joints import is_torque
from tauguard.detectors.calibration.recording import Load, Recording
from tauguard.detectors.dynamics.robot import holding
from tauguard.findings import ArgumentError
from tauguard.traces import Trace
from tauguard.untrusted_input import read_text

#: Two files describe the same arm if each joint's position [m], and each entry of its rotation
#: matrix, differ by at most this.
SAME_PLACE = 1e-3


# -- consistency of robot file, model and logs -----------------------------------------------------


def check_robot(numbers: RobotNumbers, robot: Path, trained: RobotNumbers, model: Path) -> None:
    """Refuse the numbers of a robot file if a model was trained on another arm.

    Names and placements of the joints must agree. Masses may differ: calibration changes them.

    Raises:
        ArgumentError: one line that names both files.
    """
    own, names = numbers.joint_names, trained.joint_names
    if not set(names) <= set(own):
        raise ArgumentError(
            f"{robot} has the joints {', '.join(own)}; {model} was trained on {', '.join(names)}"
        )
    held = holding(numbers, [name for name in own if name not in names])
    order = [held.joint_names.index(name) for name in names]
    moved = np.abs(held.translation[order] - trained.translation).max(axis=1)
    turned = np.abs(held.rotation[order] - trained.rotation).max(axis=(1, 2))
    if (moved > SAME_PLACE).any() or (turned > SAME_PLACE).any():
        joint = int(np.argmax(np.maximum(moved, turned)))
        raise ArgumentError(
            f"{robot} is not the arm that {model} was trained on: {names[joint]} is "
            f"{1e3 * moved[joint]:.0f} mm from its place there; give the robot file that the model "
            "was trained with"
        )


def check_named(robot: Path, traces: Sequence[Trace]) -> None:
    """Refuse a robot file of one UR model with a column preset of another UR model.

    The preset would supply the gains of the wrong arm. Files and presets of other names are
    accepted.

    Raises:
        ArgumentError: one line that names both models.
    """
    known = r"ur(?:3|5|10|16|20|30)e?"
    name = re.search(r'<(?:robot|mujoco)[^>]*?(?:name|model)="([^"]*)"', read_text(robot))
    names = f"{name.group(1) if name else ''} {robot.stem}".lower()
    arms = re.findall(rf"(?<![a-z0-9]){known}(?![a-z0-9])", names)
    presets = {trace.meta.get("columns", "") for trace in traces}
    others = sorted(p for p in presets if re.fullmatch(known, p) and arms and p not in arms)
    if others:
        raise ArgumentError(
            f"{robot.name} is the file of a {arms[0]}, the columns are those of a {others[0]}: "
            f"give the {others[0]}'s file; if the log is of a {arms[0]}, give its own --gains or a "
            "column map with its torques"
        )


# -- drive gains and friction ---------------------------------------------------------------------


def initial_arm(
    numbers: RobotNumbers,
    recordings: Sequence[Recording],
    gains: tuple[float, ...],
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
        ArgumentError: not one gain per joint, or logs of different presets.
    """
    if is_torque(recordings[0].trace):
        if gains:
            raise ArgumentError(
                "--gains: the logs hold joint torques, by the names of their columns, and torques "
                "need no gains; if they are motor currents, give --columns a JSON file whose "
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
        raise ArgumentError(f"--gains: give {numbers.joints} numbers, N m of torque per ampere")
    begin = np.array(gains) if gains else start_gains(numbers, traces)
    return ArmModel(numbers, begin), scale


def known_arm(
    robot: Path,
    numbers: RobotNumbers,
    recordings: Sequence[Recording],
    gains: tuple[float, ...],
) -> tuple[ArmModel, str]:
    """The initial arm for the method free-motion, and the source of its gains as text.

    The gains are the given ones, else those of a calibrated robot file, else those of
    :func:`initial_arm`.

    Raises:
        ArgumentError: as for :func:`initial_arm`, or torque logs with an arm calibrated on
            currents.
    """
    arm = None if gains else load_arm(robot)
    if arm is not None:
        if is_torque(recordings[0].trace) and not (arm.drive_gain == 1).all():
            raise ArgumentError(f"{robot.name} was calibrated on currents, the logs hold torques")
        return arm, f"those of the calibration in {robot.name}"
    if not gains:
        check_named(robot, [r.trace for r in recordings])
    arm, scale = initial_arm(numbers, recordings, gains, "gains")
    words = {"gains": "those given", "torques": "none, the log holds torques"}
    preset = recordings[0].trace.meta.get("columns")
    return arm, words.get(scale, f"those of the preset {preset}")


def _check_count(gains: Sequence[float], numbers: RobotNumbers) -> None:
    if gains and len(gains) != numbers.joints:
        raise ArgumentError(f"--gains: {len(gains)} numbers for {numbers.joints} joints")
    if gains and not (np.isfinite(gains).all() and np.all(gains)):
        raise ArgumentError(f"--gains {gains}: every number must be finite and not 0")


# -- notes on unexplained torque -------------------------------------------------------------------


def calibration_notes(
    joints: Sequence[str],
    left: Mapping[str, Unexplained],
    logs: Mapping[str, Recording],
    held: Sequence[Any],
) -> list[str]:
    """Notes on torque that a calibration does not explain, and on a log that may have had a load.

    Args:
        joints: names of the joints.
        left: unexplained torque of each log in which some joint moves, by file name.
        logs: recordings with their loads, by file name.
        held: held-out residual of each log in ``logs`` [N m], (n,) each; empty: not known.

    Raises:
        ArgumentError: so much torque is unexplained that arm, loads or logs do not fit together.
    """
    names, refused = list(logs), ""
    bare = [k for k, n in enumerate(names) if n in left and logs[n].load == Load()]
    laden = [one for n, one in left.items() if logs[n].load != Load()]
    notes: tuple[str, ...] = ()
    try:
        notes = unexplained_notes(joints, [left[names[k]] for k in bare])
        notes += unexplained_notes(joints, laden, limit=UNEXPLAINED_LADEN)
    except ValueError as error:
        refused = str(error)
    doubtful = bool(notes or refused)
    least = OUTLYING_IN_DOUBT if doubtful else OUTLYING
    asked = []
    found = outlier([held[k] for k in bare], least) if len(held) else None
    if found is not None:
        log = names[bare[found[0]]]
        asked.append(
            f"the torques of {log} are {found[1]:.1f} times as far from their prediction as those "
            f"of the other logs: did {log} carry something (then give --payload {log}=KG or "
            "=unknown), or did something touch the arm (then leave the log out)?"
        )
    given = [
        f"{r.load.mass:g} kg in {n}"
        for n, r in logs.items()
        if r.load is not None and r.load.mass > 0
    ]
    if given and doubtful:
        asked.append(f"loads given: {', '.join(given)}; are these right, and in kg?")
    if refused:
        raise ArgumentError("; ".join([refused, *asked]))
    return [*notes, *asked]
