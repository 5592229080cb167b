"""Whether two robots have the same geometry: the same joint axes in the base frame at q = 0."""

from __future__ import annotations

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.dynamics.robot import RobotNumbers

#: Largest distance between two axes [m], and largest angle between them [rad], of one joint.
AXIS_DISTANCE, AXIS_ANGLE = 1e-3, 1e-3


def arm_difference(robot: RobotNumbers, trained: RobotNumbers) -> str:
    """The first difference between a robot's geometry and that of a detector; "" if there is none.

    Names of joints and frames of links may differ, and masses, which a calibration changes.

    Args:
        robot: an arm.
        trained: the arm of a detector.
    """
    if robot.joints != trained.joints:
        return f"{robot.joints} joints, the detector's arm has {trained.joints}"
    (at, along), (place, axis) = joint_axes(robot), joint_axes(trained)
    for k, name in enumerate(robot.joint_names):
        if robot.prismatic[k] != trained.prismatic[k]:
            return f"{name} is a joint of another kind than in the detector's arm"
        angle = float(np.linalg.norm(along[k] - axis[k]))
        if angle > AXIS_ANGLE:
            degrees = np.degrees(2 * np.arcsin(min(angle / 2, 1.0)))
            return f"the axis of {name} is {degrees:.3g} deg from that of the detector's arm"
        distance = float(np.linalg.norm(np.cross(at[k] - place[k], axis[k])))
        if distance > AXIS_DISTANCE and not robot.prismatic[k]:
            return f"the axis of {name} is {1e3 * distance:.0f} mm from that of the detector's arm"
    return ""


def joint_axes(robot: RobotNumbers) -> tuple[Array, Array]:
    """A point on each joint's axis [m] and its direction, at q = 0, in the base frame, (n, 3)."""
    turns, places = np.empty((robot.joints, 3, 3)), np.empty((robot.joints, 3))
    for k, parent in enumerate(robot.parent):
        turn = turns[parent] if parent >= 0 else np.eye(3)
        origin = places[parent] if parent >= 0 else np.zeros(3)
        turns[k], places[k] = turn @ robot.rotation[k], origin + turn @ robot.translation[k]
    return places, np.einsum("kij,kj->ki", turns, robot.axis)
