"""Reading logs of a real arm for the commands, with every repair said aloud."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tauguard.detectors import RobotNumbers
    from tauguard.traces import Trace


def robot_numbers(robot: Path) -> RobotNumbers:
    """The numbers of a robot file."""
    from tauguard.detectors import RobotNumbers
    from tauguard.models import pin_model

    return RobotNumbers.from_pin(pin_model(robot))


def log_files(logs: Sequence[Path]) -> list[Path]:
    """Files as they are, folders as the logs in them.

    Raises:
        ValueError: none, or two of one name.
    """
    files: list[Path] = []
    for path in logs:
        inside = sorted([*path.glob("*.csv"), *path.glob("*.mcap")]) if path.is_dir() else [path]
        if not inside:
            raise ValueError(f"{path}: no .csv or .mcap files in it")
        files += inside
    names = [path.name for path in files]
    if not files or len(set(names)) < len(names):
        raise ValueError(f"logs: {', '.join(names) or 'none'}; expected files of different names")
    return files


def read_logs(logs: Sequence[Path], columns: str | None, robot: RobotNumbers) -> dict[str, Trace]:
    """Traces by file name, joints in the robot's order; prints a line for each repair."""
    from tauguard.cli.detect import column_map, matched
    from tauguard.datasets import read_log
    from tauguard.datasets.log_checks import saturated

    chosen = column_map(columns)
    traces = {}
    for path in log_files(logs):
        read = read_log(path, chosen)
        for note in read.notes:
            print(f"note: {path.name}: {note}")
        for name, row, count, peak in saturated(read.trace):
            raise ValueError(
                f"{path}: the current of {name} stays at {peak:g} A for {count} samples, "
                f"{read.trace.t[row] - read.trace.t[0]:.2f} s after the beginning: saturated, "
                "which says nothing of the torque; leave this log out or cut it there"
            )
        traces[path.name] = matched(read.trace, robot.joint_names)
    return traces
