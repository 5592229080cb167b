"""What the commands for real arms share: logs, their joints, loads and gains, and what was said."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tauguard.datasets import ColumnMap
    from tauguard.detectors import ArmModel, RobotNumbers
    from tauguard.detectors.calibration.recording import Load, Recording
    from tauguard.traces import Trace

#: A log that begins later than this is stamped by a clock [s].
CLOCK = 1e6
#: No load of an arm is heavier than this [kg]: it would be grams.
HEAVIEST = 100.0


def robot_numbers(robot: Path, given: tuple[str, ...] | None = None) -> RobotNumbers:
    """The numbers of a robot file, joints that a log lacks held fixed at zero, and said so.

    Args:
        robot: URDF or MJCF.
        given: joints of the log, in any order, or ``joint_1``, ... (default: all of the robot's).

    Raises:
        ValueError: joints that the robot does not have.
    """
    from tauguard.detectors import RobotNumbers
    from tauguard.detectors.calibration.held_joints import holding
    from tauguard.models import pin_model

    numbers = RobotNumbers.from_pin(pin_model(robot))
    names = numbers.joint_names
    if given is None or len(given) >= len(names):
        return numbers
    kept = names[: len(given)] if given == unnamed(len(given)) else given
    if not set(kept) <= set(names):
        raise ValueError(f"the log's joints are {', '.join(given)}, the robot's {', '.join(names)}")
    lacking = [name for name in names if name not in kept]
    print(f"note: the log lacks {', '.join(lacking)} of {robot.name}: held fixed at 0")
    return holding(numbers, lacking)


def unnamed(count: int) -> tuple[str, ...]:
    """What joints are called that have no name: ``joint_1``, ..."""
    return tuple(f"joint_{i}" for i in range(1, count + 1))


# -- logs -----------------------------------------------------------------------------------------


def column_map(columns: str | None) -> ColumnMap | str | None:
    """A preset's name as it is; a map from a JSON file."""
    from tauguard.datasets.columns import column_map as read

    return read(columns)


def read_one(log: Path, columns: str | None, torque: bool = False) -> Trace:
    """One log, joints as they are in it; prints a line for each repair.

    Args:
        log: CSV or MCAP.
        columns: preset or JSON file.
        torque: whether its currents, or efforts, are joint torques [N m].
    """
    from tauguard.datasets import read_log

    read = read_log(log, column_map(columns))
    for note in read.notes:
        said = note.replace("taken as current [A]", "joint torque [N m]") if torque else note
        print(f"note: {log.name}: {said}")
    if not torque:
        return read.trace
    return dataclasses.replace(read.trace, meta={**read.trace.meta, "effort": "torque"})


def is_torque(trace: Trace) -> bool:
    """Whether a log holds joint torques instead of currents."""
    return trace.meta.get("effort") == "torque"


def matched(trace: Trace, names: tuple[str, ...]) -> Trace:
    """The trace with the robot's joints in the robot's order.

    Raises:
        ValueError: joints that do not match.
    """
    given = trace.joint_names
    if len(given) != len(names):
        raise ValueError(
            f"the log has {len(given)} joints ({', '.join(given)}), "
            f"the robot {len(names)} ({', '.join(names)})"
        )
    if given == unnamed(len(given)) or given == names:
        return dataclasses.replace(trace, joint_names=names)
    if set(given) != set(names):
        raise ValueError(f"the log's joints are {', '.join(given)}, the robot's {', '.join(names)}")
    order = [given.index(name) for name in names]
    tables = ("q", "qd", "current", "q_des", "qd_des", "qdd_des")
    moved: dict[str, Any] = {
        name: getattr(trace, name)[:, order] for name in tables if getattr(trace, name) is not None
    }
    return dataclasses.replace(trace, joint_names=names, **moved)


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
    if not files:
        raise ValueError("no logs: give .csv or .mcap files, or a folder of them")
    if len(set(names)) < len(names):
        raise ValueError(f"logs: {', '.join(names)}; expected files of different names")
    return files


def read_logs(
    logs: Sequence[Path], columns: str | None, robot: Path, torque: bool = False
) -> tuple[dict[str, Trace], RobotNumbers]:
    """Traces to learn from, by file name, and the robot's numbers for the joints in them.

    Raises:
        ValueError: a current that is saturated, logs with currents beside logs with torques,
            besides what reading raises.
    """
    from tauguard.datasets.log_checks import saturated

    traces = {path.name: read_one(path, columns, torque) for path in log_files(logs)}
    numbers = robot_numbers(robot, next(iter(traces.values())).joint_names)
    traces = {name: matched(trace, numbers.joint_names) for name, trace in traces.items()}
    for log, trace in traces.items():
        for name, row, count, peak in saturated(trace):
            what, unit = ("torque", "N m") if is_torque(trace) else ("current", "A")
            raise ValueError(
                f"{log}: the {what} of {name} stays at {peak:g} {unit} for {count} samples, "
                f"{trace.t[row] - trace.t[0]:.2f} s after the beginning: saturated, "
                "which says nothing of the torque; leave this log out or cut it there"
            )
    if len({is_torque(trace) for trace in traces.values()}) > 1:
        raise ValueError("some logs hold currents, others torques: give those of one kind")
    return traces, numbers


def moving(traces: dict[str, Trace]) -> dict[str, Trace]:
    """The logs in which some joint moves; prints a note on each of the others."""
    from tauguard.detectors.calibration.recording import moves

    for name, trace in traces.items():
        if not moves(trace):
            print(f"note: {name}: no joint moves in it; calibration leaves it out")
    return {name: trace for name, trace in traces.items() if moves(trace)} or traces


def printed_from(begin: float) -> float:
    """What is taken from printed times of a log that begins at ``begin`` [s].

    0, unless a clock stamped the log, as ROS does. Files keep the log's own times.
    """
    return begin if begin > CLOCK else 0.0


# -- loads and gains ------------------------------------------------------------------------------


def loaded(traces: dict[str, Trace], payload: tuple[str, ...]) -> list[Recording]:
    """Traces with their loads, each given as LOG=KG, LOG=KG,X,Y,Z or LOG=unknown.

    Raises:
        ValueError: a payload that cannot be read or belongs to no log.
    """
    from tauguard.detectors.calibration.recording import Load, Recording

    loads: dict[str, Load | None] = {}
    for text in payload:
        name, _, value = text.rpartition("=")
        loads[log_named(name, f"--payload {text}", list(traces))] = _load(text, value)
    return [Recording(trace, loads.get(name, Load())) for name, trace in traces.items()]


def log_named(name: str, flag: str, logs: list[str]) -> str:
    """The log of this file name, or of this name without its ending, that a flag names."""
    found = [log for log in logs if name == log] or [log for log in logs if name == Path(log).stem]
    if len(found) != 1:
        there = f"two are called {name!r}" if found else f"no log {name!r}"
        raise ValueError(f"{flag}: {there}; there are {', '.join(logs)}")
    return found[0]


def _load(text: str, value: str, form: str = "LOG=KG, LOG=KG,X,Y,Z or LOG=unknown") -> Load | None:
    from tauguard.detectors.calibration.recording import Load

    if value == "unknown":
        return None
    try:
        parts = [float(v) for v in value.split(",")]
    except ValueError:
        parts = []
    if len(parts) not in (1, 4):
        raise ValueError(f"--payload {text}: expected {form}")
    if parts[0] > HEAVIEST:
        raise ValueError(
            f"--payload {text}: {parts[0]:g} kg, expected at most {HEAVIEST:g}; "
            "loads are given in kg"
        )
    centre = (parts[1], parts[2], parts[3]) if len(parts) == 4 else None
    return Load(parts[0], centre)


def carried(text: str) -> Load:
    """A load given to ``detect``.

    Raises:
        ValueError: not KG or KG,X,Y,Z.
    """
    load = _load(text, text, "KG or KG,X,Y,Z, 0 for nothing")
    if load is None:
        raise ValueError("--payload unknown: leave it out instead")
    return load


def doubts(
    arm: ArmModel, traces: dict[str, Trace], recordings: list[Recording], held: Sequence[Any]
) -> list[str]:
    """Notes on what a calibration leaves unexplained, and on a log that may have carried something.

    Args:
        arm: identified.
        traces: by file name.
        recordings: the same traces with what is known of their loads.
        held: held-out residual of each [N m], (n,) each; empty: not known.

    Raises:
        ValueError: so much is left that the logs cannot be the arm's as given.
    """
    from tauguard.detectors.calibration.assessment import (
        OUTLYING,
        OUTLYING_IN_DOUBT,
        explained,
        outlier,
    )
    from tauguard.detectors.calibration.recording import Load, moves

    bare = [k for k, r in enumerate(recordings) if r.load == Load() and moves(r.trace)]
    names, refused = list(traces), ""
    notes: tuple[str, ...] = ()
    try:
        notes = explained(arm, [recordings[k].trace for k in bare])
    except ValueError as error:
        refused = str(error)
    doubtful = bool(notes or refused)
    least = OUTLYING_IN_DOUBT if doubtful else OUTLYING
    asked = []
    found = outlier([held[k] for k in bare], least) if len(held) else None
    if found is not None:
        log = names[bare[found[0]]]
        asked.append(
            f"{log} is {found[1]:.1f} times as far from what the other logs predict as they are: "
            f"did {log} carry something (tell it with --payload {log}=KG or =unknown), or did "
            "something touch the arm (leave the log out)?"
        )
    given = [
        f"{r.load.mass:g} kg in {n}"
        for n, r in zip(names, recordings, strict=True)
        if r.load is not None and r.load.mass > 0
    ]
    if given and doubtful:
        asked.append(f"loads given: {', '.join(given)}; are these right, and in kg?")
    if refused:
        raise ValueError("; ".join([refused, *asked]))
    return [*notes, *asked]


def start(
    numbers: RobotNumbers,
    recordings: list[Recording],
    columns: str | None,
    gains: tuple[float, ...],
    scale: str,
) -> tuple[ArmModel, str]:
    """The arm to begin with, and what fixes the scale: "gains", "preset", "payload" or "masses".

    Raises:
        ValueError: not one gain a joint, or logs of different presets.
    """
    import numpy as np

    from tauguard.datasets.drives import preset_drive
    from tauguard.detectors import ArmModel
    from tauguard.detectors.calibration.assessment import start_gains

    if is_torque(recordings[0].trace):
        if gains:
            raise ValueError("--gains: the logs hold joint torques, which need none")
        return ArmModel(numbers, np.ones(numbers.joints)), "torques"
    preset = None if gains else preset_drive(columns, [r.trace for r in recordings])
    known = any(r.load is not None and r.load.mass > 0 for r in recordings)
    if scale == "auto":
        otherwise = "payload" if known else "masses"
        scale = "gains" if gains or (preset and not known) else otherwise
    if preset is not None:
        gains = preset[1].gain
        scale = "preset" if scale == "gains" else scale
    if gains and len(gains) != numbers.joints:
        raise ValueError(f"--gains: {len(gains)} numbers for {numbers.joints} joints")
    if not gains and scale == "gains":
        raise ValueError(f"--gains: give {numbers.joints} numbers, N m of torque per ampere")
    begin = np.array(gains) if gains else start_gains(numbers, [r.trace for r in recordings])
    return ArmModel(numbers, begin), scale


def watched_arm(
    robot: Path,
    columns: str | None,
    gains: tuple[float, ...],
    viscous: tuple[float, ...],
    coulomb: tuple[float, ...],
    trace: Trace,
    numbers: RobotNumbers,
) -> tuple[ArmModel, str]:
    """The arm of a log that no model is given for, and where its gains and friction come from.

    Raises:
        ValueError: no gains, not one a joint, or some beside those of a calibrated robot file.
    """
    import numpy as np

    from tauguard.datasets.drives import REVERSAL, DriveNumbers, preset_drive
    from tauguard.detectors import ArmModel, FrictionModel
    from tauguard.detectors.calibration.arm_file import load_arm

    calibrated = load_arm(robot)
    if calibrated is not None:
        if gains or viscous or coulomb:
            raise ValueError(
                f"{robot.name} is calibrated and brings its own gains and friction: leave out "
                "--gains, --viscous and --coulomb, or give the robot's own file"
            )
        return calibrated, f"the calibration in {robot.name}"
    if not gains:
        from tauguard.cli.robot_files import check_named

        check_named(robot, columns, [trace])
    source = "the flags"
    if is_torque(trace) and not gains:
        gains, source = (1.0,) * numbers.joints, "the log's torques"
    preset = None if gains else preset_drive(columns, [trace])
    if not gains and preset is None:
        raise ValueError(f"--gains: give {numbers.joints} numbers, N m of joint torque per ampere")
    if preset is not None:
        name, known = preset
        gains, source = known.gain, f"the preset {name}"
        viscous, coulomb = viscous or known.viscous, coulomb or known.coulomb
    if len(gains) != numbers.joints:
        raise ValueError(f"--gains: {len(gains)} numbers for {numbers.joints} joints")
    drive = DriveNumbers(gains, viscous, coulomb)
    coulomb, viscous = (x or (0.0,) * numbers.joints for x in (drive.coulomb, drive.viscous))
    friction = FrictionModel.coulomb_viscous(coulomb, viscous, width=REVERSAL)
    return ArmModel(numbers, np.array(drive.gain), friction), source
