"""The real arms of the data folder: their logs, and the pushes in them."""

import csv
import os
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tauguard.arrays import Array
from tauguard.datasets import read_log
from tauguard.detectors import ArmModel, RobotNumbers
from tauguard.detectors.calibration.initial_arm import DRIVES
from tauguard.detectors.calibration.recording import Load, Recording, cut
from tauguard.models import pin_model
from tauguard.models.known_robots import PUBLISHED
from tauguard.traces import Trace
from tauguard.traces.resample import resampled

#: Shortest untouched beginning of a log that is used as a collision-free log [s].
SHORTEST = 1.2
BEGINS, ENDS = 4.0, 2.0  #: a push begins above and ends below these forces of a sensor [N]
APART = 0.3  #: least time between two pushes [s]


@dataclass(frozen=True)
class Push:
    """A hand's push."""

    start: float  #: the sensor passes 4 N, or a torque begins to deviate [s from the log's start]
    peak: float  #: peak of the force or torque, or end of a labelled touch [s]
    moving: bool  #: whether the pushed joints moved
    labelled: bool = False  #: a switch on the hand labels all contacts of the log


@dataclass(frozen=True)
class Touched:
    """A log with pushes."""

    recording: Recording
    pushes: tuple[Push, ...]
    quiet: int = 0  #: number of rows before the first touch
    own: Array | None = None  #: the robot's own estimate of the external torque [N m], (T, n)


@dataclass(frozen=True)
class ArmData:
    """One arm."""

    name: str  #: folder of the arm; also its preset and URDF, unless the fields below are set
    free: tuple[str, ...]  #: folders of collision-free logs
    contact: str = ""  #: folder of logs with pushes, in the data folder
    robot: str = ""  #: robot file of the package
    columns: str = ""  #: preset of the logs' columns
    parts: int = 1  #: number of parts into which a free log is cut
    loads: dict[str, Load | None] = field(default_factory=dict)  #: by log; None: unknown load

    @property
    def file(self) -> Path:
        """The robot file: ``robot`` of the package, else the URDF in the arm's data folder."""
        own = folder() / self.name / f"{self.name}.urdf"
        return PUBLISHED / self.robot if self.robot else own


ARMS = (
    ArmData(
        "ur10e",
        ("free", "jointwise", "validation"),
        "ur10e_pushed",
        loads={"ur-20_01_13-load_2600": Load(2.6), "ur-20_01_31-load": None},
    ),
    ArmData("ur5", ("free",), "ur5/contact"),
    ArmData("ur3", ("free",)),
    # The data folder has no file of the Med 7, so the iiwa 14 stands in.
    ArmData("kuka_med7", ("",), robot="iiwa14.xml", columns="lbr", parts=3),
    ArmData("panda_touch", (), "panda_touch", robot="panda.xml", columns="franka"),
)


def by_eye(log: str) -> tuple[Push, ...]:
    """Pushes of a log without a sensor, from ``pushes.csv``, which documents their source."""
    lines = Path(__file__).with_name("pushes.csv").read_text("utf-8").splitlines()
    rows = csv.DictReader(line for line in lines if not line.startswith("#"))
    return tuple(
        Push(float(row["start"]), float(row["peak"]), row["state"] == "moving")
        for row in rows
        if row["log"] == log
    )


def thinned(trace: Trace, rate: float) -> Trace:
    """The trace at ``rate`` [Hz], without truth."""
    return replace(resampled(trace, rate), truth=None)


def folder() -> Path:
    """The folder of the logs."""
    return Path(os.environ.get("TAUGUARD_DATA", "data"))


def available() -> list[ArmData]:
    """The arms whose logs exist."""
    return [arm for arm in ARMS if (folder() / arm.name).is_dir() and arm.file.is_file()]


