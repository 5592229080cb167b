"""From a table of a log, whose columns have names or numbers, to its signals in SI units."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from textwrap import shorten
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.datasets.columns import (
    ANGLES,
    PRESETS,
    Column,
    ColumnMap,
    preset_of,
    presets_of,
    presets_of_width,
)
from tauguard.datasets.log_checks import (
    checked,
    fresh,
    increasing,
    labelled,
    refuse_set_back,
    unwrapped,
)
from tauguard.datasets.recognition import described, in_units_of, lacking, recognised
from tauguard.findings import Finding, LogError, cause, note
from tauguard.traces.logs import Log
from tauguard.traces.trace import Trace

#: Number of rows at a table's beginning from which units are recognised.
LOOKED_AT = 5000


@dataclass(frozen=True)
class Table:
    """A table whose columns have no meaning yet."""

    rows: list[tuple[int, Sequence[Any]]]  #: number of each row, and its cells; perhaps a header
    word: str = "line"  #: what the numbers count, for messages
    form: dict[str, str] = field(default_factory=dict)  #: separator and decimal mark of a file


@dataclass(frozen=True)
class Options:
    """What is known of a log's table; the fields are arguments of ``tauguard.read_log``."""

    columns: ColumnMap | str | None = None
    joint_names: Sequence[str] | None = None
    mend: Collection[str] = ()
    torque: bool = False
    robot_joints: Sequence[str] = ()  #: joints of the robot, after which columns may be named


def log_of(table: Table, name: str, options: Options) -> Log:
    """The log in a table; ``meta["columns"]`` of its trace is the preset, if there is one.

    Raises:
        LogError: as ``tauguard.read_log``; rows are counted as in the table.
    """
    columns, auto = options.columns, options.columns == "auto"
    read_as = chosen(columns, table, options.mend, options.robot_joints).mended(options.mend)
    names = options.joint_names
    if auto and set(read_as.joint_names) <= set(options.robot_joints):
        names = read_as.joint_names or names
    log = read_table(table, read_as, names, auto, options.torque)
    preset = columns if isinstance(columns, str) and not auto else preset_of(read_as)
    meta, text = {**log.trace.meta, "log": name}, log.as_read
    if preset is not None:
        meta["columns"], text = preset, f"preset {preset}" + (f": {text}" if text else "")
    trace = replace(log.trace, meta=meta)
    return replace(log, trace=trace, name=name, as_read=text)


def chosen(
    columns: ColumnMap | str | None,
    table: Table,
    mend: Collection[str] = (),
    joints: Sequence[str] = (),
) -> ColumnMap:
    """The given map, the preset of the given name, or the preset that fits the header line."""
    if isinstance(columns, ColumnMap):
        return columns
    form: dict[str, Any] = table.form
    if columns is not None and columns != "auto":
        return replace(PRESETS[columns], **form)
    header, values = _beginning(table)
    if not header:
        raise LogError("the file is empty")
    preset = next((replace(PRESETS[name], **form) for name in presets_of(header)), None)
    if preset is not None and columns is None:
        return preset
    told = next((ANGLES[word] for word in mend if word in ANGLES), None)
    found = recognised(header, values, told, joints)
    found = None if found is None else replace(found, **form)
    if preset is not None:
        return preset if found is None else in_units_of(preset, found)
    if found is not None and columns == "auto":
        return found
    known = f"give a column map, or a preset: {', '.join(PRESETS)}"
    if found is None and not header_of(header):
        text = f"no names of columns in the first line: {known}; a map may count columns from 0"
        raise LogError(cause("columns", text))
    if found is None:
        lead = "" if columns == "auto" else "no column map; "
        text = f"{lead}among the columns, {lacking(header, joints)}; {known}"
        raise LogError(cause("columns", text))
    text = f'it looks like {described(found)}: accept with `columns="auto"`; or {known}'
    raise LogError(cause("columns", f"no column map; {text}"))


def _beginning(table: Table) -> tuple[list[str], Array]:
    """Column names, and the values of the first rows; NaN for a cell that is no number."""
    rows = [row for _, row in table.rows[: LOOKED_AT + 1]]
    header = [str(cell).strip() for cell in rows[0]] if rows else []
    values = np.full((max(len(rows) - 1, 0), len(header)), np.nan)
    for k, row in enumerate(rows[1:]):
        for i, cell in enumerate(row[: len(header)]):
            value = number(cell)
            values[k, i] = np.nan if value is None else value
    return header, values


