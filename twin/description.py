"""Write a twin as a robot file for the simulator (TOML), with the bodies as URDF or MJCF."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tauguard.arrays import Array
from tauguard.atomic_write import write_atomic
from tauguard.detectors.calibration.arm_file import save_arm
from tauguard.findings import FileError
from tauguard.twin.identify import NUMBERS, Twin

#: The ten inertial numbers of a body, in its joint's frame.
QUANTITIES = ("mass", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")


def write_twin(
    twin: Twin, robot: Path, out: Path, logs: Sequence[str], scale: str
) -> tuple[Path, Path]:
    """Write the TOML file and, beside it, a URDF or MJCF file and a CSV file of left-over errors.

    Args:
        twin: identified twin.
        robot: the robot file from which it was identified.
        out: the TOML file.
        logs: names of the logs, for a comment.
        scale: what determined the scale of the torques, for a comment.

    Returns:
        The URDF or MJCF file, and the CSV file.

    Raises:
        FileError: ``out`` does not end in .toml.
        OSError: a file cannot be written.
    """
    if out.suffix != ".toml":
        raise FileError(f'`out="{out}"`: expected a name that ends in .toml')
    bodies = out.with_name(f"{out.stem}.bodies{robot.suffix}")
    save_arm(twin.arm, robot, bodies, scale=scale, logs=list(logs))
    _without_losses(bodies)
    sensors = twin.drive.sensors
    assert sensors is not None
    assert sensors.left_over is not None
    left_over = out.with_name(f"{out.stem}.left_over.csv")
    sensors.left_over.write(left_over)
    write_atomic(out, _text(twin, bodies.name, left_over.name, logs))
    return bodies, left_over


def _without_losses(bodies: Path) -> None:
    """Remove damping and friction from the URDF or MJCF file; the TOML file states them."""
    text = re.sub(r"<dynamics\b[^>]*/>", "", bodies.read_text("utf-8"))
    write_atomic(bodies, re.sub(r'\s(?:damping|frictionloss)="[^"]*"', "", text))


def _text(twin: Twin, bodies: str, left_over: str, logs: Sequence[str]) -> str:
    drive, sensors, friction = twin.drive, twin.drive.sensors, twin.drive.friction
    assert sensors is not None
    assert friction is not None
    assert friction.slope is not None
    assert friction.slope_velocity is not None
    half = {k: _half_widths(v) for k, v in twin.intervals.items() if k in NUMBERS}
    lines = [
        *(f"# {note}" for note in twin.notes),
        *_bodies(twin),
        "# +- is half of a 95 % interval, from the jackknife over parts of the logs",
        f'file = "{bodies}"',
        f'source = "identified from {", ".join(logs)}"',
        "",
        "[drive]",
        f"gain = {_row(drive.gain)}  # N m/A{half.get('gain', '')}",
        f"gear = {_row(drive.gear)}  # prior",
        f"rotor_inertia = {_row(twin.number('rotor'))}  # kg m^2{half.get('rotor', '')}",
        f"coulomb = {_row(friction.coulomb)}  # N m{half.get('coulomb', '')}",
        f"static = {_row(friction.static)}  # N m{half.get('static', '')}",
        f"stribeck_velocity = {_row(friction.stribeck_velocity)}  # rad/s, best of a few",
        f"viscous = {_row(friction.viscous)}  # N m s/rad{half.get('viscous', '')}",
        f"slope_velocity = {_row(friction.slope_velocity)}  # rad/s",
        f"slope = [{', '.join(_row(row) for row in friction.slope)}]  # N m",
        f"load = {_row(friction.load)}  # 1/(N m){half.get('load', '')}",
        f"presliding = {_row(friction.coulomb / friction.bristle_stiffness)}  # rad, best of a few",
        "",
        "[drive.sensors]",
        f"current_quantum = {_row(sensors.current_quantum)}  # A",
        f"position_quantum = {_digits(sensors.position_quantum)}  # rad",
        f"velocity_quantum = {_digits(sensors.velocity_quantum)}  # rad/s",
        f"rate = {_digits(sensors.rate)}  # samples a second",
        f"jitter = {_digits(sensors.jitter)}  # s, standard deviation of a sample's time",
        f'left_over = "{left_over}"  # errors of this model along the logs [A], with noise',
    ]
    return "\n".join(lines) + "\n"


def _bodies(twin: Twin) -> list[str]:
    """The identified inertial numbers as comments, one line per link."""
    half = twin.intervals.get("inertial")
    if half is None:
        return []
    units = ["kg"] + ["kg m"] * 3 + ["kg m^2"] * 6
    lines = ["# inertial numbers of the moved links that the logs identify, with 95 % intervals"]
    for name, values, widths in zip(
        twin.arm.robot.joint_names, twin.arm.robot.inertial, half, strict=True
    ):
        shown = [
            f"{quantity} {value:.3g} +- {width:.2g} {unit}"
            for quantity, value, width, unit in zip(QUANTITIES, values, widths, units, strict=True)
            if not np.isnan(width)
        ]
        lines.append(
            f"# {name}: {', '.join(shown) or 'none'}; the others stay near the robot file's"
        )
    return lines


def _half_widths(values: Array) -> str:
    if not np.any(values):
        return ", given"
    return f", +- {', '.join('prior' if np.isnan(v) else f'{v:.2g}' for v in values)}"


def _row(values: Array) -> str:
    return f"[{', '.join(_digits(v) for v in np.asarray(values))}]"


def _digits(value: float) -> str:
    return repr(float(f"{float(value):.6g}"))
