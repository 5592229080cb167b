"""The loop that gives each sample to the detector, and the record of a session.

A separate thread detects silence. The state is a fault when no sample has come for 20 ms (or 2.5
sample intervals), even if the stream blocks, reconnects or receives other packets.
"""

import gc
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.alarms.monitor import COLLISION, FAULT, Answer, Monitor, Span, Spans
from tauguard.live.lateness import Lateness
from tauguard.live.stream import RobotStream, Sample, StreamClosed
from tauguard.traces.trace import Trace

#: Number of bins of the latency histogram, 1 us each; one more bin holds longer latencies.
BINS = 100_000
#: The answer before the first sample.
NONE_YET = Answer(FAULT, False, 0.0, "no samples")
#: Called with every sample and its answer, and during silence with an empty sample.
Report = Callable[[Sample, Answer], None]


@dataclass
class Silence:
    """A period without samples that was a fault."""

    after: float  #: robot's time of the previous sample [s]; nan: there was none
    seconds: float  #: duration by this machine's clock [s]

    @property
    def reason(self) -> str:
        """The reason as the display and the summary show it."""
        return f"no samples: nothing for {self.seconds:.3g} s"


@dataclass
class Session:
    """The record of a session; its size does not grow with time unless samples are kept."""

    joint_names: tuple[str, ...]
    keep: bool = False  #: keep every sample without a fault, for a recording
    samples: int = 0  #: number of all samples
    first: float = np.nan  #: robot's time of the first sample without a fault [s]
    last: float = np.nan  #: robot's time of the last sample without a fault [s]
    answer: Answer = NONE_YET  #: the latest answer
    spans: Spans = field(default_factory=Spans)  #: collisions, and faults of samples
    silences: list[Silence] = field(default_factory=list)
    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(BINS + 1, np.int64))
    """Samples by their latency from packet to answer, in microseconds."""
    slowest: int = 0  #: largest latency [ns]
    rows: list[Sample] = field(default_factory=list)
    scores: list[float] = field(default_factory=list)
    alarms: list[bool] = field(default_factory=list)
    ended: str = ""  #: why the session ended
    lost: bool = False  #: the session ended because the connection broke
    _silence: Silence | None = None  #: the present silence
    _now: float = np.nan  #: latest robot's time that differed from the one before [s]
    _told: int = 0  #: this machine's clock when that time arrived [ns]
    _at: float = np.nan
    """Robot's time of the last sample, extrapolated while its stamps repeat [s]."""

    def add(self, sample: Sample, answer: Answer, latency: int, said: Answer) -> None:
        """Record one sample.

        Args:
            sample: the sample as received.
            answer: the monitor's answer; a sample with a fault is not kept.
            latency: time from packet to answer [ns].
            said: the reported answer: ``answer``, or a fault if the sample was late.
        """
        self.samples += 1
        self.counts[min(latency // 1000, BINS)] += 1
        self.slowest = max(self.slowest, latency)
        self._silence = None
        t = sample.t
        if np.isfinite(t) and t != self._now:
            self._now, self._told = t, sample.arrived
        if not answer.reason:
            self.first = t if np.isnan(self.first) else self.first
            self.last = t
            if self.keep and (not self.rows or t > self.rows[-1].t):
                self.rows.append(sample)
                self.scores.append(answer.score)
                self.alarms.append(answer.alarm)
        self.answer = said
        self._at = self._now + 1e-9 * (sample.arrived - self._told)
        self.spans.add(self._at, said)

    def silent(self, seconds: float) -> tuple[Sample, Answer]:
        """Record that no sample has arrived for ``seconds``.

        Returns:
            A sample without values at the present time of the robot, and the answer: a fault, or
            the collision whose alarm was active when the samples ended.
        """
        if self._silence is None:
            self._silence = Silence(self._at, seconds)
            self.silences.append(self._silence)
        self._silence.seconds = seconds
        alarm = self.answer.alarm
        state = COLLISION if alarm else FAULT
        self.answer = Answer(state, alarm, self.answer.score, self._silence.reason)
        nothing = np.full(len(self.joint_names), np.nan)
        sample = Sample(
            self._silence.after + seconds, nothing, nothing, nothing, time.monotonic_ns()
        )
        return sample, self.answer

    def close(self, why: str, lost: bool) -> None:
        """Record that the source ended; the state is then a fault, unless an alarm is active."""
        self.ended, self.lost = why, lost
        if not self.answer.alarm and self._silence is None:
            self.answer = self.answer._replace(state=FAULT, reason=f"no samples: {why}")

    @property
    def state(self) -> str:
        """The last state with its reason, such as "free" or "fault: no samples: ..."."""
        return ": ".join(filter(None, (self.answer.state, self.answer.reason)))

    def faults(self) -> list[Span]:
        """Faults of samples and silences, in order, by the robot's clock [s].

        A silence before the first sample ends with it; if no sample ever came, it begins at 0.
        """
        silent = []
        for one in self.silences:
            start = one.after
            if np.isnan(start):
                start = 0.0 if np.isnan(self.first) else self.first - one.seconds
            silent.append(Span(FAULT, start, start + one.seconds, one.reason))
        return sorted([*self.spans.of(FAULT), *silent], key=lambda span: span.start)

    def trace(self) -> Trace:
        """The kept samples as a trace."""
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

        A quantile is None if it is ``BINS`` microseconds or more.
        """
        if not self.samples:
            return {}
        levels = {"median": 0.5, "p99": 0.99, "p99_9": 0.999, "p99_99": 0.9999}
        below = np.cumsum(self.counts) / self.samples
        bins = {name: int(np.searchsorted(below, q)) for name, q in levels.items()}
        found = {name: float(k + 1) if k < BINS else None for name, k in bins.items()}
        return found | {"max": self.slowest * 1e-3}


class _SilenceClock:
    """A thread that marks a fault when no sample has come for ``most`` seconds.

    The thread that reads samples writes to the same record; a lock keeps reports in order.
    """

    def __init__(self, session: Session, most: float, report: Report) -> None:
        self._session, self._most, self._report = session, most, report
        self._lock, self._over = threading.Lock(), threading.Event()
        self._last = time.monotonic()
        self._failed: Exception | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)

    def heard(self, sample: Sample, answer: Answer, latency: int, said: Answer) -> None:
        """Record and report one sample."""
        with self._lock:
            self._last = time.monotonic()
            self._session.add(sample, answer, latency, said)
            self._report(sample, said)

    def _check_silence(self) -> float:
        """Record and report a silence, if there is one. Returns the seconds to the next check."""
        with self._lock:
            since = time.monotonic() - self._last
            if since < self._most:
                return self._most - since
            silence = self._session.silent(since)
            if self._failed is None:
                try:
                    self._report(*silence)
                except Exception as error:  # silence is recorded all the same
                    self._failed = error
            return self._most

    def check(self) -> None:
        """Raise the exception that a report raised in the thread of the silence clock."""
        if self._failed is not None:
            raise self._failed

    def _run(self) -> None:
        while not self._over.wait(self._check_silence()):
            pass

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()
        self._check_silence()  # a silence lasts until the end of the session


def listen(
    stream: RobotStream,
    monitor: Monitor,
    seconds: float = np.inf,
    report: Report | None = None,
    keep: bool = False,
) -> Session:
    """Give every sample to the monitor until the stream ends, the time is over, or Ctrl-C.

    Args:
        stream: the robot's stream; the robot is never commanded.
        monitor: made for the stream's joints and rate.
        seconds: duration by this machine's clock.
        report: called after every answer, and repeatedly during silence (with a sample of NaN, from
            another thread, but never from two at a time). It must return at once; the latency does
            not include it. If it raises an exception, the session ends.
        keep: keep the samples, for :meth:`Session.trace`.
    """
    session, lateness = Session(stream.joint_names, keep), Lateness(1 / stream.rate)
    end = time.monotonic() + seconds
    collecting = gc.isenabled()
    gc.disable()  # garbage collection would delay answers
    try:
        with _SilenceClock(
            session, lateness.most, report or (lambda sample, answer: None)
        ) as clock:
            while (now := time.monotonic()) < end:
                sample = stream.read(min(lateness.most, end - now))
                clock.check()
                if sample is None:
                    continue
                answer = monitor.step(sample.t, sample.q, sample.qd, sample.current)
                latency = time.monotonic_ns() - sample.arrived
                said = lateness.judge(answer, sample.t, 1e-9 * sample.arrived)
                clock.heard(sample, answer, latency, said)
            session.ended = f"{seconds:g} s are over"
    except StreamClosed as closed:
        session.close(str(closed), closed.lost)
    except KeyboardInterrupt:
        session.ended = "ended by hand"
    finally:
        if collecting:
            gc.enable()
    return session