def nominal(arm: ArmData) -> ArmModel:
    """The arm model without a calibration: the robot file and the drives' nominal gains."""
    robot = RobotNumbers.from_pin(pin_model(arm.file))
    drive = DRIVES.get(arm.name)
    return ArmModel(robot, np.array(drive) if drive else np.ones(robot.joints))


def recordings(arm: ArmData) -> dict[str, Recording]:
    """Collision-free logs by name; without any, the untouched beginnings of other logs."""
    if not arm.free:
        logs = {n: one for n, one in touched(arm).items() if one.pushes[0].start > SHORTEST}
        return {n: Recording(cut(o.recording.trace, slice(None, o.quiet))) for n, o in logs.items()}
    found = {}
    for path in [p for k in arm.free for p in sorted((folder() / arm.name / k).glob("*.csv"))]:
        trace = read_log(path, arm.columns or arm.name).trace
        ends = np.linspace(0, len(trace.t), arm.parts + 1).astype(int).tolist()
        for k in range(arm.parts):
            name = f"{path.stem} {k}" if k else path.stem
            part = cut(trace, slice(ends[k], ends[k + 1]))
            found[name] = Recording(part, arm.loads.get(path.stem, Load()))
    return found


def touched(arm: ArmData) -> dict[str, Touched]:
    """Logs with pushes by name."""
    found = {}
    for path in sorted((folder() / arm.contact).glob("*.csv")) if arm.contact else ():
        log = read_log(path, arm.columns or "ur5")
        table = np.genfromtxt(path, delimiter=",", names=True)
        if log.labels:
            found[path.stem] = _labelled(Recording(log.trace), log.labels, table)
        elif known := _by_sensor(table) or by_eye(path.stem):
            found[path.stem] = Touched(Recording(log.trace), known)
    return found


def _labelled(
    recording: Recording, spans: tuple[tuple[float, float], ...], table: np.ndarray
) -> Touched:
    """Touches by the switch on the hand, and Franka's estimate at the trace's times."""
    t = recording.trace.t
    starts = np.searchsorted(t, [start for start, _ in spans])
    ends = np.minimum(np.searchsorted(t, [end for _, end in spans], side="right"), len(t) - 1)
    pushes = tuple(
        Push(float(t[a] - t[0]), float(t[b] - t[0]), False, True)
        for a, b in zip(starts, ends, strict=True)
    )
    names = [f"tau_ext{k}" for k in range(7)]
    own = np.column_stack([np.interp(t, table["time"], table[name]) for name in names])
    return Touched(recording, pushes, max(int(starts[0]) - 20, 0), own)


def sensor_spans(t: Array, force: Array) -> list[tuple[int, int]]:
    """First and last row of each push that a sensor shows: from 4 N on until below 2 N.

    A push begins at least 0.3 s after the end of the previous one. ``t`` [s] and the norm of the
    force [N] have shape (T,).
    """
    found: list[tuple[int, int]] = []
    for row in np.flatnonzero((force[1:] > BEGINS) & (force[:-1] <= BEGINS)) + 1:
        below = np.flatnonzero(force[row:] < ENDS)
        first, last = int(row), int(row + below[0] if len(below) else len(t) - 1)
        if last > first and (not found or t[first] >= t[found[-1][1]] + APART):
            found.append((first, last))
    return found


def _by_sensor(table: np.ndarray) -> tuple[Push, ...]:
    """The pushes above 5 N that a force sensor shows; empty without a sensor."""
    if "Fx" not in (table.dtype.names or ()):
        return ()
    force = np.sqrt(sum(table[f"F{axis}"] ** 2 for axis in "xyz"))
    t, found = table["t"] - table["t"][0], []
    for start, end in sensor_spans(t, force):
        peak = start + int(np.argmax(force[start:end]))
        if force[peak] > 5:
            moving = any((np.abs(table[f"qd{k}"][start:peak]) > 0.05).any() for k in range(1, 7))
            found.append(Push(float(t[start]), float(t[peak]), moving))
    return tuple(found)
