"""Calibrated arms as robot files: inertial numbers in the links, all else in a comment."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.detectors.dynamics.friction import FrictionModel
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.findings import FileError
from tauguard.models import pin_model
from tauguard.models.robot_file import read_note, write_robot_file

FORMAT = "tauguard calibration 1"


def save_arm(arm: ArmModel, source: str | Path, target: str | Path, **about: object) -> None:
    """Write a calibrated robot file.

    Args:
        arm: identified, with the joints of ``source``.
        source: the robot file that it was identified from.
        target: the new file, in the same format.
        about: further entries of the comment, of types that JSON can represent.

    Raises:
        ValueError, OSError: see :func:`~tauguard.models.robot_file.write_robot_file`.
    """
    assert arm.noise is not None
    note = {
        "format": FORMAT,
        "joints": list(arm.robot.joint_names),
        "inertial": arm.robot.inertial.tolist(),
        "armature": arm.robot.armature.tolist(),
        "drive_gain": arm.drive_gain.tolist(),
        "noise": arm.noise.tolist(),
        "friction": None if arm.friction is None else _plain(asdict(arm.friction)),
        **about,
    }
    write_robot_file(source, target, arm.robot.joint_names, arm.robot.inertial, json.dumps(note))


def _plain(fields: dict[str, Any]) -> dict[str, Any]:
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in fields.items()}


def load_arm(path: str | Path) -> ArmModel | None:
    """The calibrated arm of a robot file; None for a file without a calibration.

    Raises:
        FileError: not a robot file, or a calibration of other joints or of another version.
        OSError: cannot be read.
    """
    text = read_note(path)
    if text is None:
        return None
    robot = RobotNumbers.from_pin(pin_model(path))
    try:
        note = json.loads(text)
        if note["format"] != FORMAT:
            raise FileError(f"format {note['format']!r}, expected {FORMAT!r}")
        if tuple(note["joints"]) != robot.joint_names:
            raise FileError(f"joints {', '.join(note['joints'])}")
        friction = None if note["friction"] is None else FrictionModel(**note["friction"])
        # The links may have fewer digits than the comment.
        inertial, armature = (np.array(note[k], np.float64) for k in ("inertial", "armature"))
        robot = replace(robot, inertial=inertial, armature=armature)
        return ArmModel(robot, note["drive_gain"], friction, note["noise"])
    except (ValueError, KeyError, TypeError) as error:
        raise FileError(f"{path}: its calibration cannot be read ({error})") from None
