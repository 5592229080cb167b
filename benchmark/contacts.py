"""What is known about contacts in the published logs: a sensor, a switch, or a table of onsets."""

from __future__ import annotations

import csv
import functools
from pathlib import Path

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.evaluation.matching import Contact
from tauguard.traces.logs import Log

#: A push begins above and ends below these forces of a sensor, and its peak is above PEAK [N].
BEGINS, ENDS, PEAK = 4.0, 2.0, 5.0
#: Least time between two pushes at a sensor [s].
APART = 0.3
#: A joint that is faster moves [rad/s].
MOVES = 0.05


def contacts_of(log: Log, path: Path) -> tuple[Contact, ...]:
    """The contacts of a log in its own time.

    They come from the label column of a switch on the hand, from the force sensor's columns, or
    from ``contacts.csv``, which says how each is known.
    """
    trace = log.trace
    if log.labels is not None:
        return tuple(Contact(first, last, "switch") for first, last in log.labels)
    table = np.genfromtxt(path, delimiter=",", names=True)
    if "Fx" in (table.dtype.names or ()):
        force = np.sqrt(sum(table[f"F{axis}"] ** 2 for axis in "xyz"))
        return tuple(
            Contact(
                float(trace.t[first]),
                float(trace.t[last]),
                "sensor",
                bool((np.abs(trace.qd[first:peak]) > MOVES).any()),
            )
            for first, last in sensor_spans(trace.t, force)
            if force[peak := first + int(np.argmax(force[first:last]))] > PEAK
        )
    begin = float(trace.t[0])
    return tuple(
        Contact(begin + onset, begin + end, truth, state == "moving")
        for onset, end, state, truth in tabulated().get(log.name, ())
    )


@functools.cache
def tabulated() -> dict[str, list[tuple[float, float, str, str]]]:
    """Onset, end [s from the log's first sample], state and truth of contacts without a sensor."""
    by_log: dict[str, list[tuple[float, float, str, str]]] = {}
    lines = Path(__file__).with_name("contacts.csv").read_text("utf-8").splitlines()
    for row in csv.DictReader(line for line in lines if not line.startswith("#")):
        contact = float(row["onset"]), float(row["end"]), row["state"], row["truth"]
        by_log.setdefault(row["log"], []).append(contact)
    return by_log


def sensor_spans(t: Array, force: Array) -> list[tuple[int, int]]:
    """First and last row of each push that a sensor shows: from 4 N on until below 2 N.

    A push begins at least 0.3 s after the end of the previous one. ``t`` [s] and the norm of the
    force [N] have shape (T,).
    """
    spans: list[tuple[int, int]] = []
    for row in np.flatnonzero((force[1:] > BEGINS) & (force[:-1] <= BEGINS)) + 1:
        below = np.flatnonzero(force[row:] < ENDS)
        first, last = int(row), int(row + below[0] if len(below) else len(t) - 1)
        if last > first and (not spans or t[first] >= t[spans[-1][1]] + APART):
            spans.append((first, last))
    return spans
