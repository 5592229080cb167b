"""A log as a live stream: its samples arrive at the recorded times."""

import time

from tauguard.findings import ArgumentError
from tauguard.live.stream import Closing, Sample, StreamClosed
from tauguard.traces.trace import Trace


class PlayedStream(Closing):
    """A trace that is replayed, by default in real time.

    Args:
        trace: the trace to replay.
        pace: multiple of real time; inf: as fast as it is read.
    """

    def __init__(self, trace: Trace, pace: float = 1.0) -> None:
        """The clock starts at the first :meth:`read`."""
        if not pace > 0:
            raise ArgumentError(f"pace: {pace}, expected above 0")
        self.trace, self.pace = trace, pace
        self.joint_names, self.rate = trace.joint_names, 1 / trace.dt
        self.events: list[str] = []
        self._next = 0
        self._began = 0.0

    def read(self, timeout: float) -> Sample | None:
        """Wait for the time of the next sample and return it; None after ``timeout`` seconds.

        Raises:
            StreamClosed: the trace is over.
        """
        k, trace = self._next, self.trace
        if k >= len(trace.t):
            raise StreamClosed("the log is over")
        now = time.monotonic()
        if k == 0:
            self._began = now
        wait = self._began + (trace.t[k] - trace.t[0]) / self.pace - now
        if wait > timeout:
            time.sleep(timeout)
            return None
        if wait > 0:
            time.sleep(wait)
        self._next = k + 1
        return Sample(
            float(trace.t[k]), trace.q[k], trace.qd[k], trace.current[k], time.monotonic_ns()
        )

    def close(self) -> None:
        """End the stream."""
        self._next = len(self.trace.t)
