"""Definition of an alarm, and the collision-free rows of a trace.

The alarm series is True where the score has been above the threshold for the confirmation time t_c.
An alarm is a maximal run of True; alarms close to each other are one. An alarm detects a collision
if it starts between the onset and 0.5 s later; :mod:`~tauguard.detectors.evaluation.matching` has
the whole rule.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array, Bools, runs
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Alarm, Collision, Trace

#: Default t_c [s] (Park et al. 2021; the dissertation's value).
CONFIRMATION = 3e-3


def confirmation_samples(confirmation: float, dt: float) -> int:
    """Number of successive True samples for a confirmation time at sample interval ``dt`` [s].

    A sample stands for the interval that ends with it, so n samples last n dt. At least one.
    """
    if not (np.isfinite(confirmation) and confirmation >= 0 and dt > 0):
        raise ArgumentError(f"confirmation {confirmation} s and dt {dt} s: expected >= 0 and > 0")
    return max(1, round(confirmation / dt))


def confirmed(raw: ArrayLike, samples: int) -> Bools:
    """True where the last ``samples`` entries of ``raw`` are all True, shape (T,)."""
    if samples < 1:
        raise ArgumentError(f"samples: {samples}, expected 1 or more")
    truth = np.asarray(raw, dtype=np.bool_)
    if truth.ndim != 1:
        raise ArgumentError(f"raw: shape {truth.shape}, expected (T,)")
    index = np.arange(len(truth))
    last_false = np.maximum.accumulate(np.where(truth, -1, index))
    return np.asarray(index - last_false >= samples)


def sustained(score: Array, samples: int) -> Array:
    """Least of the last ``samples`` scores, shape (T,)."""
    if samples <= 1:
        return score
    padded = np.concatenate((np.full(samples - 1, -np.inf), score))
    lowest: Array = np.lib.stride_tricks.sliding_window_view(padded, samples).min(axis=-1)
    return lowest


#: Alarms less than this apart are one [s]. The false-alarm rate depends on it by up to a factor 4.
ALARM_GAP = 0.2
#: Contacts of one link less than this apart are one collision; of scores without a contact, one
#: peak in each block of this length is used [s].
MERGE_GAP = 0.5
#: Longest time from the onset of a collision to an alarm that detects it [s].
WINDOW = 0.5
#: Time after a collision that does not count as collision-free [s].
RECOVER = 0.5

#: Length of a non-collision case [s].
CASE_SECONDS = 2.0

Interval = tuple[float, float]


def find_alarms(t: ArrayLike, alarm: ArrayLike, merge_gap: float = ALARM_GAP) -> tuple[Alarm, ...]:
    """Maximal runs of True, those less than ``merge_gap`` [s] apart as one.

    Args:
        t: times [s], shape (T,).
        alarm: the filtered series, shape (T,).
        merge_gap: [s].

    Returns:
        Alarms in order; start and end are the times of the first and last True.
    """
    times, up = np.asarray(t, dtype=np.float64), np.asarray(alarm, dtype=np.bool_)
    if times.shape != up.shape or times.ndim != 1:
        raise ArgumentError(
            f"t and alarm: shapes {times.shape} and {up.shape}, expected (T,) twice"
        )
    starts, after = runs(up).T
    if not len(starts):
        return ()
    starts, ends = times[starts], times[after - 1]
    apart = starts[1:] - ends[:-1] >= merge_gap
    first = np.concatenate(([True], apart))
    last = np.concatenate((apart, [True]))
    pairs = zip(starts[first], ends[last], strict=True)
    return tuple(Alarm(float(start), float(end)) for start, end in pairs)


def detection_window(collision: Collision) -> Interval:
    """First and last time at which an alarm that detects ``collision`` can start [s]."""
    return collision.onset, collision.onset + WINDOW


def occupied(collision: Collision) -> Interval:
    """First and last time of contact and detection window together [s]."""
    return collision.onset, max(collision.end, detection_window(collision)[1])


def free_rows(trace: Trace, settle: float = 1.0, recover: float = RECOVER) -> Bools:
    """Rows outside all known collisions.

    Args:
        trace: a trace without truth counts as collision-free.
        settle: time to leave out at the beginning [s].
        recover: time to leave out after each collision [s].
    """
    free = trace.t >= trace.t[0] + settle
    for collision in trace.truth.collisions if trace.truth else ():
        low, high = occupied(collision)
        free &= ~((trace.t >= low - 0.05) & (trace.t <= high + recover))
    return np.asarray(free)


def undisturbed_rows(traces: Sequence[Trace], settle: float) -> list[Bools]:
    """Collision-free rows for training, shape (T,) for each trace.

    After a collision, the estimated payload is wrong and is corrected within the time ``settle``.
    Rows within that time are left out, because their residual can be 80 times as large as
    elsewhere. If all rows are that close to a collision, all rows outside collisions are used.

    Args:
        traces: recordings; every row of a trace without truth counts as collision-free.
        settle: time that the estimator needs to settle [s].
    """
    found = [free_rows(trace, settle, max(settle, RECOVER)) for trace in traces]
    if any(rows.any() for rows in found):
        return found
    return [free_rows(trace, settle) for trace in traces]