def read_table(
    source: Table,
    columns: ColumnMap,
    joint_names: Sequence[str] | None,
    auto: bool = False,
    torque: bool = False,
) -> Log:
    """The log in a table with these columns; with ``auto``, a note describes them."""
    rows = source.rows
    if not rows:
        raise LogError("empty file")
    header, where = _located(rows[0][1], columns)
    rows = rows[1:] if header else rows
    if not rows:
        raise LogError("a header line without rows of numbers")
    width = columns.width or len(header) or len(rows[0][1])
    wanted = [i for group in where.values() for i in group]
    table, lines, notes = parse(rows, wanted, width, columns, header, source.word)
    if len(table) < 2:
        raise LogError(f"{len(table)} rows of numbers, expected at least 2")
    ends = np.cumsum([len(group) for group in where.values()])[:-1]
    parts = dict(zip(where, np.split(table, ends, axis=1), strict=True))
    times = parts.pop("t")
    t = times[:, 0] * columns.time_scale if columns.times else np.arange(len(table)) / columns.clock
    if "order" in columns.repair and (np.diff(t) < 0).any():
        refuse_set_back(t, lambda row: f"{source.word} {lines[row]}")
        order = np.argsort(t, kind="stable")
        count = int((np.diff(t) < 0).sum())
        notes.append(note("rows-sorted", f"rows sorted by time; {count} were out of order"))
        t, lines = t[order], lines[order]
        parts = {name: value[order] for name, value in parts.items()}
    keep = increasing(t, lambda row: f"{source.word} {lines[row]}", columns, notes)
    if "state" in columns.repair:
        keep = fresh(t, np.column_stack(list(parts.values())), keep, notes)
    kept_parts = {name: np.ascontiguousarray(value[keep]) for name, value in parts.items()}
    signals: dict[str, Any] = _in_si_units(kept_parts, columns)
    meta, as_read = dict[str, str](), ""
    if auto and columns not in PRESETS.values():
        as_read = described(columns)
        notes.insert(0, note("columns", f"read as {as_read}"))
    if columns.torque or torque:
        meta["effort"] = "torque"
    names = named(joint_names or columns.joint_names, len(columns.q))
    kept = lines[keep]
    signals["q"], jumps = unwrapped(signals["q"], names, lambda row: f"{source.word} {kept[row]}")
    notes += jumps
    if "qd" not in signals:
        signals["qd"], meta["velocities"] = differentiated(t[keep], signals["q"]), "differentiated"
        notes.append(note("no-velocities", DIFFERENTIATED))
    trace = Trace(joint_names=names, t=t[keep], meta=meta, **signals)
    labels = labelled(header, rows, kept, trace.t)
    findings = checked(trace, lambda row: f"{source.word} {kept[row]}", notes)
    return Log(trace, labels=labels, as_read=as_read, columns=columns, findings=findings)


def _located(first: Sequence[Any], columns: ColumnMap) -> tuple[list[str], dict[str, list[int]]]:
    """The header (empty if the first line has numbers) and the column indices of each signal.

    Raises:
        LogError: columns that this file does not have; the message names presets that fit it.
    """
    header = header_of(first)
    if header and columns.headerless:
        fitting = presets_of(header)
        text = (
            f"the first line names columns ({listed(header, 60)}), but files of this column map "
            "have no header line: "
            + (f"use {' or '.join(fitting)}" if fitting else "give the columns by their names")
        )
        raise LogError(cause("columns", text))
    try:
        return header, {
            name: [position(column, header, columns) for column in group]
            for name, group in {"t": columns.times, **columns.groups()}.items()
        }
    except ValueError as error:
        better = presets_of(header) if header else presets_of_width(len(first))
        hint = f"; these are the columns of the preset {' or '.join(better)}" if better else ""
        raise LogError(cause("columns", f"{error}{hint}")) from None


def _in_si_units(parts: dict[str, Array], columns: ColumnMap) -> dict[str, Array]:
    """Signals in rad, rad/s and A; ``current`` holds the joint torques [N m] of a torque log."""
    signals = dict(parts)
    if not columns.torque:
        signals["current"] = signals["current"] * np.asarray(columns.current_scale, float)
    efforts = signals.pop("torque", None)
    if np.any(columns.degrees):
        scale = np.where(columns.degrees, np.pi / 180, 1.0)  # one, or one per joint
        signals |= {n: v * scale for n, v in signals.items() if n != "current"}
    if efforts is not None:
        signals["current"] = efforts * np.asarray(columns.torque_scale, float)
    return signals


#: Note on a log without velocities.
DIFFERENTIATED = (
    "no velocities: positions are differentiated over three samples, which adds a delay of 1.5 "
    "samples and noise; bounds get larger accordingly"
)


