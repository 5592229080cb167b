"""The description of a robot: its file, and the numbers that the file lacks or states wrongly."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.arrays import Array
from tauguard.findings import FileError
from tauguard.models.checks import check_keys
from tauguard.untrusted_input import read_text, reading

Numbers = tuple[float, ...]
#: One number per joint and harmonic.
Rows = tuple[Numbers, ...]

#: Treatment of a gripper's joints: welded, or moving without a drive.
GRIPPERS = ("weld", "passive")


@dataclass(frozen=True)
class RobotRipple:
    """A Fourier series of each joint's current, as :class:`tauguard.models.Ripple`."""

    cycles: Numbers  #: per motor revolution, shape (h,)
    amplitude: Rows  #: [A], shape (n, h)
    phase: Rows  #: [rad], shape (n, h)

    def __post_init__(self) -> None:
        """Check the values: ``FileError`` names the field."""
        object.__setattr__(self, "cycles", _row(self.cycles, "cycles"))
        for name in ("amplitude", "phase"):
            rows = tuple(_row(row, name) for row in getattr(self, name))
            if any(len(row) != len(self.cycles) for row in rows):
                raise FileError(f"{name}: expected {len(self.cycles)} numbers per joint")
            object.__setattr__(self, name, rows)


@dataclass(frozen=True)
class RobotSensors:
    """The arm's sensors; a single number holds for every joint."""

    current_noise: float | Numbers = 0.0  #: standard deviation [A]
    current_quantum: float | Numbers = 0.0  #: [A]
    position_quantum: float = 0.0  #: [rad]
    velocity_noise: float = 0.0  #: standard deviation [rad/s]
    velocity_quantum: float = 0.0  #: [rad/s]
    rate: float = 0.0  #: samples per second; 0: one at every physics step
    jitter: float = 0.0  #: standard deviation of a sample's time [s]
    left_over: str | None = None  #: CSV file, see :class:`tauguard.models.left_over.LeftOver`

    def __post_init__(self) -> None:
        """Check the values: ``FileError`` names the field."""
        for name in [field.name for field in fields(self) if field.name != "left_over"]:
            value = _numbers(getattr(self, name), f"drive.sensors.{name}")
            object.__setattr__(self, name, value)
            if not np.all(np.asarray(value) >= 0):
                raise FileError(f"drive.sensors.{name} {value}: expected 0 or more")


@dataclass(frozen=True)
class RobotDrive:
    """Drives from a data sheet or an identification; a single number holds for every joint.

    The gain is ``gain``, or ``gear`` times ``torque_constant``. ``rotor_inertia`` is the motor's;
    at the joint it is multiplied by gear^2. Friction is that at the joint, as defined in
    :class:`tauguard.models.Friction`.
    """

    gain: float | Numbers | None = None  #: at the joint [N m/A]; not together with torque_constant

    gear: float | Numbers | None = None
    torque_constant: float | Numbers | None = None  #: of the motor [N m/A]
    rotor_inertia: float | Numbers | None = None  #: of the motor [kg m^2]
    current_limit: float | Numbers | None = None  #: [A]
    coulomb: float | Numbers | None = None  #: [N m]
    viscous: float | Numbers | None = None  #: [N m s/rad]
    static: float | Numbers | None = None  #: level at rest [N m]
    stribeck_velocity: float | Numbers | None = None  #: [rad/s]
    presliding: float | Numbers | None = None  #: Coulomb friction over bristle stiffness [rad]
    load: float | Numbers | None = None  #: rise of the level per transmitted torque [1/(N m)]
    slope: Rows | None = None  #: rises of the level with the speed [N m], shape (n, k)
    slope_velocity: Numbers | None = None  #: speed scales of these rises [rad/s], shape (k,)
    ripple: RobotRipple | None = None
    sensors: RobotSensors | None = None
    like: str | None = None
    """``"cura6"``: all joints get that arm's ripple, lag and sensor noise. A joint whose friction
    is stated nowhere also gets that arm's friction (:mod:`tauguard.models.arm_drive`)."""

    def __post_init__(self) -> None:
        """Check the values: ``FileError`` names the field."""
        if self.like not in (None, "cura6"):
            raise FileError(f'drive.like {self.like!r}: expected "cura6"')
        if self.gain is not None and self.torque_constant is not None:
            raise FileError("drive.gain, drive.torque_constant: give one of them")
        if self.slope is not None:
            rows = tuple(_row(row, "drive.slope") for row in self.slope)
            object.__setattr__(self, "slope", rows)
        for field in fields(self):
            if field.name in ("like", "ripple", "sensors", "slope"):
                continue
            value = getattr(self, field.name)
            if value is None:
                continue
            value = _numbers(value, f"drive.{field.name}")
            object.__setattr__(self, field.name, value)
            zero = field.name in ("rotor_inertia", "coulomb", "viscous", "static", "load")
            if not np.all(np.asarray(value) >= 0 if zero else np.asarray(value) > 0):
                raise FileError(f"drive.{field.name} {value}: expected above 0")

    def row(self, name: str, joints: int) -> Array | None:
        """A field for every joint, shape (n,), or None where it is not stated.

        Raises:
            FileError: a row of another length.
        """
        value = getattr(self, name)
        return None if value is None else per_joint(value, joints, f"drive.{name}")


