"""A twin as the robot file that the simulator reads: TOML, beside it the bodies as URDF or MJCF."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tauguard.arrays import Array
from tauguard.atomic_write import write_atomic
from tauguard.detectors.calibration.arm_file import save_arm
from tauguard.models import Ripple
from tauguard.twin.drive_fit import DriveFit
from tauguard.twin.identify import PRESLIDING, Twin


def write_twin(twin: Twin, robot: Path, out: Path, logs: Sequence[str], scale: str) -> Path:
    """Write the description, and the bodies beside it.

    Args:
        twin: identified.
        robot: the robot file that it began with.
        out: the TOML file.
        logs: names of the logs, for the reader.
        scale: what fixed the scale of the torques.

    Returns:
        The file of the bodies.

    Raises:
        ValueError: ``out`` does not end in .toml.
        OSError: cannot be written.
    """
    if out.suffix != ".toml":
        raise ValueError(f"--out {out}: expected a name that ends in .toml")
    bodies = out.with_name(f"{out.stem}.bodies{robot.suffix}")
    save_arm(twin.arm, robot, bodies, scale=scale, logs=list(logs))
    _without_losses(bodies)
    write_atomic(out, _text(twin, bodies.name, logs))
    return bodies


def _without_losses(bodies: Path) -> None:
    """The description states friction: none of the file's own is added to it."""
    text = re.sub(r"<dynamics\b[^>]*/>", "", bodies.read_text())
    write_atomic(bodies, re.sub(r'\s(?:damping|frictionloss)="[^"]*"', "", text))


def _text(twin: Twin, bodies: str, logs: Sequence[str]) -> str:
    drive, sensors, friction, ripple = (
        twin.drive, twin.drive.sensors, twin.drive.friction, twin.drive.ripple
    )  # fmt: skip
    assert sensors is not None
    assert friction is not None
    assert ripple is not None
    assert sensors.directional is not None
    rows = twin.arm.robot.armature / drive.gear**2
    lines = [
        *(f"# {note}" for note in twin.notes),
        f"# sampled at {twin.rate:.4g} Hz, {1e3 * twin.jitter:.2g} ms standard deviation",
        f'file = "{bodies}"',
        f'source = "identified from {", ".join(logs)}"',
        "",
        "[drive]",
        f"gain = {_row(drive.gain)}  # N m/A",
        f"gear = {_row(drive.gear)}  # prior",
        f"rotor_inertia = {_row(rows)}  # kg m^2, of the motor",
        f"coulomb = {_row(friction.coulomb)}  # N m, {_spread(twin.fits, 'coulomb')}",
        f"static = {_row(friction.static)}  # N m, {_spread(twin.fits, 'static')}",
        f"stribeck_velocity = {_row(friction.stribeck_velocity)}  # rad/s, best of a few",
        f"viscous = {_row(friction.viscous)}  # N m s/rad, {_spread(twin.fits, 'viscous')}",
        f"load = {_row(friction.load)}  # 1/(N m)",
        f"presliding = {PRESLIDING}  # rad, prior: reported positions do not resolve it",
        "",
        "[drive.ripple]  # offset, harmonics of the joint, lines of the motor, what is left",
        *_series(ripple),
        "",
        "[drive.sensors]",
        f"current_noise = {_row(sensors.current_noise)}  # A",
        f"current_quantum = {_row(sensors.current_quantum)}  # A",
        f"position_quantum = {_digits(sensors.position_quantum)}  # rad",
        f"velocity_noise = {_digits(sensors.velocity_noise)}  # rad/s",
        f"velocity_quantum = {_digits(sensors.velocity_quantum)}  # rad/s",
        "",
        "[drive.sensors.directional]  # changes sign with the velocity",
        *_series(sensors.directional),
    ]
    return "\n".join(lines) + "\n"


def _series(ripple: Ripple) -> list[str]:
    table = {"amplitude": ripple.amplitude, "phase": ripple.phase}
    rows = [f"cycles = {_row(ripple.cycles)}"]
    for name, values in table.items():
        rows += [f"{name} = [", *(f"    {_row(row)}," for row in values), "]"]
    return rows


def _spread(fits: Sequence[DriveFit | None], name: str) -> str:
    """Half the width of each 95 % interval."""
    half = ["prior" if f is None else f"{1.96 * getattr(f, name)[1]:.2g}" for f in fits]
    return f"+- {', '.join(half)}"


def _row(values: Array) -> str:
    return f"[{', '.join(_digits(v) for v in np.asarray(values))}]"


def _digits(value: float) -> str:
    return repr(float(f"{float(value):.6g}"))
