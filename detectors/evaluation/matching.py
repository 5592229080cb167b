"""The one rule by which alarms are counted, and metrics of a detector over many traces.

The rule holds for simulated and real arms:

* Alarms less than 0.2 s apart are one.
* A contact's window opens the error of its onset before the onset (:data:`ONSET_ERROR`) and closes
  0.5 s after it, or where the next contact's window opens.
* The first alarm that starts in the window finds the contact. If none does and an alarm is on when
  the window opens, the contact counts as ``still_up``: not found.
* Further alarms that start until 1 s after the release are repeats: neither found nor false.
* Every other alarm is false, for example one at a payload change. Collision-free time is exactly
  the time in which an alarm would be false.

How many contacts alarms find by chance is
measured by shifting them along the log (:func:`chance`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.events import ALARM_GAP, CASE_SECONDS, WINDOW, Interval
from tauguard.findings import ArgumentError
from tauguard.report import poisson_rate
from tauguard.report import rate as wilson
from tauguard.traces.trace import STRATA, Alarm, Collision, Detection, Trace, stratum

#: Error of a contact's onset [s], by the kind of its truth: the simulation; a switch on the hand; a
#: sensor's force, which passes 4 N before; an untouched run of the same program; a person's eye.
ONSET_ERROR = {
    "simulation": 0.0,
    "switch": 0.05,
    "sensor": 0.15,
    "same program": 0.05,
    "by eye": 0.15,
}


@dataclass(frozen=True)
class Rule:
    """Times of the rule [s]."""

    merge: float = ALARM_GAP  #: alarms less than this apart are one
    window: float = WINDOW  #: longest time from an onset to an alarm that finds the contact
    recover: float = 1.0  #: time after a release in which alarms are repeats
    shifts: int = 200  #: number of shifts for the result by chance


@dataclass(frozen=True)
class Contact:
    """A contact in a log."""

    onset: float  #: [s]
    end: float  #: release [s]
    truth: str = "simulation"  #: how it is known: a key of ONSET_ERROR
    moving: bool = False  #: whether touched joints moved

    def __post_init__(self) -> None:
        """``ArgumentError`` for times out of order or an unknown kind of truth."""
        if not self.onset <= self.end:
            raise ArgumentError(f"contact: onset {self.onset} s after its end {self.end} s")
        if self.truth not in ONSET_ERROR:
            raise ArgumentError(f"contact: truth {self.truth!r}: one of {', '.join(ONSET_ERROR)}")

    @property
    def opens(self) -> float:
        """Earliest time of an alarm that finds it [s]."""
        return self.onset - ONSET_ERROR[self.truth]


@dataclass(frozen=True)
class Count:
    """Alarms of one log, counted by the rule."""

    contacts: tuple[Contact, ...]  #: those that are judged
    delays: tuple[float, ...]  #: from the onset to the alarm that finds each [s]; inf: none does
    still_up: tuple[bool, ...]  #: whether an alarm was on instead when each window opened
    by_chance: tuple[float, ...]  #: fraction of the shifts that find each
    false_alarms: tuple[Alarm, ...]
    repeats: tuple[Alarm, ...]
    free: tuple[Interval, ...] = field(repr=False)  #: where an alarm would be false [s]

    @property
    def free_seconds(self) -> float:
        """Time in which an alarm would be false [s]."""
        return float(sum(high - low for low, high in self.free))


def merged(alarms: Iterable[Alarm], apart: float = Rule.merge) -> tuple[Alarm, ...]:
    """Alarms in order of time, those less than ``apart`` [s] apart as one."""
    out: list[Alarm] = []
    for alarm in sorted(alarms, key=lambda a: a.start):
        if out and alarm.start - out[-1].end < apart:
            out[-1] = Alarm(out[-1].start, max(out[-1].end, alarm.end))
        else:
            out.append(alarm)
    return tuple(out)


def windows(contacts: Sequence[Contact], rule: Rule) -> Array:
    """First and last time of each contact's window [s], shape (N, 2); contacts in order."""
    opens = np.array([contact.opens for contact in contacts])
    closes = np.array([contact.onset + rule.window for contact in contacts])
    closes[:-1] = np.minimum(closes[:-1], np.nextafter(opens[1:], -np.inf))
    return np.stack([opens, np.maximum(closes, opens)], axis=1)


