"""Read the logs of one real arm for the commands: files, joints, units and loads."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.arrays import Array
from tauguard.datasets.columns import ANGLES, AS_IS, Reading, column_map
from tauguard.datasets.log_checks import saturated
from tauguard.datasets.logs import Log, read_log
from tauguard.datasets.real_arms import is_torque, of_log, robot_numbers, unnamed
from tauguard.detectors import RobotNumbers
from tauguard.detectors.calibration.recording import Load, Recording, moves
from tauguard.detectors.features.free_bound import SHOWN_SECONDS, motion_seconds
from tauguard.detectors.features.motion_regimes import SEEN, unseen, unseen_text
from tauguard.findings import LogError
from tauguard.traces import Trace
from tauguard.traces.resample import averaged

#: Heaviest load that is accepted [kg]; a larger number probably means grams.
HEAVIEST = 100.0

#: Positions that are outside of a range by more than this are far from it [rad].
NEARBY = 0.5
#: Joints travel alike in two logs if their ranges differ by less than this factor.
ALIKE = 3.0


@dataclass(frozen=True)
class ArmLogs:
    """Logs of one arm, and the numbers of the robot that they were recorded on."""

    traces: dict[str, Trace]  #: by file name, joints in the robot's order
    numbers: RobotNumbers  #: the robot's numbers for the joints that the logs have
    notes: tuple[str, ...]  #: one line for each repair and each joint that is held fixed


def log_files(logs: Sequence[Path]) -> list[Path]:
    """The given files; a folder stands for all ``.csv`` and ``.mcap`` files below it.

    Raises:
        LogError: there are no files, or two have the same name.
    """
    files: list[Path] = []
    for path in logs:
        inside = sorted([*path.rglob("*.csv"), *path.rglob("*.mcap")]) if path.is_dir() else [path]
        if not inside:
            raise LogError(f"{path}: no .csv or .mcap files in it")
        files += inside
    names = [path.name for path in files]
    if not files:
        raise LogError("no logs: give .csv or .mcap files, or a folder of them")
    if len(set(names)) < len(names):
        raise LogError(f"logs: {', '.join(names)}; expected files of different names")
    return files


def read_one(
    log: Path,
    columns: str | None,
    torque: bool = False,
    reading: Reading | None = None,
    joints: Sequence[str] = (),
) -> Log:
    """Read one log, with joints in the file's order; each note begins with the file's name.

    Args:
        log: CSV or MCAP.
        columns: preset or JSON file of a column map.
        torque: whether the log's currents or efforts are joint torques [N m].
        reading: repairs and sample rate (default: the log unchanged).
        joints: the robot's joints, after which columns may be named.

    Raises:
        LogError: as :func:`~tauguard.datasets.logs.read_log`.
    """
    reading = reading or AS_IS
    read = read_log(log, column_map(columns), None, reading.mend, joints)
    if reading.resample != 0:
        read = reduced(read, reading.resample)
    trace, notes = read.trace, read.notes
    if torque:
        notes = tuple(n.replace("taken as current [A]", "joint torque [N m]") for n in notes)
        trace = dataclasses.replace(trace, meta={**trace.meta, "effort": "torque"})
    notes = tuple(f"{log.name}: {note}" for note in notes)
    return dataclasses.replace(read, trace=trace, notes=notes)


def reduced(log: Log, hz: float) -> Log:
    """Average the log down to ``hz`` samples per second, and note the delay.

    Raises:
        LogError: a rate above the log's own.
    """
    own = log.trace.dt
    try:
        trace = averaged(log.trace, hz)
    except ValueError as error:
        raise LogError(f"--resample {hz:g}: {error}") from None
    note = (
        f"{1 / own:.3g} Hz averaged down to {hz:g} Hz: alarms come {500 / hz - 500 * own:.3g} ms "
        f"later, and a contact of less than {1e3 / hz:.3g} ms looks weaker"
    )
    return dataclasses.replace(log, trace=trace, notes=(*log.notes, note))


def read_logs(
    logs: Sequence[Path],
    columns: str | None,
    robot: Path,
    torque: bool = False,
    reading: Reading | None = None,
) -> ArmLogs:
    """Read logs of one arm that show free motion, from which a detector or calibration learns.

    Args:
        logs: files or folders.
        columns: preset or JSON file of a column map.
        robot: URDF or MJCF file of the arm.
        torque: whether the logs hold joint torques [N m] in place of currents.
        reading: repairs and sample rate (default: the logs unchanged).

    Raises:
        LogError: labelled contacts, a saturated current, currents in one log and torques in
            another, joints that the robot does not have, or an error of :func:`read_one`.
    """
    files, reading = log_files(logs), reading or AS_IS
    numbers = robot_numbers(robot)
    joints = numbers.joint_names if columns in ("auto", None) else ()

    def one(path: Path, word: tuple[str, ...] = ()) -> Log:
        mended = dataclasses.replace(reading, mend=(*reading.mend, *word))
        return read_one(path, columns, torque, mended, joints)

    decided = columns != "auto" or not ANGLES.keys().isdisjoint(reading.mend)
    read = {path.name: one(path) for path in files} if decided else of_one_unit(files, one)
    for name, log in read.items():
        _refuse_touched(name, log)
    notes = _gathered(read)
    numbers, held = of_log(numbers, next(iter(read.values())).trace.joint_names, robot)
    held += linear_axes(numbers, read)
    traces = {name: matched(log.trace, numbers.joint_names) for name, log in read.items()}
    for name, trace in traces.items():
        _refuse_saturated(name, trace)
    if len({is_torque(trace) for trace in traces.values()}) > 1:
        raise LogError("some logs hold currents, others torques: give logs of one kind")
    return ArmLogs(traces, numbers, (*notes, *held))


def of_one_unit(files: Sequence[Path], one: Callable[..., Log]) -> dict[str, Log]:
    """Logs by file name, with the unit of angles that the others have where a log does not show it.

    Angles of small motions may be in degrees or radians. If another log of the same columns is in
    degrees, they are degrees.

    Args:
        files: logs whose columns are recognised.
        one: reads a log, also in the unit ``("deg",)`` or ``("rad",)``.

    Raises:
        LogError: a log whose angles fit those of the others as radians, but not as degrees.
    """
    read, doubts = {}, {}
    for path in files:
        try:
            read[path.name] = one(path)
        except ValueError as error:  # perhaps because the unit is open
            doubts[path.name] = error
    maps = {name: log.columns for name, log in read.items() if log.columns is not None}
    if len({found.q for found in maps.values()}) != 1:
        if doubts:
            raise next(iter(doubts.values()))
        return read
    degrees = {name: read[name] for name, found in maps.items() if found.degrees}
    radians = [name for name in maps if degrees and name not in degrees]
    for name in radians:
        _refuse_radians(name, read[name].trace.q, degrees)
    for path in files:
        if path.name in doubts or path.name in radians:
            read[path.name] = one(path, ("deg" if degrees else "rad",))
    return {path.name: read[path.name] for path in files}


def _refuse_radians(name: str, q: Array, degrees: Mapping[str, Log]) -> None:
    """Raise ``LogError`` if positions [rad] fit those of other logs, but not as degrees.

    They do not fit as degrees if at least two joints, and more than as radians, were where the
    other logs never are, or if half of the joints as radians travel as far as in the other logs.
    """
    others = [log.trace.q for log in degrees.values()]
    least, most = (np.array([f(x, axis=0) for x in others]) for f in (np.min, np.max))
    low, high = q.min(axis=0), q.max(axis=0)
    far_in = [
        int(((u * high < least.min(0) - NEARBY) | (u * low > most.max(0) + NEARBY)).sum())
        for u in (1.0, np.pi / 180)
    ]
    ratio = (high - low) / np.maximum((most - least).max(axis=0), 1e-9)
    alike = int(((ratio > 1 / ALIKE) & (ratio < ALIKE)).sum())
    if (far_in[1] >= 2 and far_in[0] < far_in[1]) or 2 * alike >= q.shape[1]:
        raise LogError(
            f"{name}: its positions are like those of {', '.join(degrees)} if they are radians, "
            f"but these are degrees, by their values: convert one of them, or say --mend deg or "
            "--mend rad for all"
        )


def linear_axes(numbers: RobotNumbers, read: Mapping[str, Log]) -> tuple[str, ...]:
    """A note on the units of linear axes; none for an arm without them.

    Args:
        numbers: the robot's numbers for the joints of the logs.
        read: logs by file name.

    Raises:
        LogError: the columns of these axes are read in degrees.
    """
    pairs = zip(numbers.joint_names, numbers.prismatic, strict=True)
    if not (linear := ", ".join(name for name, is_linear in pairs if is_linear)):
        return ()
    for name, log in read.items():
        if log.columns is not None and log.columns.degrees is True:
            raise LogError(
                f"{name}: {linear} is a linear axis, but is read in degrees as the others: "
                'give a column map in which "degrees" is a list, false for this axis [m]'
            )
    return (f"{linear}: linear, so its numbers are in m, m/s and N, not in rad, rad/s and N m",)


def _gathered(read: dict[str, Log]) -> list[str]:
    """The notes of all logs, each text once."""
    logs: dict[str, list[str]] = {}
    for name, log in read.items():
        for note in log.notes:
            logs.setdefault(note.removeprefix(f"{name}: "), []).append(name)
    out = []
    for note, names in logs.items():
        every = len(names) == len(read) > 1
        out.append(f"{'each log' if every else ', '.join(names)}: {note}")
    return out


def _refuse_touched(name: str, log: Log) -> None:
    if log.touched:
        begin = float(log.trace.t[0])
        times = ", ".join(f"{a - begin:.1f} to {b - begin:.1f} s" for a, b in log.touched[:3])
        raise LogError(
            f"{name}: a column labels {len(log.touched)} contact"
            f"{'' if len(log.touched) == 1 else 's'} ({times}"
            f"{', ...' if len(log.touched) > 3 else ''} after the beginning); expected free "
            "motion: leave this log out, or keep only its seconds without contact"
        )


def _refuse_saturated(log: str, trace: Trace) -> None:
    for joint, row, count, peak in saturated(trace):
        what, unit = ("torque", "N m") if is_torque(trace) else ("current", "A")
        raise LogError(
            f"{log}: the {what} of {joint} stays at {peak:g} {unit} for {count} samples, "
            f"{trace.t[row] - trace.t[0]:.2f} s after the beginning: saturated, so the torque is "
            "not known; leave this log out or cut it there"
        )


def matched(trace: Trace, names: tuple[str, ...]) -> Trace:
    """The trace with its joints in the robot's order.

    Raises:
        LogError: joints that do not match.
    """
    given = trace.joint_names
    if len(given) != len(names):
        raise LogError(
            f"the log has {len(given)} joints ({', '.join(given)}), "
            f"the robot {len(names)} ({', '.join(names)})"
        )
    if given == unnamed(len(given)) or given == names:
        return dataclasses.replace(trace, joint_names=names)
    if set(given) != set(names):
        raise LogError(f"the log's joints are {', '.join(given)}, the robot's {', '.join(names)}")
    order = [given.index(name) for name in names]
    moved: dict[str, Any] = {name: values[:, order] for name, values in trace.signals.items()}
    return dataclasses.replace(trace, joint_names=names, **moved)


def moving(traces: dict[str, Trace]) -> tuple[dict[str, Trace], list[str]]:
    """The logs in which some joint moves, and a note on each log without motion.

    If no joint moves in any log, all logs are returned; calibration then raises an error.
    """
    still = [name for name, trace in traces.items() if not moves(trace)]
    notes = [f"{name}: no joint moves in it; calibration leaves it out" for name in still]
    return {n: t for n, t in traces.items() if n not in still} or traces, notes


def log_named(name: str, flag: str, logs: Sequence[str]) -> str:
    """The log whose file name, with or without extension, is ``name``; errors name ``flag``.

    Raises:
        LogError: no log or several logs have this name.
    """
    found = [log for log in logs if name == log] or [log for log in logs if name == Path(log).stem]
    if len(found) != 1:
        there = f"two are called {name!r}" if found else f"no log {name!r}"
        raise LogError(f"{flag}: {there}; expected one of {', '.join(logs)}")
    return found[0]


def with_loads(traces: dict[str, Trace], payload: Sequence[str]) -> list[Recording]:
    """Give each trace its load.

    Args:
        traces: traces by file name.
        payload: one of LOG=KG, LOG=KG,X,Y,Z and LOG=unknown per log; other logs have no load.

    Raises:
        LogError: a payload that cannot be read or belongs to no log.
    """
    loads: dict[str, Load | None] = {}
    for text in payload:
        name, _, value = text.rpartition("=")
        log = log_named(name, f"--payload {text}", list(traces))
        form = "LOG=KG, LOG=KG,X,Y,Z or LOG=unknown"
        loads[log] = None if value == "unknown" else _load(text, value, form)
    return [Recording(trace, loads.get(name, Load())) for name, trace in traces.items()]


def parse_load(text: str) -> Load:
    """The load in ``--payload KG`` or ``--payload KG,X,Y,Z``.

    Raises:
        LogError: the text has another form.
    """
    if text == "unknown":
        raise LogError("--payload unknown: for an unknown load, do not give this flag")
    return _load(text, text, "KG or KG,X,Y,Z, 0 for nothing")


def _load(text: str, value: str, form: str) -> Load:
    try:
        parts = [float(v) for v in value.split(",")]
    except ValueError:
        parts = []
    if len(parts) not in (1, 4):
        raise LogError(f"--payload {text}: expected {form}")
    if parts[0] > HEAVIEST:
        raise LogError(
            f"--payload {text}: {parts[0]:g} kg, expected at most {HEAVIEST:g}; "
            "loads are given in kg"
        )
    centre = (parts[1], parts[2], parts[3]) if len(parts) == 4 else None
    return Load(parts[0], centre)


def not_shown(traces: Sequence[Trace]) -> list[str]:
    """Notes on joints that hardly move in any log, and on kinds of motion that no log shows."""
    seconds = motion_seconds([Recording(trace) for trace in traces])
    names = traces[0].joint_names
    still = [name for name, s in zip(names, seconds, strict=True) if s < SHOWN_SECONDS]
    notes = []
    if still:
        notes.append(
            f"{', '.join(still)}: moves in none of the logs, so its friction is not known. No "
            "collision is detected while it moves, and none of moving joints while it stands "
            "elsewhere; its bound at rest is assumed; add a log in which it moves"
        )
    if lacking := unseen(traces):
        notes.append(f"the logs show less than {SEEN:g} s of {unseen_text(lacking, len(names))}")
    return notes
