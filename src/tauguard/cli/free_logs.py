"""Read collision-free logs for commands, and train the detector of free motion on them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tauguard.findings import ArgumentError

if TYPE_CHECKING:
    from tauguard.datasets.columns import Reading
    from tauguard.detectors import ArmModel, RobotNumbers
    from tauguard.detectors.calibration.recording import Recording
    from tauguard.detectors.scores.free_motion import FittedFreeMotion
    from tauguard.traces import Logs, Trace


@dataclass(frozen=True)
class FreeLogs:
    """Logs in which some joint moves, and the initial arm of an identification."""

    numbers: RobotNumbers  #: numbers of the robot file
    all_traces: dict[str, Trace]  #: all logs by file name, also those in which no joint moves
    logs: dict[str, Recording]  #: logs in which a joint moves, by file name, with their loads
    arm: ArmModel
    source: str  #: source of the drive gains, as text for the user
    scale: str  #: the same as the argument ``scale`` of `calibration.identification.identify`


def free_logs(
    logs: tuple[Path, ...],
    robot: Path,
    columns: str | None,
    gains: tuple[float, ...],
    payload: tuple[str, ...],
    torque: bool,
    scale: str = "auto",
    reading: Reading | None = None,
) -> FreeLogs:
    """Read and check logs and print notes; the arguments are those of the commands.

    Raises:
        ArgumentError: as raised by the called functions.
    """
    from tauguard.cli.help_text import print_notes
    from tauguard.datasets.real_arms import check_named, initial_arm
    from tauguard.detectors.calibration.checks import check_signs
    from tauguard.detectors.calibration.recording import check_length, moving

    read = read_real(logs, robot, columns, payload, torque, reading)
    print_notes(read.findings)
    recordings, notes = moving(read)
    print_notes(notes)
    if not gains:
        check_named(robot, [log.trace for log in recordings.values()])
    check_length(list(recordings.values()))
    arm, source = initial_arm(read.numbers, list(recordings.values()), gains, scale)
    check_signs(arm, recordings)
    chosen = "gains" if source in ("preset", "torques") else source
    traces = dict(zip(read, read.traces, strict=True))
    return FreeLogs(read.numbers, traces, recordings, arm, source, chosen)


def read_real(
    logs: Sequence[Path],
    robot: Path,
    columns: str | None,
    payload: Sequence[str],
    torque: bool,
    reading: Reading | None,
) -> Logs:
    """:func:`tauguard.read_logs` with the flags of commands."""
    from tauguard import read_logs
    from tauguard.cli.payload import loads

    mend, resample = (reading.mend, reading.resample) if reading else ((), 0.0)
    return read_logs(
        logs,
        columns,
        robot=robot,
        payload=loads(payload),
        torque=torque,
        mend=mend,
        resample=resample,
    )


#: Checks whose errors ``--accept`` turns into notes.
ACCEPTABLE = ("alarms", "error", "gravity", "order")


def free_arm(
    robot: Path,
    numbers: RobotNumbers,
    recordings: Mapping[str, Recording],
    gains: tuple[float, ...],
) -> tuple[ArmModel, str]:
    """The initial arm model of a training on free logs, and the source of its gains, as text.

    Raises:
        ArgumentError: gains that do not fit the arm, or torques of the wrong sign.
    """
    from tauguard.datasets.real_arms import known_arm
    from tauguard.detectors.calibration.checks import check_signs

    arm, source = known_arm(robot, numbers, list(recordings.values()), gains)
    check_signs(arm, recordings)
    return arm, source


def free_detector(
    arm: ArmModel, recordings: Mapping[str, Recording], accept: Collection[str] | None = None
) -> FittedFreeMotion:
    """Train the detector of free motion on logs.

    Args:
        arm: arm model of :func:`free_arm`.
        recordings: the logs, by file name.
        accept: names of checks and logs to accept; None: the command has no --accept.

    Raises:
        ArgumentError: too little motion, exchanged joints, another arm's gravity torques, much
            torque that is not explained, or bursts of torque, as contacts cause them.
    """
    from tauguard.detectors.calibration.checks import check_order, check_weight
    from tauguard.detectors.scores.free_motion import FreeMotion

    logs = list(recordings.values())
    run_check("order", accept, lambda: check_order(arm, recordings))
    found = FreeMotion().fit(logs, arm)
    weight = (arm.robot, found.arm.robot, [log.trace for log in logs])
    run_check("gravity", accept, lambda: check_weight(*weight))
    explain(found.arm, recordings, (), accept)
    return found


def explain(
    arm: ArmModel,
    recordings: Mapping[str, Recording],
    held: Sequence[Any],
    accept: Collection[str] | None,
) -> list[str]:
    """Print notes on torque that a calibration does not explain, and return them.

    Args:
        arm: the identified arm model.
        recordings: the logs, by file name.
        held: residual of each log in cross-validation [N m], shape (n,); empty if not known.
        accept: names of checks and logs to accept; None: the command has no --accept.

    Raises:
        ArgumentError: the model explains too little torque, or torque has bursts like a contact's.
    """
    from tauguard.cli.help_text import print_notes
    from tauguard.datasets.real_arms import calibration_notes
    from tauguard.detectors.calibration.assessment import check_bursts, unexplained

    joints, left = arm.robot.joint_names, unexplained(arm, recordings)
    notes = calibration_notes(joints, left, recordings, held)
    print_notes(notes)
    vouched = set(accept or ())
    others = {name: one for name, one in left.items() if not {name, Path(name).stem} & vouched}
    run_check("alarms", accept, lambda: check_bursts(joints, others))
    return notes


def run_check(name: str, accept: Collection[str] | None, check: Callable[[], None]) -> None:
    """Run a check; ``--accept NAME`` turns its error into a printed note.

    ``accept`` is None if the command has no such flag: the error is then raised unchanged.

    Raises:
        ArgumentError: the message of the check and the flag that accepts it.
    """
    from tauguard.cli.help_text import print_notes

    try:
        check()
    except ValueError as error:
        if accept is None:
            raise
        if name not in accept:
            raise ArgumentError(
                f"{error}; to use the logs all the same, add --accept {name}"
            ) from None
        print_notes([f"accepted as --accept {name} says: {error}"])
