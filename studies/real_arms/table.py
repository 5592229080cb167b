"""The table of the benchmark: every method on every arm, at equal rates of false alarms.

A method's one knob is chosen on held-out free motion: the smallest from which on every larger one
keeps the rate, on all collision-free logs but the judged one. The KUKA's half minute is left out of
the choice. At the operating point "other arms" the logs of the judged arm are left out, too. A
method with a setting gets the one of three that finds most added torques on the other arms, at 60
false alarms an hour. So neither knob nor setting see the judged log.

`tauguard bench real_arms-table` makes ``benchmark/table.csv`` byte for byte and compares it with
the committed file. After a change of a method, ``python -m studies.real_arms.table`` writes it.
"""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from tqdm import tqdm

import tauguard.benchmark
from studies.framework import Workers
from studies.real_arms.figure import draw
from studies.real_arms.methods import METHODS
from studies.real_arms.trials import KNOBS, Run, alarms_of, run, trials
from tauguard.arrays import Array
from tauguard.atomic_write import write_atomic
from tauguard.benchmark.arms import ARMS, is_there, judged_logs
from tauguard.benchmark.judging import (
    COLUMNS,
    COUNTED,
    UNMEASURED,
    JudgedLog,
    as_csv,
    count_log,
    table_rows,
)
from tauguard.benchmark.submission import group_of, ranking, submitted
from tauguard.detectors.evaluation.matching import Rule
from tauguard.report import Row

__all__ = ["NOTES", "draw", "measure"]

#: The committed table.
FILE = Path(tauguard.benchmark.__file__).with_name("table.csv")
#: False alarms an hour at the operating points; the first one chooses settings.
RATES = (60.0, 240.0, 12.0)
#: The operating points: name, rate [1/h], whether logs of the judged arm take part in the choice.
POINTS = (
    ("as it is", None, True),
    *((f"{rate:g} an hour", rate, True) for rate in RATES),
    (f"{RATES[0]:g} an hour (other arms)", RATES[0], False),
)
SIZE = (11, 8.5)  #: of the figure [inch]
#: Arms of a quick run.
QUICK = ("ur5",)
NOTES = {
    "table": "found: with its 95 % interval; by chance: mean over shifts of the alarms; false "
    "alarms in free min, an hour with the exact 95 % interval.",
    "summary": "sha256 of the table as CSV.",
    "rank": "by contacts found beyond chance: mean, over arms and truths, of the fraction found "
    "less that by chance; methods of the table at 60 false alarms an hour.",
}


class Results:
    """All runs, with the counts from which knobs and settings are chosen."""

    def __init__(self, runs: Iterable[Run], arms: Sequence[str]) -> None:
        """Count the false alarms of all runs."""
        self.runs = {(r.method, r.setting, r.arm, r.log): r for r in runs}
        self.logs = {(arm, pair[0].name): pair for arm in arms for pair in judged_logs(arm)}
        self.false = {key: self._false(r) for key, r in self.runs.items() if self._is_free(r)}

    def _is_free(self, one: Run) -> bool:
        contacts = self.logs[one.arm, one.log][1]
        return all(contact.truth == "switch" for contact in contacts)

    def _false(self, one: Run) -> tuple[Array, float]:
        """Number of false alarms at every knob, and the collision-free time [h]."""
        log, contacts = self.logs[one.arm, one.log]
        counts = [count_log(log, contacts, alarms_of(a), Rule(shifts=0)) for a in one.alarms]
        return np.array([len(c.false_alarms) for c in counts]), counts[0].free_seconds / 3600

    def knob(
        self, method: str, setting: float, rate: float, without: tuple[str, str]
    ) -> int | None:
        """Index of the smallest knob from which on all keep the rate; None: no knob does.

        Args:
            method: name.
            setting: its setting.
            rate: false alarms an hour.
            without: arm and log that take no part; an empty log: the whole arm.
        """
        counts, hours = np.zeros(len(KNOBS)), 0.0
        for (name, value, arm, log), (false, time) in self.false.items():
            left_out = arm == without[0] and without[1] in ("", log)
            if (name, value) == (method, setting) and not (left_out or _sits_out(arm)):
                counts, hours = counts + false, hours + time
        over = np.flatnonzero(counts > rate * hours)
        first = int(over[-1]) + 1 if len(over) else 0
        return first if first < len(KNOBS) else None

    def setting(self, method: str, arm: str) -> float:
        """The setting that finds most added torques on other arms at the first of the rates."""
        settings = METHODS[method].settings if method in METHODS else (1.0,)
        if len(settings) == 1:
            return settings[0]

        def found(setting: float) -> int:
            knob = self.knob(method, setting, RATES[0], (arm, ""))
            own = [
                r
                for (name, value, *_), r in self.runs.items()
                if (name, value) == (method, setting)
            ]
            counted = [r for r in own if r.arm != arm and r.pulses and not _sits_out(r.arm)]
            return sum(r.pulses[knob] for r in counted) if knob is not None else -1

        return max(settings, key=found)

    def rows(self, method: str) -> list[dict[str, str]]:
        """The table's rows of one method."""
        arms = dict.fromkeys(arm for arm, _ in self.logs)
        tuned = {arm: self.setting(method, arm) for arm in arms}
        whole = [  # a method that cannot be trained for all logs of an arm has no rows there
            arm
            for arm in arms
            if all((method, tuned[arm], *key) in self.runs for key in self.logs if key[0] == arm)
        ]
        rows = []
        for point, rate, same_arm in POINTS:
            judged = []
            for (arm, name), (log, contacts) in self.logs.items():
                if arm not in whole:
                    continue
                one = self.runs[method, tuned[arm], arm, name]
                knob: int | None = KNOBS.index(1.0)
                if rate is not None:
                    knob = self.knob(method, tuned[arm], rate, (arm, name if same_arm else ""))
                alarms = [] if knob is None else alarms_of(one.alarms[knob])
                value = np.inf if knob is None else KNOBS[knob]
                judged.append(JudgedLog(arm, name, count_log(log, contacts, alarms), value))
            rows += table_rows(method, point, judged)
        return rows


