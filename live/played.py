"""A log as a live source: its samples at their own pace."""

import time

from tauguard.live.stream import Closing, Sample, StreamClosed
from tauguard.traces.trace import Trace


class PlayedStream(Closing):
    """A trace played as if it were happening now.

    Args:
        trace: what is played.
        pace: times real time; inf: as fast as it is read.
    """

    def __init__(self, trace: Trace, pace: float = 1.0) -> None:
        """Nothing runs before the first :meth:`read`."""
        if not pace > 0:
            raise ValueError(f"pace: {pace}, expected above 0")
        self.trace, self.pace = trace, pace
        self.joint_names, self.rate = trace.joint_names, 1 / trace.dt
        self.events: list[str] = []
        self._next = 0
        self._began = 0.0

    def read(self, timeout: float) -> Sample | None:
        """The next sample when its time has come, or None if that is after ``timeout`` seconds.

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
        """No more samples."""
        self._next = len(self.trace.t)