def differentiated(t: Array, q: Array) -> Array:
    """Velocities of positions, causal: the change over the last three samples, shape (T, n)."""
    rows = np.arange(len(t))
    before = np.maximum(rows - 3, 0)
    span = np.maximum(t[rows] - t[before], 1e-9)[:, None]
    return np.asarray((q[rows] - q[before]) / span)


def header_of(first: Sequence[Any]) -> list[str]:
    """The names in a first line, empty if it is a line of numbers.

    Raises:
        LogError: most cells are numbers, but not all: the line is damaged.
    """
    cells = [str(cell).strip() for cell in first]
    names = [cell for cell in cells if cell and number(cell) is None]
    if names and 2 * len(names) < len([cell for cell in cells if cell]):
        at = cells.index(names[0])
        raise LogError(f"line 1, column {at}: {names[0][:40]!r} is not a number")
    return cells if names else []


def named(names: Sequence[str], joints: int) -> tuple[str, ...]:
    """Joint names, or ``joint_1``, ... if there are none."""
    if names and len(names) != joints:
        raise LogError(f"{len(names)} joint names for {joints} joints in the log")
    return tuple(names) or tuple(f"joint_{i}" for i in range(1, joints + 1))


def number(cell: Any) -> float | None:
    """A cell as a number, or None."""
    try:
        return float(cell)
    except (ValueError, TypeError):
        return None


def position(column: Column, header: Sequence[str], columns: ColumnMap) -> int:
    """Index of a column."""
    if isinstance(column, int):
        if column < 0:
            raise LogError(f"column {column}: indices begin at 0")
        return column
    if column not in header:
        have = listed(header, 200) if header else "no header line"
        raise LogError(f"no column {column!r}; the file has: {have}")
    return header.index(column)


def column_text(column: int, header: Sequence[str]) -> str:
    """A column by its name, or by its number if there are no names."""
    return f"column {header[column]!r}" if header else f"column {column} (counted from 0)"


def listed(names: Sequence[str], length: int) -> str:
    """As many names as fit into ``length`` characters."""
    return shorten(", ".join(names), length, placeholder=" ...")


def parse(
    rows: Sequence[tuple[int, Sequence[Any]]],
    wanted: Sequence[int],
    width: int,
    columns: ColumnMap,
    header: Sequence[str] = (),
    word: str = "line",
) -> tuple[Array, NDArray[np.int64], list[Finding]]:
    """The wanted columns of all rows that are kept, shape (R, columns), line numbers, and notes."""
    if max(wanted) >= width:
        raise LogError(f"no column {max(wanted)}: rows have {width} columns, counted from 0")
    values: list[list[float]] = []
    lines: list[int] = []
    dropped: list[int] = []
    notes: list[Finding] = []
    for index, (line, row) in enumerate(rows):
        if len(row) != width:
            if index == len(rows) - 1 and len(row) < width and "tail" in columns.repair:
                text = f"{word} {line}: cut off ({len(row)} of {width} columns), left out"
                notes.append(note("rows-left-out", text))
                continue
            cut = len(row) < width and index == len(rows) - 1
            more = '; to leave the last row out, say `mend="tail"`' if cut else ""
            text = f"{word} {line}: {len(row)} columns, expected {width}{more}"
            raise LogError(cause("rows", text))
        try:
            cells = [float(row[i]) for i in wanted]
            if all(map(isfinite, cells)):
                values.append(cells)
                lines.append(line)
                continue
        except (ValueError, TypeError):
            pass
        _lacking(row, wanted, f"{word} {line}", columns, header)
        dropped.append(line)
    if dropped:
        text = f"{len(dropped)} rows without finite numbers left out, first: {word} {dropped[0]}"
        notes.append(note("rows-left-out", text))
    table = np.array(values, np.float64).reshape(len(values), len(wanted))
    return table, np.array(lines, np.int64), notes


def _lacking(
    row: Sequence[Any], wanted: Sequence[int], where: str, columns: ColumnMap, header: Sequence[str]
) -> None:
    """Refuse a row with a cell that is no finite number, unless "nan" is an allowed repair."""
    for i in wanted:
        cell, value = str(row[i]).strip(), number(row[i])
        if value is not None and isfinite(value):
            continue
        said = f"{row[i]!r} is not a number" if value is None else f"{cell}, not finite"
        if cell and value is None:
            raise LogError(cause("rows", f"{where}, {column_text(i, header)}: {said}"))
        if "nan" not in columns.repair:
            text = (
                f"{where}, {column_text(i, header)}: {said}; to leave such rows out, say "
                '`mend="nan"` (where they last longer than 0.05 s, cut the log in two instead)'
            )
            raise LogError(cause("rows", text))
