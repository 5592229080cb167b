"""Sources of a log: CSV and MCAP files, DataFrames, arrays, traces."""

import csv
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.datasets.columns import PRESETS, SIGNALS, ColumnMap
from tauguard.datasets.log_checks import checked, unwrapped
from tauguard.datasets.log_table import Options, Table, header_of, log_of
from tauguard.findings import ArgumentError, LogError, cause
from tauguard.traces.logs import Log
from tauguard.traces.trace import Trace
from tauguard.untrusted_input import reading

#: Names of arrays of a log in memory: times, signals, and whether a sample is in contact.
ARRAYS = ("t", *SIGNALS, "contact")


def read_source(source: Any, name: str, options: Options) -> Log:
    """The log in a source, without knowledge of its robot and load; see ``tauguard.read_log``."""
    if isinstance(source, Trace):
        with reading(name, kind=LogError):
            trace = _of_effort(source, options.torque)
            q, notes = unwrapped(trace.q, trace.joint_names, lambda row: f"row {row}")
            trace = replace(trace, q=q) if notes else trace
            return Log(trace, name=name, findings=checked(trace, lambda row: f"row {row}", notes))
    if isinstance(source, Mapping):
        return _of_arrays(source, name, options)
    if hasattr(source, "to_numpy") and hasattr(source, "columns"):
        return _of_frame(source, name, options)
    if not isinstance(source, str | Path):
        text = f"source: {type(source).__name__}; expected a path, a DataFrame, arrays or a Trace"
        raise ArgumentError(cause("source", text))
    path = Path(source)
    with reading(path, kind=LogError):
        log = _of_mcap(path, options) if path.suffix == ".mcap" else _of_csv(path, options)
    return replace(log, name=path.name, path=path)


# -- files -----------------------------------------------------------------------------------------


def _of_mcap(path: Path, options: Options) -> Log:
    from tauguard.datasets.logs_mcap import read_joint_states

    log, preset = read_joint_states(path, options.joint_names, options.torque), options.columns
    if not (isinstance(preset, str) and preset in PRESETS):
        return log
    meta = {**log.trace.meta, "columns": preset}  # for its gains
    return replace(log, trace=replace(log.trace, meta=meta), as_read=f"preset {preset}")


def _of_csv(path: Path, options: Options) -> Log:
    columns = options.columns
    try:
        form = _form(path)
        if isinstance(columns, ColumnMap):
            form = {"separator": columns.separator, "decimal": columns.decimal}
        table = Table(list(_rows(path, **form)), form=form)
        return log_of(table, path.name, options)
    except UnicodeDecodeError as error:
        raise LogError("not a text file; expected CSV or MCAP") from error
    except csv.Error as error:
        raise LogError(f"not CSV ({error})") from error


def _form(path: Path) -> dict[str, str]:
    """Separator and decimal mark, found from the first two lines."""
    with open(path, newline="", encoding="utf-8-sig") as stream:
        first, second = stream.readline(), stream.readline()
    separator = max(",;\t", key=first.count)
    decimal = "," if separator != "," and "," in second and "." not in second else "."
    return {"separator": separator, "decimal": decimal}


def _rows(path: Path, separator: str, decimal: str) -> Iterator[tuple[int, list[str]]]:
    """Line numbers and cells of all rows that are not empty; decimal marks become points."""
    with open(path, newline="", encoding="utf-8-sig") as stream:
        for n, row in enumerate(csv.reader(stream, delimiter=separator), 1):
            if row:
                yield n, row if decimal == "." else [cell.replace(decimal, ".") for cell in row]


# -- memory ----------------------------------------------------------------------------------------


def _of_frame(frame: Any, name: str, options: Options) -> Log:
    """The log in a DataFrame of pandas or polars, or in one of ``Log.to_frame``."""
    if getattr(frame.columns, "nlevels", 1) == 2:  # signal and joint
        signals = dict.fromkeys(signal for signal, _ in frame.columns)
        arrays = {signal: frame[signal].to_numpy() for signal in signals}
        joints = tuple(map(str, frame[next(iter(signals))].columns))
        options = replace(options, joint_names=options.joint_names or joints)
        return _of_arrays({"t": frame.index.to_numpy()} | arrays, name, options)
    header = [str(column) for column in frame.columns]
    return _of_rows(header, frame.to_numpy().tolist(), name, options)


def _of_arrays(arrays: Mapping[str, Any], name: str, options: Options) -> Log:
    """The log in arrays that are named as the fields of a trace, see ``ARRAYS``.

    Raises:
        ArgumentError: another name, or a shape that does not fit the others.
    """
    if unknown := sorted(map(str, set(arrays) - set(ARRAYS))):
        text = f"arrays: {', '.join(unknown)}; expected some of {', '.join(ARRAYS)}"
        raise ArgumentError(cause("columns", text))
    if "q" not in arrays:
        raise ArgumentError(cause("columns", "arrays: q is missing: joint positions, shape (T, n)"))
    values = {key: np.asarray(value, np.float64) for key, value in arrays.items()}
    rows, joints = values["q"].shape if values["q"].ndim == 2 else (0, 0)
    header, table = list[str](), []
    fields: dict[str, Any] = {"t": None, "clock": 1.0}  # replaced by `mend="clock=HZ"`
    for key, value in values.items():
        wanted = (rows,) if key in ("t", "contact") else (rows, joints)
        if value.shape != wanted or not rows:
            text = f"arrays: {key} has the shape {value.shape}, expected {wanted or '(T, n)'}"
            raise ArgumentError(cause("columns", text))
        names = (key,) if value.ndim == 1 else tuple(f"{key}_{k}" for k in range(joints))
        header += names
        table.append(value.reshape(rows, -1))
        if key == "t":
            fields |= {"t": key, "clock": 0.0}
        elif key != "contact":
            fields[key] = names
    if "t" not in arrays and not any(word.startswith("clock=") for word in options.mend):
        text = 'arrays: t is missing: times [s], shape (T,); or give `mend="clock=HZ"`'
        raise ArgumentError(cause("columns", text))
    with reading(name, kind=LogError):
        options = replace(options, columns=ColumnMap(**fields))
    log = _of_rows(header, np.hstack(table).tolist(), name, options)
    return replace(log, as_read="arrays")


def _of_rows(header: list[str], rows: list[list[Any]], name: str, options: Options) -> Log:
    numbered: list[tuple[int, Any]] = list(enumerate(rows))
    with reading(name, kind=LogError):
        if header_of(header):
            numbered.insert(0, (-1, header))
        return log_of(Table(numbered, "row"), name, options)


def _of_effort(trace: Trace, torque: bool) -> Trace:
    return replace(trace, meta={**trace.meta, "effort": "torque"}) if torque else trace
