"""Simulated drives from the numbers that `tauguard calibrate` writes into a robot file."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.arrays import Array
from tauguard.models.arm_drive import PRESLIDING
from tauguard.models.arm_file import ArmFile
from tauguard.models.robot import Robot
from tauguard.models.robot_file import read_note

#: Speeds at which the simulated friction law is fitted to the identified one [rad/s].
SPEEDS = np.geomspace(2e-3, 2.0, 100)
#: Default Stribeck velocity [rad/s].
STRIBECK = 0.03
#: Speed of a joint near its reversal [rad/s].
TURNING = 0.05


def calibrated(robot: Robot, path: Path, file: ArmFile, sources: dict[str, str]) -> Robot:
    """The robot with the gains, rotor inertias and friction of a calibrated file.

    Args:
        robot: the user's description; returned unchanged if it states gains.
        path: the robot's file.
        file: the content of the file. Its damping and friction loss are set to 0 if identified
            friction is used, which includes them.
        sources: receives the source of the drive.
    """
    drive, n = robot.drive, len(file.joints)
    if drive.gain is not None or drive.torque_constant is not None:
        return robot
    note = read_note(path)
    values = json.loads(note) if note and note.lstrip().startswith("{") else {}
    if values.get("joints") != list(file.joints):
        return robot
    gear = drive.row("gear", n)
    turns = np.full(n, 100.0) if gear is None else gear
    rotors = tuple((np.array(values["armature"]) / turns**2).tolist())
    known = replace(
        drive, gear=tuple(turns), gain=tuple(values["drive_gain"]), rotor_inertia=rotors
    )
    stated, learned = drive.coulomb is not None or drive.viscous is not None, "gains, rotors"
    if values["friction"] is not None and not stated:
        known, learned = replace(known, **friction_rows(values["friction"])), f"{learned}, friction"
        for name in file.joints:
            joint, dof = file.spec.joint(name), file.model.joint(name).dofadr[0]
            joint.damping[:], joint.frictionloss = 0.0, 0.0
            file.model.dof_damping[dof] = file.model.dof_frictionloss[dof] = 0.0
    sources["drive"] = (
        f"the file's calibration: {learned}; `tauguard twin` adds noise and repeatable errors"
    )
    return replace(robot, drive=known)


def friction_rows(friction: dict[str, Any]) -> dict[str, Any]:
    """Keywords of :class:`RobotDrive` that approximate an identified friction model.

    The identified model can have negative weights, which the simulated law does not allow. Sliding
    friction is therefore fitted at :data:`SPEEDS` by non-negative least squares. Ripple, and
    offsets that differ by direction, are left out.

    Args:
        friction: the fields of :class:`tauguard.detectors.FrictionModel`.
    """
    from scipy.optimize import nnls

    weights, v = np.array(friction["weights"], dtype=np.float64), SPEEDS
    groups = ("bristles", "stops", "stribeck", "slopes", "loaded")
    widths = [np.array(friction[name], dtype=np.float64) for name in groups]
    bristles, stops, stribeck, slopes, loaded = widths
    ends = np.cumsum([2, *map(len, widths[:4])])
    held, dips, rises = (weights[:, a:b] for a, b in ((2, ends[2]), ends[2:4], ends[3:5]))
    rest = held.sum(axis=1)
    level = (
        rest[:, None]
        + weights[:, 1:2] * v
        + dips @ np.exp(-((v / stribeck[:, None]) ** 2))
        + rises @ np.tanh(v / slopes[:, None])
    )
    width = float(stribeck[-1]) if len(stribeck) else STRIBECK
    slip = np.exp(-((v / width) ** 2))
    table = np.stack([1 - slip, slip, v, *np.tanh(v / slopes[:, None])], axis=1)
    x = np.array([nnls(table, row)[0] for row in level])
    usual = np.maximum(x @ table[np.searchsorted(v, TURNING)] - x[:, 2] * TURNING, 1e-3)
    coulomb, static = (np.maximum(part, 0.05 * usual) for part in (x[:, 0], x[:, 1]))
    settles = _settling(held, bristles, stops)
    carried = weights[:, ends[4] : ends[4] + 1 + len(loaded)]
    per_load = carried @ np.vstack([np.ones_like(v), np.tanh(v / loaded[:, None])])
    dry = level - weights[:, 1:2] * v
    rise = (per_load * dry).sum(axis=1) / np.maximum((dry**2).sum(axis=1), 1e-12)
    return {
        "coulomb": tuple(coulomb),
        "static": tuple(static),
        "stribeck_velocity": width,
        "viscous": tuple(x[:, 2]),
        "presliding": tuple(coulomb / usual * settles),
        "load": tuple(np.maximum(rise, 0.0)),
        "slope": tuple(map(tuple, x[:, 3:])) if len(slopes) else None,
        "slope_velocity": tuple(slopes) if len(slopes) else None,
    }


def _settling(held: Array, bristles: Array, stops: Array) -> Array:
    """Angle after which each joint's friction at rest has reached 1 - 1/e of its level [rad]."""
    angle = np.geomspace(1e-4, 0.1, 200)
    parts = [1 - np.exp(-angle / width) for width in bristles]
    parts += [np.minimum(angle / width, 1) for width in stops]
    total = held.sum(axis=1, keepdims=True)
    reached = held @ np.array(parts) >= (1 - np.exp(-1)) * total
    return np.where(total[:, 0] > 0, angle[np.argmax(reached, axis=1)], PRESLIDING)
