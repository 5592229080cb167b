"""Collision-free logs as `tauguard calibrate` and `tauguard twin` take them."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tauguard.datasets.columns import Reading
    from tauguard.detectors import ArmModel, RobotNumbers
    from tauguard.detectors.calibration.recording import Recording
    from tauguard.traces import Trace


@dataclass(frozen=True)
class FreeLogs:
    """Logs in which some joint moves, and the arm that an identification begins with."""

    numbers: RobotNumbers  #: of the robot file
    all_traces: dict[str, Trace]  #: those in which no joint moves, too
    traces: dict[str, Trace]  #: by file name
    recordings: list[Recording]  #: the same with their loads
    arm: ArmModel
    source: str  #: what fixes the scale of the torques, in words for the user
    scale: str  #: the same as :func:`tauguard.detectors.calibration.identification.identify` has it


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
    """Read, check and note; the arguments are the commands'.

    Raises:
        ValueError: what does not fit, as each part says it.
    """
    from tauguard.cli.help_text import print_notes
    from tauguard.datasets.arm_logs import moving, read_logs, with_loads
    from tauguard.datasets.real_arms import check_named, initial_arm
    from tauguard.detectors.calibration.checks import check_signs

    read = read_logs(logs, columns, robot, torque, reading)
    print_notes(read.notes)
    known = dict(zip(read.traces, with_loads(read.traces, payload), strict=True))
    traces, notes = moving(read.traces)
    print_notes(notes)
    recordings = [known[name] for name in traces]
    if not gains:
        check_named(robot, columns, list(traces.values()))
    arm, source = initial_arm(read.numbers, recordings, columns, gains, scale)
    for name, trace in traces.items():
        check_signs(arm, name, trace)
    chosen = "gains" if source in ("preset", "torques") else source
    return FreeLogs(read.numbers, read.traces, traces, recordings, arm, source, chosen)


#: Checks that ``--accept`` may pass over.
ACCEPTABLE = ("alarms", "error", "gravity")


def hold_to(name: str, accept: Collection[str], check: Callable[[], None]) -> None:
    """Run a check that the user may pass over by ``--accept NAME``; a note then says what is wrong.

    Raises:
        ValueError: what the check raises, and the flag.
    """
    from tauguard.cli.help_text import print_notes

    try:
        check()
    except ValueError as error:
        if name not in accept:
            raise ValueError(f"{error}; if that is to be, say --accept {name}") from None
        print_notes([f"accepted as --accept {name} says: {error}"])
