"""The drives of an arm: stated, assumed, calibrated, or scaled from the CURA6-like arm's."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.arrays import Array, Bools
from tauguard.findings import ArgumentError
from tauguard.models import cura6
from tauguard.models.arm_file import ArmFile
from tauguard.models.drive import Drive, Friction, Ripple, Sensors, cura6_drive
from tauguard.models.left_over import LeftOver
from tauguard.models.robot import Robot, RobotDrive, RobotRipple, RobotSensors, per_joint
from tauguard.models.robot_file import read_note

#: Default presliding distance: Coulomb friction over bristle stiffness [rad].
PRESLIDING = 1.5e-3
#: Least time constant of a joint's braking by back-EMF above the largest speed [s].
_FADE_TIME = 4e-3
#: Default gear ratio and gain [N m/A].
_GEAR, _GAIN = 100.0, 10.0


def level_friction(coulomb: Array, viscous: Array) -> Friction:
    """Friction from a level [N m] and a viscous coefficient [N m s/rad], shapes (n,)."""
    n = len(coulomb)
    return Friction(
        coulomb=coulomb,
        static=coulomb,
        stribeck_velocity=np.full(n, 0.03),
        viscous=viscous,
        bristle_stiffness=coulomb / PRESLIDING,
        load=np.zeros(n),
    )


def stated_drive(stated: RobotDrive, limit: Array, sources: dict[str, str]) -> Drive:
    """The drives that a description states; ``sources`` receives a note on assumed numbers."""
    n = len(limit)
    gear, constant = stated.row("gear", n), stated.row("torque_constant", n)
    current, gain = stated.row("current_limit", n), stated.row("gain", n)
    ratio = np.full(n, _GEAR) if gear is None else gear
    if gain is None:
        gain = np.full(n, _GAIN) if constant is None else ratio * constant
        assumed = [] if constant is not None else [f"{_GAIN:g} N m/A"]
    else:
        assumed = []
    friction = _stated_friction(stated, n)
    named = ("gear", "gain", "torque_constant", "coulomb", "viscous")
    given = "given" if any(stated.row(name, n) is not None for name in named) else ""
    ripple, sensors = _stated_ripple(stated.ripple), _stated_sensors(stated.sensors, n)
    parts = {"losses": friction, "ripple": ripple, "lag": None}
    rest = ", ".join(f"no {part}" for part, known in parts.items() if known is None)
    if stated.like is not None:
        rest = (
            "ripple, lag, noise and missing friction: the CURA6-like arm's, as fractions of limits"
        )
    sources["drive"] = "; ".join(x for x in (sources.get("drive", given), *assumed, rest) if x)
    limits = limit / np.abs(gain) if current is None else current
    return Drive(gain, ratio, limits, None, friction, ripple, sensors)


def _stated_friction(stated: RobotDrive, n: int) -> Friction | None:
    coulomb, viscous = stated.row("coulomb", n), stated.row("viscous", n)
    if coulomb is None and viscous is None:
        return None
    zero = np.zeros(n)
    coulomb = zero if coulomb is None else coulomb
    friction = level_friction(coulomb, zero if viscous is None else viscous)
    known: dict[str, Any] = {
        name: row
        for name in ("static", "stribeck_velocity", "load")
        if (row := stated.row(name, n)) is not None
    }
    length = stated.row("presliding", n)
    if length is not None:
        known["bristle_stiffness"] = coulomb / length
    if stated.slope is not None and stated.slope_velocity is not None:
        known["slope"] = np.array(stated.slope)
        known["slope_velocity"] = np.atleast_1d(stated.slope_velocity)
    return replace(friction, **known)


def _stated_ripple(stated: RobotRipple | None) -> Ripple | None:
    if stated is None:
        return None
    return Ripple(np.array(stated.cycles), np.array(stated.amplitude), np.array(stated.phase))


def _stated_sensors(stated: RobotSensors | None, n: int) -> Sensors | None:
    if stated is None:
        return None
    return Sensors(
        current_noise=per_joint(stated.current_noise, n, "drive.sensors.current_noise"),
        current_quantum=per_joint(stated.current_quantum, n, "drive.sensors.current_quantum"),
        position_quantum=stated.position_quantum,
        velocity_noise=stated.velocity_noise,
        velocity_quantum=stated.velocity_quantum,
        rate=stated.rate,
        jitter=stated.jitter,
        left_over=None if stated.left_over is None else LeftOver.read(stated.left_over),
    )


def with_speeds(drive: Drive, speed: Array, lightest: Array) -> Drive:
    """The drive with a torque limit that falls above the largest speed."""
    limit = drive.torque_limit
    if not np.isfinite(limit).all():
        return drive
    span = np.maximum(speed, limit * _FADE_TIME / lightest)
    return replace(drive, rated_speed=speed, no_load_speed=speed + span)


def like_cura6(drive: Drive, speed: Array, lossy: Bools) -> Drive:
    """``drive`` with friction, ripple, lag and sensor noise scaled from the CURA6-like arm.

    Coulomb friction is a fraction of the torque limit. Viscous friction is a fraction of the torque
    limit over the largest speed. Ripple and noise of the currents are fractions of the current
    limit. The rise of friction with load is inversely proportional to the torque limit. Each
    fraction is the mean over the CURA6-like arm's joints.

    Args:
        drive: the drives; friction that they state is kept.
        speed: largest joint speeds [rad/s], shape (n,).
        lossy: joints with friction in the file, which get no more friction, shape (n,).

    Raises:
        ArgumentError: a joint without a torque limit.
    """
    limit, current = drive.torque_limit, drive.current_limit
    if not np.isfinite(limit).all():
        raise ArgumentError("drive.like: a joint has no torque limit; state torque_limit")
    like, stated = cura6_drive(), drive.friction
    own, ripple, sensors = like.friction, like.ripple, like.sensors
    assert own is not None
    assert ripple is not None
    assert sensors is not None
    most, fastest = like.torque_limit, np.array(cura6.MAX_SPEED)
    coulomb = np.where(lossy, 0.0, limit * np.mean(own.coulomb / most))
    viscous = np.where(lossy, 0.0, limit / speed * np.mean(own.viscous * fastest / most))
    if stated is not None:
        known = (stated.coulomb > 0) | (stated.viscous > 0)
        coulomb = np.where(known, stated.coulomb, coulomb)
        viscous = np.where(known, stated.viscous, viscous)
    friction = Friction(
        coulomb=coulomb,
        static=coulomb * np.mean(own.static / own.coulomb),
        stribeck_velocity=np.full(len(limit), np.mean(own.stribeck_velocity)),
        viscous=viscous,
        bristle_stiffness=coulomb / PRESLIDING,
        load=np.mean(own.load * most) / limit,
    )
    heights = np.mean(ripple.amplitude / like.current_limit[:, None], axis=0)
    turns = np.arange(float(len(limit)))
    noise, quantum = sensors.current_noise, sensors.current_quantum
    return replace(
        drive,
        electrical_time_constant=like.electrical_time_constant,
        friction=friction,
        ripple=Ripple(ripple.cycles, np.outer(current, heights), np.outer(turns, ripple.phase[1])),
        sensors=Sensors(
            current_noise=current * np.mean(noise / like.current_limit),
            current_quantum=current * np.mean(quantum / like.current_limit),
        ),
    )


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
