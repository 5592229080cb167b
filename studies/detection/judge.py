"""What a detector said of the detection study's pools, reduced episode by episode.

Ten hours are 36 million samples: an episode is simulated, scored by every detector, reduced to
alarms at the operating points and peaks of the score, and forgotten.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from studies.detection.pool import Struck
from studies.detection.thresholds import Fleet
from tauguard.arrays import Array
from tauguard.datasets.plans import BEGIN
from tauguard.detectors import find_alarms, match
from tauguard.detectors.evaluation.events import detection_window
from tauguard.traces import Collision, Trace


@dataclass(frozen=True)
class Outcome:
    """One judged collision and what the alarms said of it."""

    arm: int  #: mismatch seed
    payload_g: float
    collision: Collision
    delay: float | None  #: [s], None where it was missed
    peak: float = 0.0  #: highest level of the score while it could be detected


@dataclass
class Tally:
    """One detector at one operating point over some episodes."""

    outcomes: list[Outcome] = field(default_factory=list)
    cases: int = 0
    false_cases: int = 0
    false_alarms: int = 0
    free_seconds: float = 0.0

    def add(self, other: Tally) -> None:
        """Take the other's episodes in."""
        self.outcomes += other.outcomes
        self.cases += other.cases
        self.false_cases += other.false_cases
        self.false_alarms += other.false_alarms
        self.free_seconds += other.free_seconds


Tallies = dict[tuple[str, str], Tally]


def judge_free(fleet: Fleet, trace: Trace) -> Tallies:
    """False alarms and false cases of every detector at every point over a free trace."""
    span = (float(trace.t[0]) + BEGIN, float(trace.t[-1]))
    found: Tallies = {}
    for name, own in fleet.items():
        _, levels = own.sustained(trace)
        for point, threshold in own.thresholds.items():
            m = match(find_alarms(trace.t, levels[point] > threshold), (), span)
            found[name, point] = Tally(
                [], m.cases, m.false_cases, len(m.false_alarms), m.free_seconds
            )
    return found


def judge_struck(fleet: Fleet, struck: Struck) -> Tallies:
    """Delays of the collisions that count; alarms elsewhere are judged on free motion alone."""
    trace = struck.trace
    assert trace.truth is not None
    span = (float(trace.t[0]) + BEGIN, float(trace.t[-1]))
    inside = [span[0] <= c.onset <= span[1] for c in trace.truth.collisions]
    kept = [k for k, within in zip(struck.kept, inside, strict=True) if within]
    windows = [
        detection_window(c) for c, w in zip(trace.truth.collisions, inside, strict=True) if w
    ]
    found: Tallies = {}
    for name, own in fleet.items():
        plain, levels = own.sustained(trace)
        peaks = [_highest(plain[(trace.t >= a) & (trace.t <= b)]) for a, b in windows]
        for point, threshold in own.thresholds.items():
            alarms = find_alarms(trace.t, levels[point] > threshold)
            m = match(alarms, trace.truth.collisions, span)
            outcomes = [
                Outcome(struck.arm, struck.payload_g, c, d, peak)
                for c, d, k, peak in zip(m.collisions, m.delays, kept, peaks, strict=True)
                if k
            ]
            found[name, point] = Tally(outcomes)
    return found


def _highest(levels: Array) -> float:
    """The largest; -inf of none: a brief touch can lie between two samples of a slow log."""
    return float(levels.max(initial=-np.inf))


def merged(parts: Iterable[Tallies]) -> Tallies:
    """All episodes' tallies together, detector by detector and point by point."""
    total: Tallies = {}
    for part in parts:
        for key, tally in part.items():
            total.setdefault(key, Tally()).add(tally)
    return total
