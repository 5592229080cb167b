"""Judge the alarms of an external detector on a dataset.

The alarms are in a CSV file with one line per alarm. Its columns are ``episode`` (SPLIT/NUMBER,
from 0), ``start`` and ``end`` [s since the episode's start].
"""

import csv
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from tauguard.datasets.dataset_folder import configuration_in
from tauguard.datasets.plans import BEGIN
from tauguard.datasets.reader import read, splits_of
from tauguard.detectors.evaluation.matching import Matching, match, merged
from tauguard.findings import FileError
from tauguard.traces import Alarm

COLUMNS = ("episode", "start", "end")


def read_alarm_file(path: Path) -> dict[str, tuple[Alarm, ...]]:
    """The alarms of each episode, in order; alarms less than 0.2 s apart are merged.

    Raises:
        FileError: other columns, or a line with a wrong value; the message names file and line.
        OSError: no such file.
    """
    found: dict[str, list[Alarm]] = {}
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            rows = csv.DictReader(stream)
            if tuple(rows.fieldnames or ()) != COLUMNS:
                raise FileError(
                    f"{path}: columns {', '.join(rows.fieldnames or ('none',))}; expected "
                    f"{', '.join(COLUMNS)}"
                )
            for row in rows:
                alarm = _alarm(row, f"{path}, line {rows.line_num}")
                found.setdefault(row["episode"].strip(), []).append(alarm)
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"{path}: not a CSV file ({error})") from None
    return {name: merged(alarms) for name, alarms in found.items()}


def judged_alarms(
    folder: Path, path: Path, splits: Sequence[str] = ()
) -> Iterator[tuple[str, list[Matching]]]:
    """Match the alarms of a file with the true collisions of each split's episodes.

    The first 3 s of an episode are not judged: detectors start up then, and nothing collides.

    Args:
        folder: a dataset.
        path: the file of alarms.
        splits: names of splits (default: all whose name begins with "test").

    Raises:
        FileError: not a CSV file of alarms, or an episode that is in none of the splits.
        OSError: no such file or folder.
    """
    alarms = read_alarm_file(path)
    every = configuration_in(folder).splits
    chosen = splits_of(folder, splits or [s.name for s in every if s.name.startswith("test")])
    episodes = {s.name: s.episodes for s in every if s.name in chosen}
    for name in alarms:
        split, _, number = name.partition("/")
        if not (number.isdecimal() and int(number) < episodes.get(split, 0)):
            there = ", ".join(f"{s}/0 to {s}/{n - 1}" for s, n in episodes.items())
            raise FileError(f"{path}: no episode {name!r} among those that are judged: {there}")
    for split in chosen:
        yield (
            split,
            [
                match(
                    alarms.get(trace.meta["episode"], ()),
                    trace.truth.collisions,
                    (float(min(trace.t[0] + BEGIN, trace.t[-1])), float(trace.t[-1])),
                )
                for trace in read(folder, [split])
                if trace.truth is not None
            ],
        )


def _alarm(row: dict[str, str], where: str) -> Alarm:
    try:
        start, end = float(row["start"]), float(row["end"])
    except (TypeError, ValueError):
        start = end = math.nan
    if not (0 <= start <= end < math.inf) or None in row:
        raise FileError(f"{where}: expected an episode and two times in seconds, start <= end")
    return Alarm(start, end)
