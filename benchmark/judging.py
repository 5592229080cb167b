"""Alarms on the benchmark's logs, counted, as rows of its table."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tauguard.detectors.evaluation.matching import Contact, Count, Rule, count
from tauguard.report import poisson_rate, rate
from tauguard.traces import Alarm
from tauguard.traces.logs import Log

#: Time at the beginning of a log in which alarms and contacts do not count [s].
SETTLE = 0.5
#: Delays for which the fraction of contacts found by then is stated [ms].
WITHIN = (100, 150, 250)
#: The columns of the table.
COLUMNS = (
    "method", "operating point", "knob", "arm", "truth", "state", "contacts", "found", "low",
    "high", "by chance", *(f"within {ms} ms" for ms in WITHIN), "still up", "false alarms",
    "free min", "per hour", "per hour low", "per hour high",
)  # fmt: skip
#: The kinds of truth that count, apart from each other; contacts found by eye are shown only.
COUNTED = ("sensor", "switch", "same program")
#: Text of a blind arm whose logs are not in the data folder.
UNMEASURED = "not measured here"


@dataclass(frozen=True)
class JudgedLog:
    """The count of one log."""

    arm: str
    log: str
    counted: Count
    knob: float = 1.0  #: with which the alarms were raised


def count_log(
    log: Log, contacts: Sequence[Contact], alarms: Iterable[Alarm], rule: Rule | None = None
) -> Count:
    """Count the alarms of one log. Contacts that begin before :data:`SETTLE` are left out.

    In a log with contacts that are known by eye, alarms elsewhere may be contacts too, so that
    nothing of it counts as collision-free.
    """
    t = log.trace.t
    counted = count(alarms, contacts, (float(t[0]) + SETTLE, float(t[-1])), rule)
    if contacts and any(contact.truth != "switch" for contact in contacts):
        return replace(counted, false_alarms=(), free=())
    return counted


def table_rows(method: str, point: str, judged: Iterable[JudgedLog]) -> list[dict[str, str]]:
    """One row for each arm, kind of truth and state, and one for each arm without contacts."""
    logs = list(judged)
    rows = []
    for arm in dict.fromkeys(log.arm for log in logs):
        of_arm = [log for log in logs if log.arm == arm]
        false = sum(len(log.counted.false_alarms) for log in of_arm)
        hours = sum(log.counted.free_seconds for log in of_arm) / 3600
        knobs = sorted(
            {log.knob for log in of_arm if log.counted.contacts} or {log.knob for log in of_arm}
        )
        knob = " to ".join(f"{value:.4g}" for value in dict.fromkeys((knobs[0], knobs[-1])))
        head = {"method": method, "operating point": point, "knob": knob, "arm": arm}
        free = _free(false, hours)
        groups: dict[tuple[str, str], list[tuple[float, float, bool]]] = {}
        for log in of_arm:
            c = log.counted
            for contact, *result in zip(c.contacts, c.delays, c.by_chance, c.still_up, strict=True):
                state = "moving" if contact.moving else "standing"
                groups.setdefault((contact.truth, state), []).append(tuple(result))  # type: ignore[arg-type]
        for (truth, state), results in sorted(groups.items()):
            cells = _contacts(truth, results)
            rows.append(head | {"truth": truth, "state": state} | cells | free)
        if not groups:
            rows.append(head | {"truth": "-", "state": "free"} | free)
    return [{column: row.get(column, "") for column in COLUMNS} for row in rows]


def _contacts(truth: str, results: Sequence[tuple[float, float, bool]]) -> dict[str, str]:
    delays = np.array([delay for delay, _, _ in results])
    number, hits = len(delays), int(np.isfinite(delays).sum())
    interval = rate(hits, number)
    row = {"contacts": f"{number}", "found": f"{hits}", "low": f"{interval['low']:.3f}"}
    row |= {"high": f"{interval['high']:.3f}"}
    row["by chance"] = f"{np.mean([chance for _, chance, _ in results]):.3f}"
    if truth in COUNTED:
        # A delay is a difference of two times; a microsecond is far above its rounding.
        row |= {f"within {ms} ms": f"{(delays <= 1e-3 * ms + 1e-6).sum()}" for ms in WITHIN}
    return row | {"still up": f"{sum(up for _, _, up in results)}"}


def _free(false: int, hours: float) -> dict[str, str]:
    if not hours:
        return {}
    interval = poisson_rate(false, hours)
    return {
        "false alarms": f"{false}",
        "free min": f"{60 * hours:.2f}",
        "per hour": f"{interval['value']:.0f}",
        "per hour low": f"{interval['low']:.0f}",
        "per hour high": f"{interval['high']:.0f}",
    }


def as_csv(rows: Iterable[dict[str, str]]) -> str:
    """The rows as CSV text."""
    return "".join(
        ",".join(line) + "\n" for line in (COLUMNS, *([r[c] for c in COLUMNS] for r in rows))
    )
