"""What studies share: timings with spread, and the lines of a closing summary."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np

from tauguard.report import Row


class Incomplete(RuntimeError):
    """A part of a study failed; ``rows`` holds what the other parts found."""

    def __init__(self, rows: list[Row], reasons: Mapping[str, BaseException]) -> None:
        """Keep the rows; ``reasons`` is by part."""
        lines = (f"{part}: {type(error).__name__}: {error}" for part, error in reasons.items())
        super().__init__("parts of the study failed, the others are kept; " + "; ".join(lines))
        self.rows = rows
        self.__cause__ = next(iter(reasons.values()))


def timed(met: bool, quick: bool) -> bool | str:
    """Whether a timing meets its bar; few repeats of small cases can say yes, but not no."""
    return "full run" if quick and not met else bool(met)


def answer(question: str, asked: str, measured: str, met: bool | str | None = None) -> Row:
    """A line of a study's closing summary; ``met`` is ``None`` where a figure has no bar."""
    return {
        "study": "summary",
        "question": question,
        "asked": asked,
        "measured": measured,
        "met": met if met is None or isinstance(met, str) else bool(met),
    }


def measure(
    calls: Mapping[str, Callable[[], object]],
    repeats: int = 5,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, dict[str, float]]:
    """Seconds of each call, the calls taken in turn (A B A B ...) after one warm-up each.

    Taking turns lets a drift of the machine's speed hit every competitor alike. Work of a single
    thread may be timed by ``time.process_time``, which leaves out what other programs take.

    Returns:
        Per name ``{"median", "low", "high"}``: median, minimum and maximum over the repeats [s].
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
