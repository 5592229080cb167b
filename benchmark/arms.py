"""The arms of the benchmark, their logs, and the contacts in them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from tauguard.benchmark.contacts import contacts_of
from tauguard.benchmark.manifest import data_folder
from tauguard.findings import ArgumentError, FileError
from tauguard.models.known_robots import PUBLISHED
from tauguard.traces.logs import Load, Log, cut

if TYPE_CHECKING:
    from tauguard.detectors import ArmModel
    from tauguard.detectors.evaluation.matching import Contact

Part = Literal["free", "contact"]


@dataclass(frozen=True)
class Arm:
    """One arm and its logs in the data folder."""

    name: str
    robot: str  #: robot file in the data folder, or a file of the package
    free: tuple[str, ...] = ()  #: patterns of collision-free logs
    contact: tuple[str, ...] = ()  #: patterns of logs with contacts
    columns: str = ""  #: preset of the collision-free logs' columns, by default the arm's name
    contact_columns: str = ""  #: preset of the other logs' columns, by default ``columns``
    parts: int = 1  #: number of parts into which a collision-free log is cut
    loads: dict[str, Load | None] = field(default_factory=dict)  #: by log; None: unknown load
    same_program: dict[str, str] = field(default_factory=dict)
    """By log with contacts: the untouched run of the same program, which may not train its judge"""
    trained_on: str = ""  #: arm whose logs train the detectors; empty: this one
    apart: bool = False  #: too little time to choose thresholds with

    @property
    def file(self) -> Path:
        """The robot file."""
        return PUBLISHED / self.robot if "/" not in self.robot else data_folder() / self.robot

    @property
    def blind(self) -> bool:
        """Whether nobody has developed on its logs."""
        return self.name.endswith("_blind")


_UR10E = Arm(
    "ur10e",
    "ur10e/ur10e.urdf",
    ("ur10e/free/*.csv", "ur10e/jointwise/*.csv", "ur10e/validation/*.csv"),
    ("ur10e_pushed/ur-static.csv",),
    contact_columns="ur5",
    loads={"ur-20_01_13-load_2600": Load(2.6), "ur-20_01_31-load": None},
)
_UR5 = Arm(
    "ur5",
    "ur5/ur5.urdf",
    ("ur5/free/*.csv",),
    ("ur5/contact/*.csv",),
    same_program={"no5_pushed": "no5", "no7_pushed": "no7"},
)
_UR3 = Arm("ur3", "ur3/ur3.urdf", ("ur3/free/*.csv",))
#: There is no published file of the Med 7, so the iiwa 14 stands in.
_KUKA = Arm("kuka_med7", "iiwa14.xml", ("kuka_med7/*.csv",), columns="lbr", parts=3, apart=True)
_PANDA = Arm("panda_touch", "panda.xml", (), ("panda_touch/*.csv",), columns="franka")

#: The arms by name. Logs of the blind ones without a truth by a sensor or a switch are left out.
ARMS = {
    arm.name: arm
    for arm in (
        _UR10E,
        _UR5,
        _UR3,
        _KUKA,
        _PANDA,
        replace(
            _UR10E,
            name="ur10e_blind",
            free=(
                "ur10e_blind/identification_data/*.csv",
                "ur10e_blind/jointwise_motion/*.csv",
                "ur10e_blind/validation_data/*.csv",
            ),
            contact=(),
            columns="ur10e",
            loads={"ur-20_02_19_14harm50secLoad": None, "ur-20_02_19_15harm50secLoad": None},
            trained_on="ur10e",
        ),
        replace(
            _UR5,
            name="ur5_blind",
            free=(
                "ur5_blind/Movement_No1.csv",
                "ur5_blind/Movement_No3_Acc.csv",
                "ur5_blind/*_NoDist.csv",
            ),
            contact=("ur5_blind/*_ForceSensor*.csv",),
            columns="ur5",
            same_program={},
            trained_on="ur5",
        ),
        replace(
            _UR3,
            name="ur3_blind",
            free=("ur3_blind/*.csv",),
            columns="ur3",
            trained_on="ur3",
        ),
        replace(
            _PANDA,
            name="panda_touch_blind",
            contact=("panda_touch_blind/*.csv",),
            trained_on="panda_touch",
        ),
    )
}


def arm_named(name: str) -> Arm:
    """The arm of a name.

    Raises:
        ArgumentError: no such arm.
    """
    if name not in ARMS:
        raise ArgumentError(f"no arm {name!r} in the benchmark; there are {', '.join(ARMS)}")
    return ARMS[name]


def files(arm: Arm, part: Part) -> list[Path]:
    """The files of an arm's logs that are in the data folder."""
    patterns = arm.free if part == "free" else arm.contact
    return [path for pattern in patterns for path in sorted(data_folder().glob(pattern))]


def is_there(arm: Arm) -> bool:
    """Whether the arm's logs and robot file are in the data folder."""
    return bool(files(arm, "free") or files(arm, "contact")) and arm.file.is_file()


def logs(arm: str, part: Part | None = None) -> Iterator[tuple[Log, tuple[Contact, ...]]]:
    """The logs of one arm with their contacts.

    Args:
        arm: a name of :data:`ARMS`.
        part: only collision-free logs, or only those with contacts; None: all.

    Yields:
        A log, and its contacts in the log's own time; () for a collision-free log.

    Raises:
        ArgumentError: no such arm.
        FileError: the logs are not in the data folder.
    """
    chosen = arm_named(arm)
    if not is_there(chosen):
        raise FileError(
            f"{data_folder()}: no logs of {arm}: run `tauguard data fetch {arm}`, or set "
            "TAUGUARD_DATA to the folder of the logs"
        )
    if part != "contact":
        for log in _free(chosen):
            yield log, ()
    if part != "free":
        for path in files(chosen, "contact"):
            log = _read(chosen, path, chosen.contact_columns or chosen.columns or chosen.name)
            yield log, contacts_of(log, path)


def judged_logs(arm: str) -> Iterator[tuple[Log, tuple[Contact, ...]]]:
    """The logs that are judged: collision-free ones, and those whose contacts are known."""
    yield from logs(arm, "free")
    yield from (pair for pair in logs(arm, "contact") if pair[1])


def _free(arm: Arm) -> Iterator[Log]:
    for path in files(arm, "free"):
        log = _read(arm, path, arm.columns or arm.name)
        ends = np.linspace(0, len(log.trace.t), arm.parts + 1).astype(int).tolist()
        for k in range(arm.parts):
            name = f"{log.name} {k}" if k else log.name
            yield replace(log, trace=cut(log.trace, slice(ends[k], ends[k + 1])), name=name)


def _read(arm: Arm, path: Path, columns: str) -> Log:
    from tauguard.datasets import read_log

    log = read_log(path, columns, robot=arm.file)
    return replace(log, name=path.stem, load=arm.loads.get(path.stem, Load()))


def initial_arm(arm: Arm) -> ArmModel:
    """The arm model without a calibration: the robot file and the drives' nominal gains."""
    from tauguard.detectors import ArmModel, RobotNumbers
    from tauguard.detectors.calibration.initial_arm import DRIVES
    from tauguard.models import pin_model

    robot = RobotNumbers.from_pin(pin_model(arm.file))
    drive = DRIVES.get(arm.name.removesuffix("_blind"))
    return ArmModel(robot, np.array(drive) if drive else np.ones(robot.joints))
