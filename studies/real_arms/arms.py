"""The real arms of the data folder: their logs, and the pushes in them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tauguard.datasets import read_log
from tauguard.datasets.drives import DRIVES
from tauguard.detectors import ArmModel, RobotNumbers
from tauguard.detectors.calibration.recording import Load, Recording
from tauguard.models import pin_model
from tauguard.traces import Trace


@dataclass(frozen=True)
class Push:
    """A hand's push."""

    start: float  #: the sensor passes 4 N, or the torque leaves its course [s from the beginning]
    peak: float  #: of the force, or of the torque [s]
    moving: bool  #: whether the pushed joints moved


@dataclass(frozen=True)
class ArmData:
    """One arm."""

    name: str  #: folder, preset and URDF
    free: tuple[str, ...]  #: folders of collision-free logs
    loads: dict[str, Load | None] = field(default_factory=dict)  #: by log, where there were any
    pushes: dict[str, tuple[Push, ...]] = field(default_factory=dict)
    """By log, where there is no sensor: the torque less that of an untouched run at the same place
    of the program, from 3 N m to its peak."""


def _pushes(moving: bool, *spans: tuple[float, float]) -> tuple[Push, ...]:
    return tuple(Push(start, peak, moving) for start, peak in spans)


ARMS = (
    ArmData(
        "ur10e",
        ("free", "jointwise", "validation"),
        {"ur-20_01_13-load_2600": Load(2.6), "ur-20_01_31-load": None},
    ),
    ArmData(
        "ur5",
        ("free",),
        pushes={
            "no10_standing_pushed": _pushes(
                False, (3.22, 3.42), (5.25, 5.45), (6.15, 6.47), (7.95, 8.27), (9.7, 10.4)
            ),
            "no5_pushed": _pushes(
                True,
                *((12.54, 12.79), (18.9, 19.12), (21.14, 21.44), (21.8, 22.06), (24.77, 24.98)),
                *((25.5, 25.66), (26.17, 26.3), (27.29, 27.4), (27.8, 27.95)),
            )
            + _pushes(False, (20.5, 20.79)),
            "no7_pushed": _pushes(True, (15.55, 16.05), (18.2, 18.9))
            + _pushes(False, (8.38, 8.64), (11.52, 11.83), (13.9, 14.12)),
        },
    ),
    ArmData("ur3", ("free",)),
)


def thinned(trace: Trace, rate: float) -> Trace:
    """The samples that are left at ``rate`` [Hz], without truth."""
    rows = slice(None, None, round(1 / (trace.dt * rate)))
    signals = (trace.t[rows], trace.q[rows], trace.qd[rows], trace.current[rows])
    return Trace(trace.joint_names, *signals)


def folder() -> Path:
    """Where the logs are."""
    return Path(os.environ.get("TAUGUARD_DATA", "data"))


def available() -> list[ArmData]:
    """The arms whose logs are there."""
    return [arm for arm in ARMS if (folder() / arm.name / f"{arm.name}.urdf").is_file()]


def nominal(arm: ArmData) -> ArmModel:
    """What a user knows of the arm before any calibration."""
    robot = RobotNumbers.from_pin(pin_model(folder() / arm.name / f"{arm.name}.urdf"))
    drive = DRIVES.get(arm.name)
    return ArmModel(robot, np.array(drive.gain) if drive else np.ones(robot.joints))


def recordings(arm: ArmData, kinds: Sequence[str]) -> dict[str, Recording]:
    """Logs of some folders by name."""
    found = {}
    for kind in kinds:
        for path in sorted((folder() / arm.name / kind).glob("*.csv")):
            trace = read_log(path, arm.name).trace
            found[path.stem] = Recording(trace, arm.loads.get(path.stem, Load()))
    return found


def pushes(arm: ArmData, log: str) -> tuple[Push, ...]:
    """The pushes of a contact log: by its force sensor, if it has one."""
    path = folder() / arm.name / "contact" / f"{log}.csv"
    table = np.genfromtxt(path, delimiter=",", names=True)
    if "Fx" not in (table.dtype.names or ()):
        return arm.pushes.get(log, ())
    force = np.sqrt(sum(table[f"F{axis}"] ** 2 for axis in "xyz"))
    t, found = table["t"] - table["t"][0], []
    starts = np.flatnonzero((force[1:] > 4) & (force[:-1] <= 4)) + 1
    free_at = -1.0
    for start in starts:
        below = np.flatnonzero(force[start:] < 2)
        end = start + (int(below[0]) if len(below) else len(force) - start - 1)
        if t[start] < free_at or end <= start:
            continue
        peak = start + int(np.argmax(force[start:end]))
        free_at = t[end] + 0.3
        if force[peak] > 5:
            moving = bool((np.abs(_speeds(table)[start:peak]) > 0.05).any())
            found.append(Push(float(t[start]), float(t[peak]), moving))
    return tuple(found)


def _speeds(table: np.ndarray) -> np.ndarray:
    return np.column_stack([table[f"qd{k}"] for k in range(1, 7)])
