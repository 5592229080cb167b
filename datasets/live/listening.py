"""The loop from sample to answer, and what is kept of it."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tauguard.datasets.live.lateness import Lateness, most_behind
from tauguard.datasets.live.sample import LiveSource, Sample, SourceClosed
from tauguard.detectors.faults.monitor import COLLISION, FAULT, Answer, Monitor
from tauguard.detectors.faults.spans import Spans
from tauguard.traces.trace import Trace

Array = NDArray[np.float64]

#: Latencies are counted in bins of a microsecond, up to so many; longer ones are in the last.
BINS = 100_000


@dataclass
class Heard:
    """What was heard so far; its size does not grow with time unless samples are kept."""

    joint_names: tuple[str, ...]
    keep: bool = False  #: keep every sample that could be believed, for a recording
    samples: int = 0  #: that came, believed or not
    first: float = np.nan  #: robot's time of the first sample [s]
    last: float = np.nan  #: and of the last one
    spans: Spans = field(default_factory=Spans)
    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(BINS, np.int64))
    """Samples by their latency from packet to answer, in microseconds."""
    slowest: int = 0  #: [ns]
    rows: list[Sample] = field(default_factory=list)
    scores: list[float] = field(default_factory=list)
    alarms: list[bool] = field(default_factory=list)
    ended: str = ""  #: why it ended

    def add(self, sample: Sample, answer: Answer, latency: int, late: float = 0.0) -> None:
        """One sample with its answer; ``late`` [s] is above 0 where it came too late."""
        self.samples += 1
        self.counts[min(latency // 1000, BINS - 1)] += 1
        self.slowest = max(self.slowest, latency)
        t = sample.t
        if not answer.reason:
            self.first = t if np.isnan(self.first) else self.first
            self.last = t
            if self.keep and (not self.rows or t > self.rows[-1].t):
                self.rows.append(sample)
                self.scores.append(answer.score)
                self.alarms.append(answer.alarm)
        self.spans.add(t, told_late(answer, late) if late else answer)

    def silent(self, seconds: float) -> None:
        """Nothing came for ``seconds``; before the first sample that is no fault."""
        if np.isnan(self.last):
            return
        self.spans.mark(FAULT, True, self.last, f"silent: no sample for {1e3 * seconds:.0f} ms")

    def trace(self) -> Trace:
        """The believed samples as a trace."""
        rows = self.rows
        return Trace(
            self.joint_names,
            np.array([r.t for r in rows]),
            np.array([r.q for r in rows]),
            np.array([r.qd for r in rows]),
            np.array([r.current for r in rows]),
        )

    def quantiles(self) -> dict[str, float]:
        """Latency from packet to answer [us]: median, p99, p99.9, p99.99 and the largest."""
        if not self.samples:
            return {}
        levels = {"median": 0.5, "p99": 0.99, "p99_9": 0.999, "p99_99": 0.9999}
        below = np.cumsum(self.counts) / self.samples
        found = {name: float(np.searchsorted(below, q) + 1) for name, q in levels.items()}
        return found | {"max": self.slowest * 1e-3}


def told_late(answer: Answer, late: float) -> Answer:
    """An answer that comes too late: no collision is not "free", as the robot is further on."""
    if answer.reason:
        return answer
    reason = f"late: the samples are {1e3 * late:.0f} ms behind the robot"
    return replace(answer, state=COLLISION if answer.alarm else FAULT, reason=reason)


def listen(
    source: LiveSource,
    monitor: Monitor,
    seconds: float = np.inf,
    report: Callable[[Sample, Answer], None] | None = None,
    keep: bool = False,
) -> Heard:
    """Ask the monitor about every sample until the source ends, the time is up, or Ctrl-C.

    Args:
        source: read, never commanded.
        monitor: made for its joints and rate.
        seconds: by this machine's clock.
        report: called after every answer; it must return at once (the latency does not count it).
        keep: keep the samples, for :meth:`Heard.trace`.
    """
    heard, lateness = Heard(source.joint_names, keep), Lateness()
    end = time.monotonic() + seconds
    last, most = time.monotonic(), most_behind(1 / source.rate)
    collecting = gc.isenabled()
    gc.disable()  # a collection would come between a packet and its answer
    try:
        while (now := time.monotonic()) < end:
            sample = source.read(min(most, end - now))
            if sample is None:
                if time.monotonic() - last > most:
                    heard.silent(time.monotonic() - last)
                continue
            answer = monitor.step(sample.t, sample.q, sample.qd, sample.current)
            latency = time.monotonic_ns() - sample.arrived
            late = lateness.step(sample.t, 1e-9 * sample.arrived)
            late = late if late > most else 0.0
            heard.add(sample, answer, latency, late)
            last = time.monotonic()
            if report is not None:
                report(sample, told_late(answer, late) if late else answer)
        heard.ended = f"{seconds:g} s are over"
    except SourceClosed as closed:
        heard.ended = str(closed)
    except KeyboardInterrupt:
        heard.ended = "ended by hand"
    finally:
        if collecting:
            gc.enable()
    return heard
