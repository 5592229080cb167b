"""The loop from sample to answer, and what is kept of it."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.faults.monitor import FAULT, Answer, Monitor
from tauguard.detectors.faults.spans import Spans
from tauguard.live.lateness import Lateness
from tauguard.live.stream import RobotStream, Sample, StreamClosed
from tauguard.traces.trace import Trace

#: Latencies are counted in bins of a microsecond, so many; what takes longer is in one more.
BINS = 100_000


@dataclass
class Session:
    """What was heard so far; its size does not grow with time unless samples are kept."""

    joint_names: tuple[str, ...]
    keep: bool = False  #: keep every sample that could be believed, for a recording
    samples: int = 0  #: that came, believed or not
    first: float = np.nan  #: robot's time of the first sample [s]
    last: float = np.nan  #: and of the last one
    spans: Spans = field(default_factory=Spans)
    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(BINS + 1, np.int64))
    """Samples by their latency from packet to answer, in microseconds."""
    slowest: int = 0  #: [ns]
    rows: list[Sample] = field(default_factory=list)
    scores: list[float] = field(default_factory=list)
    alarms: list[bool] = field(default_factory=list)
    ended: str = ""  #: why it ended

    def add(self, sample: Sample, answer: Answer, latency: int, said: Answer) -> None:
        """One sample.

        Args:
            sample: as it came.
            answer: the monitor's; a sample with a reason is not believed, and not kept.
            latency: [ns].
            said: the answer with the sample's lateness in it.
        """
        self.samples += 1
        self.counts[min(latency // 1000, BINS)] += 1
        self.slowest = max(self.slowest, latency)
        t = sample.t
        if not answer.reason:
            self.first = t if np.isnan(self.first) else self.first
            self.last = t
            if self.keep and (not self.rows or t > self.rows[-1].t):
                self.rows.append(sample)
                self.scores.append(answer.score)
                self.alarms.append(answer.alarm)
        self.spans.add(t, said)

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

    def quantiles(self) -> dict[str, float | None]:
        """Latency from packet to answer [us]: median, p99, p99.9, p99.99 and the largest.

        None: ``BINS`` microseconds or more, which are not told apart.
        """
        if not self.samples:
            return {}
        levels = {"median": 0.5, "p99": 0.99, "p99_9": 0.999, "p99_99": 0.9999}
        below = np.cumsum(self.counts) / self.samples
        bins = {name: int(np.searchsorted(below, q)) for name, q in levels.items()}
        found = {name: float(k + 1) if k < BINS else None for name, k in bins.items()}
        return found | {"max": self.slowest * 1e-3}


def listen(
    source: RobotStream,
    monitor: Monitor,
    seconds: float = np.inf,
    report: Callable[[Sample, Answer], None] | None = None,
    keep: bool = False,
) -> Session:
    """Ask the monitor about every sample until the source ends, the time is up, or Ctrl-C.

    Args:
        source: read, never commanded.
        monitor: made for its joints and rate.
        seconds: by this machine's clock.
        report: called after every answer; it must return at once (the latency does not count it).
        keep: keep the samples, for :meth:`Session.trace`.
    """
    heard, lateness = Session(source.joint_names, keep), Lateness(1 / source.rate)
    end = time.monotonic() + seconds
    last, most = time.monotonic(), lateness.most
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
            said = lateness.judge(answer, sample.t, 1e-9 * sample.arrived)
            heard.add(sample, answer, latency, said)
            last = time.monotonic()
            if report is not None:
                report(sample, said)
        heard.ended = f"{seconds:g} s are over"
    except StreamClosed as closed:
        heard.ended = str(closed)
    except KeyboardInterrupt:
        heard.ended = "ended by hand"
    finally:
        if collecting:
            gc.enable()
    return heard
