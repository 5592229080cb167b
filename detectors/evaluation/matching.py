"""From a boolean series to alarms, and from alarms to detected collisions and false alarms.

An alarm is a maximal run of True; alarms less than 0.5 s apart are one. An alarm that starts
between onset and onset + 0.5 s (clamping: or its end, if that is later) detects that collision,
and the first one counts. Any other alarm is false, one during a payload change too; an alarm
already up at onset is false and detects nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.events import CASE_SECONDS, Interval, detection_window, occupied
from tauguard.traces.trace import Alarm, Collision, Detection, Trace


@dataclass(frozen=True)
class Matching:
    """The matches of one trace."""

    collisions: tuple[Collision, ...]
    delays: tuple[float | None, ...]  #: alarm start less onset [s], None for a missed collision
    false_alarms: tuple[Alarm, ...]
    free_seconds: float  #: collision-free time [s]
    cases: int  #: non-collision cases
    false_cases: int  #: of them, those that a false alarm touches


def match(
    alarms: Sequence[Alarm],
    collisions: Sequence[Collision],
    span: Interval,
    case_seconds: float = CASE_SECONDS,
) -> Matching:
    """Match the alarms of one trace with its collisions.

    A non-collision case is ``case_seconds`` of collision-free time. Every collision-free stretch is
    cut into such cases from its beginning; a shorter rest at its end does not count.

    Args:
        alarms: merged alarms, in order.
        collisions: the truth.
        span: first and last time that counts [s]; alarms and collisions that start before or
            after it are left out (a detector settles in the beginning).
        case_seconds: length of a non-collision case [s].
    """
    begin, end = span
    if not (begin <= end and case_seconds > 0):
        raise ValueError(
            f"span {span} s, case_seconds {case_seconds} s: expected begin <= end "
            "and case_seconds > 0"
        )
    inside = [c for c in collisions if begin <= c.onset <= end]
    inner = [a for a in alarms if begin <= a.start <= end]
    delays: list[float | None] = []
    useful: set[int] = set()
    for collision in inside:
        low, high = detection_window(collision)
        hits = [k for k, a in enumerate(inner) if low <= a.start <= high]
        useful.update(hits)
        up_before = any(a.start < low <= a.end for a in alarms)
        delays.append(None if up_before or not hits else inner[hits[0]].start - low)
    false_alarms = tuple(a for k, a in enumerate(inner) if k not in useful)
    free = collision_free([occupied(c) for c in collisions], span)
    cases = [
        (low + k * case_seconds, low + (k + 1) * case_seconds)
        for low, high in free
        for k in range(int((high - low) / case_seconds + 1e-9))
    ]
    touched = sum(any(a.start < high and a.end >= low for a in false_alarms) for low, high in cases)
    return Matching(
        tuple(inside),
        tuple(delays),
        false_alarms,
        float(sum(high - low for low, high in free)),
        len(cases),
        touched,
    )


def collision_free(busy: Sequence[Interval], span: Interval) -> list[Interval]:
    """The stretches of ``span`` outside all of ``busy`` [s]."""
    free, now = [], span[0]
    for low, high in sorted(busy):
        if low > now and now < span[1]:
            free.append((now, min(low, span[1])))
        now = max(now, high)
    if now < span[1]:
        free.append((now, span[1]))
    return free


def match_detection(detection: Detection, trace: Trace, skip: float = 0.0) -> Matching:
    """Match a detection with its trace's truth.

    Args:
        detection: detection of this trace.
        trace: with truth.
        skip: seconds at the beginning that do not count.

    Raises:
        ValueError: the trace has no truth, or the detection belongs to another trace.
    """
    if trace.truth is None:
        raise ValueError("trace has no truth to match a detection with")
    if detection.t.shape != trace.t.shape:
        raise ValueError(f"detection has {len(detection.t)} samples, the trace {len(trace.t)}")
    span = float(min(trace.t[0] + skip, trace.t[-1])), float(trace.t[-1])
    return match(detection.alarms, trace.truth.collisions, span)


def matchings(alarm: CollisionAlarm, traces: Iterable[Trace]) -> list[Matching]:
    """A detector's alarms on recordings, matched with their truth; one recording in memory.

    Raises:
        ValueError: a trace without truth, or one that the detector does not take.
    """
    return [match_detection(alarm.detect(trace), trace, alarm.settle) for trace in traces]
