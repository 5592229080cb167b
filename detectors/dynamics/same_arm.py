"""Whether two robots have the same geometry: the same joint axes at q = 0."""

from __future__ import annotations

import numpy as np

from tauguard.arrays import Array, Bools
from tauguard.detectors.dynamics.robot import RobotNumbers

#: Largest distance between two axes [m], and largest angle between them [rad], of one joint.
AXIS_DISTANCE, AXIS_ANGLE = 1e-3, 1e-3


def arm_difference(robot: RobotNumbers, trained: RobotNumbers) -> str:
    """The first difference between a robot's geometry and that of a detector; "" if there is none.

    Names of joints and frames of links may differ, masses, which a calibration changes, and the
    base's place and its turn about the vertical.

    Args:
        robot: an arm.
        trained: the arm of a detector.
    """
    if robot.joints != trained.joints:
        return f"{robot.joints} joints, the detector's arm has {trained.joints}"
    for name, one, two in zip(robot.joint_names, robot.prismatic, trained.prismatic, strict=True):
        if one != two:
            return f"{name} is a joint of another kind than in the detector's arm"
    own, other = joint_axes(robot), joint_axes(trained)
    angle, distance = _differences(*own, *other, robot.prismatic)
    off = (angle > AXIS_ANGLE) | (distance > AXIS_DISTANCE)
    if not off.any() or _fits_elsewhere(*own, *other, robot.prismatic):
        return ""
    k = int(off.argmax())
    size = (
        f"{np.degrees(angle[k]):.3g} deg"
        if angle[k] > AXIS_ANGLE
        else f"{1e3 * distance[k]:.0f} mm"
    )
    return f"the axis of {robot.joint_names[k]} is {size} from that of the detector's arm"


def joint_axes(robot: RobotNumbers) -> tuple[Array, Array]:
    """A point on each joint's axis [m] and its direction, at q = 0, in the base frame, (n, 3)."""
    turns, places = np.empty((robot.joints, 3, 3)), np.empty((robot.joints, 3))
    for k, parent in enumerate(robot.parent):
        turn = turns[parent] if parent >= 0 else np.eye(3)
        origin = places[parent] if parent >= 0 else np.zeros(3)
        turns[k], places[k] = turn @ robot.rotation[k], origin + turn @ robot.translation[k]
    return places, np.einsum("kij,kj->ki", turns, robot.axis)


def _differences(
    point: Array, axis: Array, wanted: Array, along: Array, prismatic: Bools
) -> tuple[Array, Array]:
    """Angle [rad] and distance [m] between the axes of each joint; 0 m for prismatic joints."""
    angle = 2 * np.arcsin(np.minimum(np.linalg.norm(axis - along, axis=1) / 2, 1.0))
    distance = np.linalg.norm(np.cross(point - wanted, along), axis=1)
    return angle, np.where(prismatic, 0.0, distance)


def _fits_elsewhere(
    point: Array, axis: Array, wanted: Array, along: Array, prismatic: Bools
) -> bool:
    """Whether the axes agree once the base is turned about the vertical and moved."""
    pairs = zip(axis[:, :2], along[:, :2], strict=True)
    if np.abs(along[:, :2]).max() < AXIS_ANGLE:  # all axes are vertical: their places turn
        pairs = zip((point - point[0])[:, :2], (wanted - wanted[0])[:, :2], strict=True)
    turn = sum(complex(*goal) * complex(*own).conjugate() for own, goal in pairs)
    if abs(turn) < 1e-9:
        return False
    c, s = turn.real / abs(turn), turn.imag / abs(turn)
    yaw = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    point, axis = point @ yaw.T, axis @ yaw.T
    # Across each axis the places have to agree: linear equations of the shift.
    across = np.eye(3) - along[:, :, None] * along[:, None, :]
    across[prismatic] = 0.0
    shift = np.linalg.lstsq(
        across.reshape(-1, 3), np.einsum("kij,kj->ki", across, wanted - point).ravel(), rcond=None
    )[0]
    angle, distance = _differences(point + shift, axis, wanted, along, prismatic)
    return bool((angle <= AXIS_ANGLE).all() and (distance <= AXIS_DISTANCE).all())
