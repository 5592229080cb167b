"""Helpers of all parts: timings with their spread, lines of the summary, points of figures."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from tauguard.report import Row

T = TypeVar("T")


class Incomplete(RuntimeError):
    """Some measurements of a part failed; ``rows`` holds the others."""

    def __init__(self, rows: list[Row], reasons: Mapping[str, BaseException]) -> None:
        """Keep the rows; ``reasons`` has the exception of each failed measurement by its name."""
        lines = (f"{part}: {type(error).__name__}: {error}" for part, error in reasons.items())
        super().__init__("parts of the study failed, the others are kept; " + "; ".join(lines))
        self.rows = rows
        self.__cause__ = next(iter(reasons.values()))


@dataclass(frozen=True)
class Point:
    """Time and error of one method, for a figure and for the table on the report's first page."""

    question: str  #: title of the figure
    method: str
    cost: float  #: time [us], or the quantity of ``cost_axis``
    error: float  #: in the unit of ``error_axis``; NaN: not in the figure
    error_text: str = ""  #: the error as text, for the table
    role: str = ""  #: "ours" or "peer" of a line of the table; "": not in the table
    cost_axis: str = "microseconds"
    error_axis: str = "error"


def timed(met: bool, quick: bool) -> bool | str:
    """Whether a timing meets its bound; a quick run has too few repeats to report a miss."""
    return "full run" if quick and not met else bool(met)


def answer(question: str, asked: str, measured: str, met: bool | str | None = None) -> Row:
    """A line of a summary; ``met`` is ``None`` without a target."""
    return {
        "study": "summary",
        "question": question,
        "asked": asked,
        "measured": measured,
        "met": met if met is None or isinstance(met, str) else bool(met),
    }


def time_in_turn(
    calls: Mapping[str, Callable[[], object]],
    repeats: int = 5,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, dict[str, float]]:
    """Time of each call [s]. Calls alternate (A B A B ...) after a warm-up of all.

    Because the calls take turns, a drift of the machine's speed affects all methods alike.
    The clock ``time.process_time`` excludes the time of other programs, for work in a single
    thread.

    Returns:
        ``{"median", "low", "high"}`` by name: median, minimum and maximum over the repeats [s].
    """
    for call in calls.values():
        call()
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(repeats):
        for name, call in calls.items():
            start = clock()
            call()
            times[name].append(clock() - start)
    return {
        name: {"median": float(np.median(t)), "low": min(t), "high": max(t)}
        for name, t in times.items()
    }


def per(seconds: dict[str, float], number: int, unit: float = 1e9) -> dict[str, float]:
    """Measured times divided by ``number`` cases [ns], or in another ``unit``."""
    return {name: value * unit / max(1, number) for name, value in seconds.items()}


def table_rows(rows: Sequence[Row], name: str) -> list[Row]:
    """The rows of one table."""
    return [row for row in rows if row.get("study") == name]


def groups(rows: Sequence[T], key: Callable[[T], str]) -> dict[str, list[T]]:
    """Rows with the same key, in the order of their first appearance."""
    found: dict[str, list[T]] = {}
    for row in rows:
        found.setdefault(key(row), []).append(row)
    return found


def number(value: object) -> float | None:
    """A number, the value of a rate, or the median of a time; ``None`` for anything else."""
    if isinstance(value, Mapping):
        value = value.get("median", value.get("value"))
    return float(value) if isinstance(value, int | float) else None