def count(
    alarms: Iterable[Alarm], contacts: Iterable[Contact], span: Interval, rule: Rule | None = None
) -> Count:
    """Count the alarms of one log.

    Args:
        alarms: in any order; they are merged.
        contacts: all contacts of the log. Those whose window opens outside of ``span`` are not
            judged.
        span: first and last time that counts [s], for example after a detector has settled. Alarms
            that start outside are left out.
        rule: default: the rule of all tables.
    """
    begin, end = span
    if not begin <= end:
        raise ArgumentError(f"span {span} s: expected begin <= end")
    rule = rule or Rule()
    every = merged(alarms, rule.merge)
    inner = [alarm for alarm in every if begin <= alarm.start <= end]
    starts = np.array([alarm.start for alarm in inner])
    order = sorted(contacts, key=lambda contact: contact.onset)
    spans = windows(order, rule)
    judged = [k for k, contact in enumerate(order) if begin <= contact.opens <= end]
    first = _first_in(starts, spans[judged])
    delays = first - np.array([order[k].onset for k in judged])
    still_up = [
        not np.isfinite(delay) and any(a.start < spans[k, 0] <= a.end for a in every)
        for k, delay in zip(judged, delays, strict=True)
    ]
    busy = [(c.opens, max(c.end + rule.recover, c.onset + rule.window)) for c in order]
    touched = [any(low <= alarm.start <= high for low, high in busy) for alarm in inner]
    finders = set(first[np.isfinite(first)].tolist())
    return Count(
        tuple(order[k] for k in judged),
        tuple(delays.tolist()),
        tuple(still_up),
        tuple(chance(starts, spans[judged], span, rule.shifts).tolist()),
        tuple(a for a, near in zip(inner, touched, strict=True) if not near),
        tuple(a for a, near in zip(inner, touched, strict=True) if near and a.start not in finders),
        tuple(collision_free(busy, span)),
    )


def _first_in(starts: Array, spans: Array) -> Array:
    """First of the sorted ``starts`` in each interval, shape (N,); inf: none is in it."""
    padded = np.append(starts, np.inf)
    first = padded[np.searchsorted(starts, spans[:, 0])]
    return np.asarray(np.where(first <= spans[:, 1], first, np.inf))


def chance(starts: Array, spans: Array, span: Interval, shifts: int = Rule.shifts) -> Array:
    """Fraction of circular shifts of the alarms in which an alarm starts in each window.

    Args:
        starts: sorted starts of the alarms [s], shape (K,).
        spans: windows [s], shape (N, 2).
        span: the time in which alarms can start [s]; shifted alarms stay in it.
        shifts: the shifts are this many equal steps of the span; the first is none.

    Returns:
        Shape (N,).
    """
    hits = np.zeros(len(spans))
    length = span[1] - span[0]
    for k in range(shifts if len(starts) and len(spans) and length > 0 else 0):
        moved = np.sort(span[0] + (starts - span[0] + length * k / shifts) % length)
        hits += np.isfinite(_first_in(moved, spans))
    return hits / max(shifts, 1)


@dataclass(frozen=True)
class Matching:
    """The matches of one simulated trace."""

    collisions: tuple[Collision, ...]
    delays: tuple[float | None, ...]  #: alarm start minus onset [s], None for a missed collision
    false_alarms: tuple[Alarm, ...]
    free_seconds: float  #: time in which an alarm would be false [s]
    cases: int  #: number of non-collision cases
    false_cases: int  #: number of non-collision cases with a false alarm


def match(alarms: Sequence[Alarm], collisions: Sequence[Collision], span: Interval) -> Matching:
    """Count the alarms of one simulated trace.

    Each interval of free time is divided into non-collision cases of :data:`CASE_SECONDS`,
    from its beginning; a shorter rest at its end does not count.

    Args:
        alarms: in any order.
        collisions: the truth.
        span: as in :func:`count`.
    """
    order = sorted(collisions, key=lambda collision: collision.onset)
    counted = count(alarms, [Contact(c.onset, c.end) for c in order], span, Rule(shifts=0))
    cases = [
        (low + k * CASE_SECONDS, low + (k + 1) * CASE_SECONDS)
        for low, high in counted.free
        for k in range(int((high - low) / CASE_SECONDS + 1e-9))
    ]
    touched = sum(
        any(a.start < high and a.end >= low for a in counted.false_alarms) for low, high in cases
    )
    return Matching(
        tuple(c for c in order if span[0] <= c.onset <= span[1]),
        tuple(delay if np.isfinite(delay) else None for delay in counted.delays),
        counted.false_alarms,
        counted.free_seconds,
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
