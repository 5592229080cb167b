"""Alarms of anybody's method on the benchmark's logs: a folder with a card, checked and judged.

The folder has ``card.toml`` and, for every log of an arm, a file ``ARM/LOG.csv`` with the columns
``start`` and ``end`` [s, in the log's own time]; a log without alarms has a file with the header
alone. An arm without a folder is left out.
"""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from tauguard.benchmark.arms import ARMS, is_there, judged_logs
from tauguard.benchmark.judging import COUNTED, JudgedLog, count_log, table_rows
from tauguard.findings import FileError
from tauguard.report import poisson_rate
from tauguard.traces import Alarm
from tauguard.untrusted_input import read_text

Group = tuple[str, str, str]
#: The files of a submission.
CARD, HEADER = "card.toml", ["start", "end"]


@dataclass(frozen=True)
class Card:
    """What a method is."""

    name: str
    source: str  #: paper, code, or author
    inputs: str  #: signals that it reads, and models
    training: str  #: logs with which it was trained
    knob: str  #: what trades contacts for false alarms, and on which logs it was set


def read_card(folder: Path) -> Card:
    """The card of a submission.

    Raises:
        FileError: no card, or fields that are missing or no text.
    """
    path = folder / CARD
    names = [field.name for field in fields(Card)]
    if not path.is_file():
        raise FileError(f"{folder}: no {CARD}; it has the fields {', '.join(names)}, each a text")
    try:
        card = tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise FileError(f"{path}: not TOML ({error})") from None
    lacking = [name for name in names if not str(card.get(name, "")).strip()]
    if lacking or set(card) - set(names):
        unknown = ", ".join(sorted(set(card) - set(names))) or "none"
        raise FileError(
            f"{path}: missing: {', '.join(lacking) or 'none'}; unknown: {unknown}; expected the "
            f"fields {', '.join(names)}, each a text"
        )
    return Card(**{name: str(card[name]) for name in names})


def read_alarms(path: Path, first: float, last: float) -> list[Alarm]:
    """The alarms of one log, which lasts from ``first`` to ``last`` [s].

    Raises:
        FileError: other columns, or times that are out of order or outside of the log; the message
            names file and line.
    """
    alarms = []
    rows = csv.reader(read_text(path).splitlines())
    if (header := next(rows, [])) != HEADER:
        raise FileError(f"{path}: columns {', '.join(header) or 'none'}; expected start, end")
    for row in rows:
        where = f"{path}, line {rows.line_num}"
        try:
            start, end = map(float, row)
        except ValueError:
            raise FileError(f"{where}: {','.join(row)!r}; expected two times in seconds") from None
        if not first <= start <= end <= last:
            raise FileError(
                f"{where}: {start} to {end} s; expected first <= start <= end <= last, the log "
                f"lasting from {first} to {last} s"
            )
        alarms.append(Alarm(start, end))
    return alarms


def submitted(folder: Path) -> tuple[Card, list[dict[str, str]]]:
    """The card of a submission, and the rows of its alarms.

    Raises:
        FileError: the folder is no submission: no card, an arm or log that the benchmark does not
            have, a log without a file, or a wrong alarm.
    """
    if not folder.is_dir():
        raise FileError(f"{folder}: no folder; expected one with {CARD} and ARM/LOG.csv")
    card, judged = read_card(folder), []
    names = sorted(path.name for path in folder.iterdir() if path.is_dir())
    if not names or set(names) - set(ARMS):
        wrong = ", ".join(sorted(set(names) - set(ARMS))) or "none"
        raise FileError(f"{folder}: folders of arms: {wrong}; there are {', '.join(ARMS)}")
    for arm in names:
        if not is_there(ARMS[arm]):
            raise FileError(f"{arm}: its logs are not here: run `tauguard data fetch {arm}`")
        there = {log.name: (log, contacts) for log, contacts in judged_logs(arm)}
        submitted_logs = {path.stem for path in (folder / arm).glob("*.csv")}
        if lacking := sorted(set(there) - submitted_logs):
            raise FileError(
                f"{folder / arm}: no file for {', '.join(lacking)}; a log without alarms has a "
                "file with the line start,end alone"
            )
        if unknown := sorted(submitted_logs - set(there)):
            raise FileError(f"{folder / arm}: {arm} has no log {', '.join(unknown)}")
        for name, (log, contacts) in there.items():
            t = log.trace.t
            alarms = read_alarms(folder / arm / f"{name}.csv", float(t[0]), float(t[-1]))
            judged.append(JudgedLog(arm, name, count_log(log, contacts, alarms)))
    return card, table_rows(card.name, "as submitted", judged)


def ranking(
    rows: Sequence[dict[str, str]], point: str, groups: Collection[Group] | None = None
) -> list[dict[str, str]]:
    """Methods in the order of contacts found beyond chance, at one operating point.

    Beyond chance is the mean, over groups of contacts whose truth counts, of the fraction found
    minus the fraction found by chance; it is 0 in a group that a method has no row of.

    Args:
        rows: of the table, and of submissions, which are ranked at their own rate of false alarms.
        point: operating point of the table's rows.
        groups: arm, truth and state of the groups; default: all.
    """
    chosen = [row for row in rows if row["operating point"] in (point, "as submitted")]
    by_method: dict[str, list[dict[str, str]]] = {}
    for row in chosen:
        by_method.setdefault(row["method"], []).append(row)
    every = set(groups or {group_of(row) for row in chosen if row["truth"] in COUNTED})
    lines = []
    for method, entries in by_method.items():
        beyond = [
            int(row["found"]) / int(row["contacts"]) - float(row["by chance"])
            for row in entries
            if group_of(row) in every
        ]
        by_arm = {row["arm"]: row for row in entries if row["free min"] and not _apart(row["arm"])}
        false = sum(int(row["false alarms"]) for row in by_arm.values())
        minutes = sum(float(row["free min"]) for row in by_arm.values())
        interval = poisson_rate(false, minutes / 60)
        rate = "-" if not minutes else f"{interval['low']:.0f} to {interval['high']:.0f}"
        lines.append((sum(beyond) / max(len(every), 1), method, rate))
    lines.sort(key=lambda line: (-line[0], line[1]))
    return [
        {"rank": f"{k}", "method": method, "beyond chance": f"{value:.3f}", "false per hour": rate}
        for k, (value, method, rate) in enumerate(lines, 1)
    ]


def group_of(row: dict[str, str]) -> Group:
    """Arm, truth and state of a row's contacts."""
    return row["arm"], row["truth"], row["state"]


def _apart(arm: str) -> bool:
    return ARMS[arm].apart