@dataclass(frozen=True)
class Robot:
    """One serial arm; a field that is ``None`` is read from the file or derived.

    ``file`` is an MJCF or URDF file, or the name of an arm in :data:`tauguard.models.ROBOTS`.
    ``tauguard robot`` prints the source of each number.
    """

    file: str
    joints: tuple[str, ...] | None = None
    """Names of the arm's joints, base to tip, or ``FIRST..LAST`` for all between two of them; all
    others are welded. Default: the only chain."""
    gripper: str = "weld"  #: treatment of the gripper's joints, one of :data:`GRIPPERS`
    home: Numbers | None = None  #: [rad]
    tool: str | None = None  #: name of a site or body
    torque_limit: float | Numbers | None = None  #: [N m]
    max_speed: float | Numbers | None = None  #: [rad/s]
    max_acceleration: float | Numbers | None = None  #: [rad/s^2]
    bandwidth: float | Numbers | None = None  #: of the servo [rad/s]
    friction_compensation: float = 1.0  #: fraction of the known friction that the servo compensates
    drive: RobotDrive = RobotDrive()  #: noqa: RUF009
    source: str | None = None  #: source of the identified drive, as text

    def __post_init__(self) -> None:
        """Check the values: ``FileError`` names the field and what would work."""
        object.__setattr__(self, "file", str(self.file))
        if self.gripper not in GRIPPERS:
            raise FileError(f"gripper {self.gripper!r}: expected one of {', '.join(GRIPPERS)}")
        for name in ("home", "torque_limit", "max_speed", "max_acceleration", "bandwidth"):
            value = getattr(self, name)
            if value is None:
                continue
            value = _numbers(value, name)
            object.__setattr__(self, name, value)
            if name != "home" and not all(x > 0 for x in np.atleast_1d(value)):
                raise FileError(f"{name} {value}: expected above 0")
        if self.joints is not None:
            if isinstance(self.joints, str) or not all(isinstance(j, str) for j in self.joints):
                raise FileError(f"joints {self.joints!r}: expected a list of joint names")
            object.__setattr__(self, "joints", tuple(self.joints))
        if not 0 <= self.friction_compensation <= 1:
            raise FileError(f"friction_compensation {self.friction_compensation}: expected 0 to 1")

    @classmethod
    def named(cls, text: str) -> Robot:
        """Parse ``FILE`` or ``FILE#JOINTS``; joints are separated by commas, or ``FIRST..LAST``."""
        file, _, names = text.partition("#")
        if not names or Path(text).is_file():
            return cls(text)
        return cls(file, joints=tuple(name.strip() for name in names.split(",")))

    @classmethod
    def from_toml(cls, path: str | Path) -> Robot:
        """The robot that a TOML file describes; ``file`` in it is relative to the file's folder.

        Raises:
            FileError: not TOML, or a key or value that a robot cannot have.
            FileNotFoundError: no such file.
        """
        path = Path(path)
        with reading(path):
            values: dict[str, Any] = tomllib.loads(read_text(path))
            if "file" not in values:
                raise FileError('no file; expected file = "arm.xml" (MJCF or URDF)')
            sensors = values.get("drive", {}).get("sensors", {})
            for table, name in ((values, "file"), (sensors, "left_over")):
                beside = path.parent / str(table.get(name, ""))
                if beside.is_file():
                    table[name] = str(beside)
            return cls.from_mapping(values)

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> Robot:
        """The robot that a TOML table describes."""
        parts = dict(values)
        check_keys(parts, cls, "robot: ")
        drive = parts.pop("drive", {})
        if not isinstance(drive, RobotDrive):
            drive = _drive(drive)
        return cls(**parts, drive=drive)


def _drive(values: Mapping[str, Any]) -> RobotDrive:
    """The drive that the TOML table ``drive`` describes."""
    parts = dict(values)
    check_keys(parts, RobotDrive, "drive: ")
    if "ripple" in parts:
        parts["ripple"] = _part(RobotRipple, parts["ripple"], "drive.ripple")
    if "sensors" in parts:
        sensors = dict(parts["sensors"])
        parts["sensors"] = _part(RobotSensors, sensors, "drive.sensors")
    return RobotDrive(**parts)


def _part(kind: type, values: Mapping[str, Any], where: str) -> Any:
    check_keys(values, kind, f"{where}: ")
    try:
        return kind(**values)
    except TypeError as error:
        raise FileError(f"{where}: {str(error).partition('() ')[2]}") from None


def bodies_file(path: Path) -> Path:
    """The URDF or MJCF file of a robot: of a TOML description, of an arm by name, else ``path``.

    Raises:
        FileError: a TOML file that describes no robot, or one whose ``file`` is not there.
        FileNotFoundError: no such file, or the model of a known arm is in no installed package.
    """
    from tauguard.models.known_robots import find_file, known_names

    if not path.is_file() and str(path) in known_names():
        return find_file(str(path))
    if path.suffix.lower() != ".toml":
        return path
    bodies = Path(Robot.from_toml(path).file)
    if not bodies.is_file():
        raise FileError(f"{path}: file {str(bodies)!r}: no such file")
    return bodies


def _numbers(value: Any, name: str) -> float | Numbers:
    try:
        rows = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise FileError(f"{name} {value!r}: expected a number or one per joint") from None
    if rows.ndim > 1 or not np.isfinite(rows).all():
        raise FileError(f"{name} {value!r}: expected finite numbers, one or one per joint")
    return float(rows) if rows.ndim == 0 else tuple(rows.tolist())


def _row(value: Any, name: str) -> Numbers:
    return tuple(np.atleast_1d(_numbers(value, name)).tolist())


def per_joint(value: float | Numbers, joints: int, name: str) -> Array:
    """A number for each joint, shape (n,).

    Raises:
        FileError: a row of another length.
    """
    rows = np.asarray(value, dtype=float)
    if rows.shape not in ((), (joints,)):
        raise FileError(f"{name}: {rows.size} numbers, expected one or {joints}, one per joint")
    return np.array(np.broadcast_to(rows, (joints,)))
