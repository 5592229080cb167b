"""An arm model as plain values and arrays, as model files hold it, and back."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from tauguard.detectors.dynamics.friction import FrictionModel
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.estimation.velocity import SensorNoise


def plain(value: object) -> dict[str, Any]:
    """The fields of a dataclass as they are."""
    return {field.name: getattr(value, field.name) for field in fields(value)}  # type: ignore[arg-type]


def arm_parts(arm: ArmModel) -> dict[str, Any]:
    """An arm model as a dictionary of arrays, numbers and text."""
    return {
        "robot": plain(arm.robot),
        "drive_gain": arm.drive_gain,
        "noise": arm.noise,
        "friction": plain(arm.friction) if arm.friction else None,
        "sensors": plain(arm.sensors) if arm.sensors else None,
    }


def arm_from_parts(parts: dict[str, Any]) -> ArmModel:
    """The arm model that :func:`arm_parts` took apart."""
    friction = parts["friction"]
    robot = {**parts["robot"], "joint_names": tuple(parts["robot"]["joint_names"])}
    return ArmModel(
        RobotNumbers(**robot),
        parts["drive_gain"],
        FrictionModel(**friction) if friction else None,
        parts["noise"],
        SensorNoise(**parts["sensors"]) if parts.get("sensors") else None,
    )
