"""Stretches of collision and fault, from one answer a sample."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tauguard.detectors.faults.inputs import SPAN
from tauguard.detectors.faults.monitor import COLLISION, FAULT, Answer

#: Spans of one state less than this apart are one [s].
MERGED = 0.2


@dataclass
class Span:
    """A stretch of collision or fault, by the robot's clock."""

    state: str  #: "collision" or "fault"
    start: float  #: [s]
    end: float  #: [s]
    reason: str = ""  #: of a fault, its first
    score: float = 0.0  #: of a collision, its largest


@dataclass
class Spans:
    """The spans so far; a collision that began within 20 ms before a fault was the fault's own."""

    found: list[Span] = field(default_factory=list)
    _open: dict[str, Span] = field(default_factory=dict)

    def add(self, t: float, answer: Answer) -> None:
        """One sample's answer; ``t`` is its time [s]."""
        if answer.state == FAULT:
            self._take_back(t)
        self.mark(COLLISION, answer.alarm, t, "")
        if answer.alarm and (span := self._open.get(COLLISION)) is not None:
            span.score = max(span.score, answer.score)
        self.mark(FAULT, bool(answer.reason), t, answer.reason)

    def of(self, state: str) -> list[Span]:
        """Those of one state, in order."""
        return [span for span in self.found if span.state == state]

    def mark(self, state: str, up: bool, t: float, reason: str) -> None:
        """Open, prolong or close the span of one state."""
        span = self._open.get(state)
        if up and span is None and not np.isfinite(t):
            return  # it begins with the next time that is a number
        if up and span is None:
            last = next((span for span in reversed(self.found) if span.state == state), None)
            if last is not None and t - last.end < MERGED:
                last.end = t
            else:
                last = Span(state, t, t, reason)
                self.found.append(last)
            self._open[state] = last
        elif up and span is not None:
            span.end = t if np.isfinite(t) else span.end
        elif span is not None:
            del self._open[state]

    def _take_back(self, t: float) -> None:
        """Forget a collision that began just before a fault."""
        span = self._open.get(COLLISION)
        if span is not None and not t - span.start > SPAN:
            self.found.remove(span)
            del self._open[COLLISION]
