"""Read logs of one arm: files or arrays, joints, units and loads."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tauguard.arrays import Array
from tauguard.datasets.columns import ANGLES, ColumnMap, changed_fields, column_map
from tauguard.datasets.log_checks import saturated
from tauguard.datasets.log_table import Options
from tauguard.datasets.logs import read_source
from tauguard.detectors import RobotNumbers
from tauguard.detectors.calibration.joints import (
    is_torque,
    linear_axes,
    matched,
    of_log,
    robot_numbers,
)
from tauguard.findings import (
    ArgumentError,
    Finding,
    Findings,
    LogError,
    cause,
    note,
    raise_errors,
)
from tauguard.traces.loads import LoadLike, load_of, loads_of
from tauguard.traces.logs import Log, Logs
from tauguard.traces.resample import averaged
from tauguard.traces.trace import Trace
from tauguard.untrusted_input import check_no_device

if TYPE_CHECKING:
    from tauguard.detectors.detector import Detector

#: A column map, the name of a preset, "auto", or the path of a map's JSON file.
Columns = ColumnMap | str | Path | None

#: Positions that are outside of a range by more than this are far from it [rad].
NEARBY = 0.5
#: Joints travel alike in two logs if their ranges differ by less than this factor.
ALIKE = 3.0


def read_log(
    source: Any,
    columns: Columns = None,
    *,
    robot: str | Path | Detector | None = None,
    joint_names: Sequence[str] | None = None,
    payload: LoadLike = 0.0,
    torque: bool = False,
    mend: str | Collection[str] = (),
    resample: float = 0.0,
    name: str = "log",
) -> Log:
    """Read a log of a real arm, which may show contacts.

    Args:
        source: a ``.csv`` file, or an ``.mcap`` file: one written by tauguard, or one of a ROS 2
            system with ``JointState`` messages, whose ``effort`` is taken as current [A]. Or a
            DataFrame with the columns of a CSV file, or one of ``Log.to_frame``; a dictionary of
            arrays "t" and, if the log labels contacts, "contact", (T,), and "q", "qd", "current" or
            "torque", "q_des", "qd_des", "qdd_des", (T, n), all in SI units but for ``mend``; a
            :class:`~tauguard.traces.Trace`.
        columns: columns of a CSV file: a :class:`ColumnMap`, the path of a JSON file with its
            fields, the name of a preset (see ``PRESETS``), or "auto" to recognise columns by names
            and values. By default the header line must be that of a preset.
        robot: URDF or MJCF file of the arm, a name in ``models.ROBOTS``, or a detector of the arm.
            With ``columns="auto"`` it finds columns that are named after its joints.
        joint_names: names of the joints in the order of the columns (default: the map's names, the
            messages' names, or joint_1, joint_2, ...). For MCAP they also select the joints.
        payload: the load that the arm carried, see :data:`LoadLike`.
        torque: currents or efforts of the source are joint torques [N m].
        mend: units and repairs of a CSV file, see :meth:`ColumnMap.mended`.
        resample: average the log down to this rate [Hz]; 0: unchanged.
        name: name of a log that is not a file.

    Returns:
        The log with its joints in the file's order. The text of each finding begins with the log's
        name. Only faults that ``mend`` names, or the column map's ``repair``, are repaired.

    Raises:
        LogError: a missing column, a bad number, a cut-off row, time that does not increase, a
            gap, angles in degrees, or velocities that do not fit the positions. The message names
            log, row or line, and what would work.
        ArgumentError: the robot file or another argument cannot be used.
        OSError: the file is missing or cannot be read.
    """
    from tauguard.models.robot import bodies_file

    if isinstance(source, str | Path):
        check_no_device(source)
    file, numbers = None, None
    if isinstance(robot, str | Path):
        file = bodies_file(Path(robot))
        numbers = robot_numbers(file)
    elif robot is not None:
        numbers = robot.arm.robot
    options = _options(columns, mend, torque, numbers, joint_names)
    log = _read(source, name, options, resample)
    return dataclasses.replace(log, load=load_of(payload), robot=file, numbers=numbers)


def read_logs(
    logs: str | Path | Sequence[str | Path] | Mapping[str, Any],
    columns: Columns = None,
    *,
    robot: str | Path | None = None,
    arm: str | None = None,
    payload: Mapping[str, LoadLike] | None = None,
    torque: bool = False,
    mend: str | Collection[str] = (),
    resample: float = 0.0,
) -> Logs:
    """Read logs of one arm: free motion of a real arm, or labelled recordings of a simulated one.

    Args:
        logs: files, or folders that hold them; names of files differ. Or sources of
            :func:`read_log` by the name of the log. Without ``robot``, a folder of labelled MCAP
            recordings, or a dataset, whose first split is read.
        columns: as for :func:`read_log`.
        robot: URDF or MJCF file of the arm, or a name in ``models.ROBOTS``. The logs then have to
            show free motion. Without it, the arm is attached to the recordings.
        arm: without ``robot``, in a dataset with several arms, the one whose episodes are read.
        payload: loads that were carried, by the log's name, with or without its extension; other
            logs have no load.
        torque: the logs hold joint torques [N m] in place of currents.
        mend: units and repairs of CSV files, see :meth:`ColumnMap.mended`.
        resample: average the logs down to this rate [Hz]; 0: unchanged.

    Returns:
        The logs by name, with joints in the robot's order.

    Raises:
        LogError: labelled contacts, a saturated current, currents in one log and torques in
            another, or an error of :func:`read_log`; with a finding for each log.
        MismatchError: joints that the robot does not have.
        ArgumentError: a payload of no log, or another argument that cannot be used.
        FileError: without ``robot``, no recordings, or one without truth.
        OSError: a file is missing or cannot be read.
    """
    from tauguard.models.robot import bodies_file

    if robot is None:
        return _of_simulated_arm(logs, arm)
    file, sources = bodies_file(Path(robot)), _sources(logs)
    numbers = robot_numbers(file)
    options = _options(columns, mend, torque, numbers)

    def one(name: str, word: tuple[str, ...] = ()) -> Log:
        words = dataclasses.replace(options, mend=(*options.mend, *word))
        return _read(sources[name], name, words, resample)

    decided = options.columns != "auto" or not ANGLES.keys().isdisjoint(options.mend)
    read = _each(sources, one) if decided else of_one_unit(sources, one)
    _refuse(touch for log in read.values() for touch in _labelled_contacts(log))
    numbers, findings = of_log(numbers, next(iter(read.values())).trace.joint_names, file)
    notes = _gathered({name: log.findings for name, log in read.items()}, len(read))
    findings = Findings([*notes, *findings, *linear_axes(numbers, read)])
    traces = {name: matched(log.trace, numbers.joint_names) for name, log in read.items()}
    _refuse(peak for name, trace in traces.items() for peak in _saturated(name, trace))
    if len({is_torque(trace) for trace in traces.values()}) > 1:
        text = "some logs hold currents, others torques: give logs of one kind"
        raise LogError(cause("torques", text, *traces))
    loads = loads_of(payload or {}, list(traces))
    whole = {
        name: dataclasses.replace(
            log, trace=traces[name], load=loads[name], robot=file, numbers=numbers
        )
        for name, log in read.items()
    }
    return Logs(whole, file, numbers, findings)


def simulated(traces: Iterable[Trace]) -> Logs:
    """Recordings of a simulated arm, which is attached to each trace, as logs of an unknown load.

    Args:
        traces: of one arm, as from ``envs.simulate`` or ``datasets.read``. The name of a log is
            its file or episode in ``meta``, or its number.

    Raises:
        ArgumentError: no traces, or traces of different joints.
    """
    logs: dict[str, Log] = {}
    for number, trace in enumerate(traces):
        name = trace.meta.get("log") or trace.meta.get("episode") or str(number)
        name = f"{name} ({number})" if name in logs else name
        logs[name] = Log(trace, None, name, as_read="simulated")
    return Logs(logs)


# -- sources ---------------------------------------------------------------------------------------


def _of_simulated_arm(logs: Any, arm: str | None) -> Logs:
    from tauguard.datasets.recordings import labelled

    if isinstance(logs, Mapping):
        raise ArgumentError("`robot=` is missing: the URDF or MJCF file of the arm")
    paths = [Path(log) for log in ([logs] if isinstance(logs, str | Path) else logs)]
    return simulated(trace for path in paths for trace in labelled(path, arm))


def _sources(logs: Any) -> dict[str, Any]:
    """Sources by the name of their log."""
    if isinstance(logs, Mapping):
        return dict(logs)
    files = log_files([Path(log) for log in ([logs] if isinstance(logs, str | Path) else logs)])
    return {path.name: path for path in files}


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


def _options(
    columns: Columns,
    mend: str | Collection[str],
    torque: bool,
    numbers: RobotNumbers | None,
    joint_names: Sequence[str] | None = None,
) -> Options:
    """Checked options of a log's table."""
    words = (mend,) if isinstance(mend, str) else tuple(mend)
    for word in words:
        changed_fields(word)
    joints = numbers.joint_names if numbers is not None and columns in ("auto", None) else ()
    return Options(column_map(columns), joint_names, words, torque, joints)


def _read(source: Any, name: str, options: Options, resample: float) -> Log:
    """A log with its joints in the file's order; each finding begins with the log's name."""
    log = read_source(source, name, options)
    if resample != 0:
        log = reduced(log, resample)
    findings = (
        dataclasses.replace(
            finding, text=f"{log.name}: {finding.text}", where=(log.name, *finding.where)
        )
        for finding in log.findings
    )
    return dataclasses.replace(log, findings=Findings(findings))


def reduced(log: Log, hz: float) -> Log:
    """Average the log down to ``hz`` samples per second, and note the delay.

    Raises:
        LogError: a rate above the log's own.
    """
    own = log.trace.dt
    try:
        trace = averaged(log.trace, hz)
    except ArgumentError as error:
        raise LogError(cause("resample", f"`resample={hz:g}`: {error}")) from None
    text = (
        f"{1 / own:.3g} Hz averaged down to {hz:g} Hz: alarms come {500 / hz - 500 * own:.3g} ms "
        f"later, and a contact of less than {1e3 / hz:.3g} ms looks weaker"
    )
    findings = Findings([*log.findings, note("resampled", text)])
    return dataclasses.replace(log, trace=trace, findings=findings)


def _each(sources: Mapping[str, Any], one: Callable[[str], Log]) -> dict[str, Log]:
    """Logs by name; a ``LogError`` has the findings of all logs that cannot be read."""
    read, errors = {}, {}
    for name in sources:
        try:
            read[name] = one(name)
        except LogError as error:
            errors[_called(name, sources)] = error.findings
    _refuse(_gathered(errors, len(sources)))
    return read


def _called(name: str, sources: Mapping[str, Any]) -> str:
    """How errors call a log: the path of a file, else the name."""
    return str(sources[name]) if isinstance(sources[name], str | Path) else name


def of_one_unit(sources: Mapping[str, Any], one: Callable[..., Log]) -> dict[str, Log]:
    """Logs by name, with the unit of angles that the others have where a log does not show it.

    Angles of small motions may be in degrees or radians. If another log of the same columns is in
    degrees, they are degrees.

    Args:
        sources: logs whose columns are recognised, by name.
        one: reads the log of a name, also in the unit ``("deg",)`` or ``("rad",)``.

    Raises:
        LogError: a log whose angles fit those of the others as radians, but not as degrees.
    """
    read, doubts = {}, {}
    for name in sources:
        try:
            read[name] = one(name)
        except LogError as error:  # perhaps because the unit is open
            doubts[name] = error.findings
    maps = {name: log.columns for name, log in read.items() if log.columns is not None}
    if len({columns.q for columns in maps.values()}) != 1:
        errors = {_called(name, sources): findings for name, findings in doubts.items()}
        _refuse(_gathered(errors, len(sources)))
        return read
    degrees = {name: read[name] for name, columns in maps.items() if columns.degrees}
    radians = [name for name in maps if degrees and name not in degrees]
    _refuse(f for name in radians for f in _in_radians(name, read[name].trace.q, degrees))
    unit = ("deg" if degrees else "rad",)
    again = {name: sources[name] for name in sources if name in doubts or name in radians}
    read |= _each(again, lambda name: one(name, unit))
    return {name: read[name] for name in sources}


def _refuse(findings: Iterable[Finding]) -> None:
    """Raise ``LogError`` with all findings, if one of them is an error."""
    raise_errors(LogError, findings)


# -- checks of logs of free motion -----------------------------------------------------------------


def _in_radians(name: str, q: Array, degrees: Mapping[str, Log]) -> list[Finding]:
    """An error if positions [rad] fit those of other logs, but not as degrees.

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
    if not ((far_in[1] >= 2 and far_in[0] < far_in[1]) or 2 * alike >= q.shape[1]):
        return []
    text = (
        f"{name}: its positions are like those of {', '.join(degrees)} if they are radians, "
        'but these are degrees, by their values: convert one of them, or say `mend="deg"` or '
        '`mend="rad"` for all'
    )
    return [cause("units", text, name)]


def _gathered(findings: Mapping[str, Findings], count: int) -> list[Finding]:
    """Findings by the name of their log, of ``count`` logs in all, as a list with each text once.

    The text of a finding begins with the name.
    """
    logs: dict[Finding, list[str]] = {}
    for name, doubts in findings.items():
        for finding in doubts:
            text, short = finding.text.removeprefix(f"{name}: "), Path(name).name
            where = tuple(part for part in finding.where if part != short)
            shared = dataclasses.replace(finding, text=text, where=where)
            logs.setdefault(shared, []).append(name)
    gathered = []
    for finding, names in logs.items():
        which = "each log" if len(names) == count > 1 else ", ".join(names)
        where = (*(Path(name).name for name in names), *finding.where)
        gathered.append(dataclasses.replace(finding, text=f"{which}: {finding.text}", where=where))
    return gathered


def _labelled_contacts(log: Log) -> list[Finding]:
    if not log.labels:
        return []
    begin = float(log.trace.t[0])
    times = ", ".join(f"{a - begin:.1f} to {b - begin:.1f} s" for a, b in log.labels[:3])
    text = (
        f"{log.name}: a column labels {len(log.labels)} contact"
        f"{'' if len(log.labels) == 1 else 's'} ({times}"
        f"{', ...' if len(log.labels) > 3 else ''} after the beginning); expected free "
        "motion: leave this log out, or keep only its seconds without contact"
    )
    return [cause("labelled-contact", text, log.name)]


def _saturated(log: str, trace: Trace) -> list[Finding]:
    what, unit = ("torque", "N m") if is_torque(trace) else ("current", "A")
    return [
        cause(
            "saturated",
            f"{log}: the {what} of {joint} stays at {peak:g} {unit} for {count} samples, "
            f"{trace.t[row] - trace.t[0]:.2f} s after the beginning: saturated, so the torque is "
            "not known; leave this log out or cut it there",
            log,
            joint,
        )
        for joint, row, count, peak in saturated(trace)
    ]
