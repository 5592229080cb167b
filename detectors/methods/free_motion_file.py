"""A free-motion detector as a file: JSON, numbers only."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.detectors.calibration.identification import Beliefs
from tauguard.detectors.dynamics.friction import FrictionModel
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.detectors.estimation.estimator import ArmModel, Unknowns
from tauguard.detectors.features.allowance import TERMS, Allowance
from tauguard.detectors.methods.free_motion import FreeMotionDetector, FreeMotionSettings

FORMAT = "tauguard free-motion detector 2"


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    return value


def save_free_motion(detector: FreeMotionDetector, path: str | os.PathLike[str]) -> None:
    """Write a fitted detector; whole or not at all.

    Raises:
        ValueError: it is not fitted, or the file cannot be written.
    """
    arm, resting, moving = detector._fitted()
    robot = {field.name: getattr(arm.robot, field.name) for field in fields(arm.robot)}
    content = {
        "format": FORMAT,
        "settings": asdict(detector.settings),
        "dt": detector.dt,
        "seconds": detector.seconds,
        "robot": robot,
        "drive_gain": arm.drive_gain,
        "noise": arm.noise,
        "friction": asdict(arm.friction) if arm.friction else None,
        "resting": resting.weights,
        "moving": moving.weights,
    }
    target = Path(path)
    part = target.with_name(target.name + ".part")
    try:
        part.write_text(json.dumps(_plain(content), indent=1) + "\n")
        os.replace(part, target)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise ValueError(f"{target}: cannot be written ({error.strerror})") from None


def is_free_motion(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins like one that :func:`save_free_motion` writes."""
    try:
        with open(path, "rb") as stream:
            return stream.read(1) == b"{"
    except OSError:
        return False


def load_free_motion(path: str | os.PathLike[str]) -> FreeMotionDetector:
    """Read what :func:`save_free_motion` wrote.

    Raises:
        ValueError: missing, truncated, of another version, or with numbers that do not fit.
    """
    target = Path(path)
    try:
        content = json.loads(target.read_text())
    except OSError as error:
        raise ValueError(f"{target}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise ValueError(f"{target}: not a detector file, or a damaged one ({error})") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ValueError(
            f"{target}: not a detector file of this version ({FORMAT!r}); train the detector anew "
            "by `tauguard train --free`"
        )
    try:
        return _rebuilt(content)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise ValueError(f"{target}: a detector file with a part missing ({error})") from None


def _rebuilt(content: dict[str, Any]) -> FreeMotionDetector:
    settings = content["settings"]
    settings["unknowns"] = Unknowns(**settings["unknowns"])
    settings["beliefs"] = Beliefs(**settings["beliefs"])
    robot = {**content["robot"], "joint_names": tuple(content["robot"]["joint_names"])}
    friction = FrictionModel(**content["friction"]) if content["friction"] else None
    arm = ArmModel(RobotNumbers(**robot), content["drive_gain"], friction, content["noise"])
    resting, moving = (np.array(content[name], dtype=np.float64) for name in ("resting", "moving"))
    for weights in (resting, moving):
        if weights.shape != (arm.robot.joints, TERMS) or not np.isfinite(weights).all():
            raise ValueError("allowances of another shape, or not finite")
    dt, seconds = float(content["dt"]), float(content["seconds"])
    return FreeMotionDetector(
        FreeMotionSettings(**settings),
        model=arm,
        resting=Allowance(resting),
        moving=Allowance(moving),
        dt=dt,
        seconds=seconds,
    )
