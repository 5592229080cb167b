"""Matching of alarms with collisions, and metrics of a detector over many traces.

A collision is detected by the first alarm that starts within 0.5 s after its onset or, if a clamp
lasts longer, before the clamp ends. Any other alarm is false, for example at a payload change.
An alarm that is on at the onset of a collision does not detect it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.events import CASE_SECONDS, Interval, detection_window, occupied
from tauguard.findings import ArgumentError
from tauguard.report import poisson_rate
from tauguard.report import rate as wilson
from tauguard.traces.trace import STRATA, Alarm, Collision, Detection, Trace, stratum


@dataclass(frozen=True)
class Matching:
    """The matches of one trace."""

    collisions: tuple[Collision, ...]
    delays: tuple[float | None, ...]  #: alarm start minus onset [s], None for a missed collision
    false_alarms: tuple[Alarm, ...]
    free_seconds: float  #: collision-free time [s]
    cases: int  #: number of non-collision cases
    false_cases: int  #: number of non-collision cases with a false alarm


def match(alarms: Sequence[Alarm], collisions: Sequence[Collision], span: Interval) -> Matching:
    """Match the alarms of one trace with its collisions.

    Each collision-free interval is divided into non-collision cases of :data:`CASE_SECONDS`, from
    its beginning; a shorter rest at its end does not count.

    Args:
        alarms: merged alarms, in order.
        collisions: the truth.
        span: first and last time that counts [s]; alarms and collisions that start before or
            after it are left out, for example while a detector settles.
    """
    begin, end = span
    if not begin <= end:
        raise ArgumentError(f"span {span} s: expected begin <= end")
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
        (low + k * CASE_SECONDS, low + (k + 1) * CASE_SECONDS)
        for low, high in free
        for k in range(int((high - low) / CASE_SECONDS + 1e-9))
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
    """The parts of ``span`` outside all of ``busy`` [s]."""
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
        skip: time at the beginning that does not count [s].

    Raises:
        ArgumentError: the trace has no truth, or the detection belongs to another trace.
    """
    if trace.truth is None:
        raise ArgumentError("trace has no truth to match a detection with")
    if detection.t.shape != trace.t.shape:
        raise ArgumentError(f"detection has {len(detection.t)} samples, the trace {len(trace.t)}")
    span = float(min(trace.t[0] + skip, trace.t[-1])), float(trace.t[-1])
    return match(detection.alarms, trace.truth.collisions, span)


def matchings(alarm: CollisionAlarm, traces: Iterable[Trace]) -> list[Matching]:
    """A detector's alarms on recordings, matched with their truth, one recording at a time.

    Raises:
        ArgumentError: a trace without truth, or with other joints or sample rate than the
            detector's.
    """
    return [match_detection(alarm.detect(trace), trace, alarm.settle) for trace in traces]


#: Least peak torque of the collisions in ``headline`` [N m].
HEADLINE = 16.0


def delay_metrics(delays: Iterable[float | None]) -> dict[str, Any]:
    """Median and 95th percentile of the detected collisions' delays [ms]."""
    known = np.array([d for d in delays if d is not None]) * 1e3
    if not len(known):
        return {"median": None, "p95": None, "n": 0}
    median, p95 = np.percentile(known, (50, 95))
    return {"median": float(median), "p95": float(p95), "n": len(known)}


def _severity(pairs: Sequence[tuple[float, float | None]]) -> dict[str, Any]:
    found = [delay is not None for _, delay in pairs]
    return {
        "sensitivity": wilson(sum(found), len(found)),
        "delay_ms": delay_metrics(delay for _, delay in pairs),
    }


def detection_metrics(matchings: Iterable[Matching]) -> dict[str, Any]:
    """All metrics over the given traces.

    Returns:
        ``confusion`` (tp, fn over collisions; fp, tn over non-collision cases), ``sensitivity``,
        ``specificity``, ``ppv``, ``accuracy`` (each value, low, high, n), ``delay_ms`` (median,
        p95, n), ``false_alarms_per_hour`` (of collision-free time), ``strata`` (by peak torque,
        each with sensitivity and delay) and ``headline`` (sensitivity and delay from 16 N m up).
    """
    several = list(matchings)
    pairs = [
        (collision.peak_tau, delay)
        for m in several
        for collision, delay in zip(m.collisions, m.delays, strict=True)
    ]
    tp = sum(delay is not None for _, delay in pairs)
    fn = len(pairs) - tp
    fp = sum(m.false_cases for m in several)
    tn = sum(m.cases for m in several) - fp
    alarms = sum(len(m.false_alarms) for m in several)
    hours = sum(m.free_seconds for m in several) / 3600
    names = [stratum(peak) for peak, _ in pairs]
    every = set(names) | {stratum(low) for low, _ in STRATA}
    order = sorted(every, key=lambda name: float(name.split("-")[0]))
    return {
        "confusion": {"tp": tp, "fn": fn, "fp": fp, "tn": tn},
        "sensitivity": wilson(tp, tp + fn),
        "specificity": wilson(tn, tn + fp),
        "ppv": wilson(tp, tp + fp),
        "accuracy": wilson(tp + tn, tp + fn + fp + tn),
        "delay_ms": delay_metrics(delay for _, delay in pairs),
        "false_alarms_per_hour": poisson_rate(alarms, hours),
        "strata": {
            name: _severity([p for p, own in zip(pairs, names, strict=True) if own == name])
            for name in order
        },
        "headline": _severity([p for p in pairs if p[0] >= HEADLINE]),
    }
