"""An arm with some of its joints held at zero: their links move with the joints that are left."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.calibration.consistent import inertial_numbers, pseudo_inertia
from tauguard.detectors.dynamics.robot import RobotNumbers


def holding(robot: RobotNumbers, held: Collection[str]) -> RobotNumbers:
    """The robot without the joints ``held``."""
    kept: list[int] = []
    inertial: list[Array] = []
    parent: list[int] = []
    placed: list[Array] = []
    frames: list[tuple[int, Array]] = []  # of each joint: the one that carries it, and where
    for i, name in enumerate(robot.joint_names):
        above = int(robot.parent[i])
        carrier, pose = frames[above] if above >= 0 else (-1, np.eye(4))
        own = np.eye(4)
        own[:3, :3], own[:3, 3] = robot.rotation[i], robot.translation[i]
        pose = pose @ own
        if name not in held:
            parent.append(carrier)
            placed.append(pose)
            inertial.append(robot.inertial[i].copy())
            frames.append((len(kept), np.eye(4)))
            kept.append(i)
            continue
        frames.append((carrier, pose))
        if carrier >= 0:
            moved = pose @ pseudo_inertia(robot.inertial[i]) @ pose.T
            inertial[carrier] += inertial_numbers(moved)
    poses = np.array(placed)
    return replace(
        robot,
        joint_names=tuple(robot.joint_names[i] for i in kept),
        parent=np.array(parent, dtype=np.int64),
        prismatic=robot.prismatic[kept],
        rotation=np.ascontiguousarray(poses[:, :3, :3]),
        translation=np.ascontiguousarray(poses[:, :3, 3]),
        axis=robot.axis[kept],
        inertial=np.array(inertial),
        armature=robot.armature[kept],
    )
