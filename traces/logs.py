"""Logs of one arm: the samples, and what is known of each log (load, contacts, how it was read)."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tauguard.findings import ArgumentError, Findings
from tauguard.results import Result, Row, finding_rows
from tauguard.traces.loads import Load as Load
from tauguard.traces.motion import motion_length
from tauguard.traces.trace import Trace

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, eq=False)
class Recording:
    """A trace and the load that the arm carried."""

    trace: Trace
    load: Load | None = field(default_factory=Load)  #: None: an unknown load


@dataclass(frozen=True, eq=False, repr=False)
class Log(Result, Recording):
    """A recording of an arm with what is known about it."""

    name: str = "log"  #: the file's name
    labels: tuple[tuple[float, float], ...] | None = None
    """First and last time [s] of each contact that a column labels; None: no such column"""
    as_read: str = ""  #: how columns and units were understood
    columns: Any = None  #: the ``datasets.ColumnMap`` that read a CSV file; None: another source
    path: Path | None = None
    robot: Path | None = None  #: robot file, if it is known
    numbers: Any = None  #: the ``detectors.RobotNumbers`` of this file
    findings: Findings = field(default_factory=Findings)

    @property
    def source(self) -> str:
        """The file's path, or the log's name."""
        return self.name if self.path is None else str(self.path)

    @property
    def contacts(self) -> int | None:
        """Number of contacts in the truth or the labels; None: not known."""
        if self.trace.truth is not None:
            return len(self.trace.truth.collisions)
        return None if self.labels is None else len(self.labels)

    def until(self, seconds: float) -> Log:
        """The beginning of the log, up to this time after its first sample; without truth."""
        rows = int(np.searchsorted(self.trace.t, self.trace.t[0] + seconds))
        return replace(self, trace=cut(self.trace, slice(0, rows)))

    def rows(self) -> list[Row]:
        """One row: duration, rate, joints, time in motion, load, contacts."""
        trace = self.trace
        return [
            {
                "log": self.name,
                "seconds": round(float(trace.t[-1] - trace.t[0]), 1),
                "rate [Hz]": round(1 / trace.dt, 1),
                "joints": len(trace.joint_names),
                "moving [s]": round(motion_length([trace]), 1),
                "load [kg]": "unknown" if self.load is None else self.load.mass,
                "contacts": self.contacts,
            }
        ]

    def to_frame(self) -> pandas.DataFrame:
        """The samples (needs pandas): one row per time [s], columns (signal, joint).

        Units are those of :class:`Trace`.
        """
        import pandas

        parts = {
            name: pandas.DataFrame(values, columns=list(self.trace.joint_names))
            for name, values in self.trace.signals.items()
        }
        frame = pandas.concat(parts, axis=1, names=["signal", "joint"])
        return frame.set_index(pandas.Index(self.trace.t, name="t [s]"))

    def to_dict(self) -> dict[str, Any]:
        """The row of :meth:`rows`, how the log was read, labels and findings, as JSON values."""
        return {
            **self.rows()[0],
            "joint_names": list(self.trace.joint_names),
            "as_read": self.as_read,
            "labels": None if self.labels is None else [list(times) for times in self.labels],
            "findings": finding_rows(self.findings),
        }

    def __repr__(self) -> str:
        """One line."""
        return f"Log({self.name}: {self.trace!r}" + (f", {self.as_read})" if self.as_read else ")")


@dataclass(frozen=True, eq=False, repr=False)
class Logs(Result, Mapping[str, Log]):
    """Logs of one arm by name, with joints in the robot's order."""

    logs: Mapping[str, Log]
    robot: Path | None = None  #: robot file; None: the arm is attached to each trace (simulation)
    numbers: Any = None
    """The ``detectors.RobotNumbers`` of the robot file, for the joints that the logs have."""
    findings: Findings = field(default_factory=Findings)
    """Those of all logs, each text once, and those on the joints."""

    def __post_init__(self) -> None:
        """``ArgumentError`` if there are no logs, or logs of different joints."""
        if not self.logs:
            raise ArgumentError("logs: expected at least one")
        joints = {log.trace.joint_names for log in self.logs.values()}
        if len(joints) > 1:
            listed = " and ".join(", ".join(names) for names in sorted(joints))
            raise ArgumentError(f"logs: joints {listed}; expected logs of one arm")

    def __getitem__(self, name: str) -> Log:
        return self.logs[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.logs)

    def __len__(self) -> int:
        return len(self.logs)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints of all logs."""
        return next(iter(self.logs.values())).trace.joint_names

    @property
    def traces(self) -> list[Trace]:
        """The traces of all logs."""
        return [log.trace for log in self.logs.values()]

    def only(self, names: Collection[str]) -> Logs:
        """The logs of these names, in the present order."""
        return replace(self, logs={name: log for name, log in self.items() if name in names})

    def rows(self) -> list[Row]:
        """One row per log, as :meth:`Log.rows`."""
        return [row for log in self.logs.values() for row in log.rows()]

    def to_dict(self) -> dict[str, Any]:
        """The logs, the robot file and the findings, as JSON values."""
        return {
            "robot": None if self.robot is None else str(self.robot),
            "logs": [log.to_dict() for log in self.logs.values()],
            "findings": finding_rows(self.findings),
        }

    def __repr__(self) -> str:
        """One line: number of logs, total duration, robot."""
        seconds = sum(float(trace.t[-1] - trace.t[0]) for trace in self.traces)
        count = "1 log" if len(self) == 1 else f"{len(self)} logs"
        robot = "simulated arm" if self.robot is None else self.robot.name
        doubts = "1 finding" if len(self.findings) == 1 else f"{len(self.findings)} findings"
        return f"Logs({count}, {seconds:.0f} s, {robot}, {doubts})"


def cut(trace: Trace, rows: slice) -> Trace:
    """The given rows of a log, without its truth."""
    q, qd, current = trace.q[rows], trace.qd[rows], trace.current[rows]
    return Trace(trace.joint_names, trace.t[rows], q, qd, current, meta=trace.meta)