def _sits_out(arm: str) -> bool:
    return ARMS[arm].apart or ARMS[arm].blind


def measure(
    quick: bool, seed: int, detector: str | None = None, alarms: str | None = None
) -> list[Row]:
    """All rows with the sha256 of the table, or those of one more method and its rank.

    Args:
        quick: one arm.
        seed: not used: nothing is drawn but the times of "alarm at random", which are fixed.
        detector: ``module:Class``; only this method is measured.
        alarms: folder of a submission; only this is judged.
    """
    arms = [name for name in (QUICK if quick else ARMS) if is_there(ARMS[name])]
    if not arms:
        return [{"study": "table", "log": "no logs: run `tauguard data fetch all`"}]
    if alarms is not None:
        return _beside(submitted(Path(alarms))[1])
    if detector is not None:
        return _beside(built(arms, [detector]))
    rows = built(arms, list(METHODS)) + ([] if quick else unmeasured(arms))
    text = as_csv(rows)
    committed = FILE.read_text("utf-8") if FILE.is_file() else ""
    same = "a quick run is not compared" if quick else "yes" if text == committed else "no"
    summary = {"sha256": hashlib.sha256(text.encode()).hexdigest(), "the committed bytes": same}
    return [*({"study": "table"} | row for row in rows), {"study": "summary"} | summary]


def unmeasured(arms: Sequence[str]) -> list[dict[str, str]]:
    """A row for each arm whose logs are not in the data folder."""
    missing = [name for name in ARMS if name not in arms]
    return [dict.fromkeys(COLUMNS, "") | {"arm": arm, "truth": UNMEASURED} for arm in missing]


def _beside(rows: list[dict[str, str]]) -> list[Row]:
    """Rows of a new method, and its rank among those of the committed table."""
    with FILE.open(encoding="utf-8", newline="") as stream:
        groups = {group_of(row) for row in rows if row["truth"] in COUNTED}
        ranked = ranking([*csv.DictReader(stream), *rows], POINTS[1][0], groups)
    return [*({"study": "table"} | row for row in rows), *({"study": "rank"} | r for r in ranked)]


def built(arms: Sequence[str], methods: Sequence[str]) -> list[dict[str, str]]:
    """The rows of the table for these arms and methods."""
    jobs = trials(methods, arms)
    with Workers() as each:
        runs = tqdm(each(run, jobs), total=len(jobs), desc="trials", disable=None)
        results = Results([one for part in runs for one in part], arms)
    return [row for method in methods for row in results.rows(method)]


if __name__ == "__main__":
    there = [name for name in ARMS if is_there(ARMS[name])]
    write_atomic(FILE, as_csv(built(there, list(METHODS)) + unmeasured(there)))
