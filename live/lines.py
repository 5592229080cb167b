"""Samples from lines of text that another program pipes in."""

import selectors
import time
from collections.abc import Sequence
from typing import TextIO

import numpy as np

from tauguard.findings import ArgumentError
from tauguard.live.stream import Closing, Sample, StreamClosed, add_event

#: Largest length of a line [bytes].
LONGEST = 1 << 16


class LineStream(Closing):
    """Each line is one sample: the time, then all q, all qd and all currents, separated by commas.

    Args:
        stream: an open file such as ``sys.stdin``; its file descriptor is read.
        joint_names: names of the joints, in the order of the columns.
        rate: expected sample rate [Hz].
    """

    def __init__(self, stream: TextIO, joint_names: Sequence[str], rate: float) -> None:
        """Nothing is read before the first :meth:`read`."""
        self.joint_names, self.rate = tuple(joint_names), rate
        self.events: list[str] = []
        self._file, self._pending, self._lines = stream, b"", 0
        self._ready = selectors.SelectSelector()  # epoll refuses files
        self._ready.register(stream, selectors.EVENT_READ)

    def read(self, timeout: float) -> Sample | None:
        """The sample of the next line, or None if none came within ``timeout`` seconds.

        A line that is no sample is listed as an event and returned as NaN, a fault to the monitor.

        Raises:
            StreamClosed: the stream has ended, or a line has no end.
            ArgumentError: the first line is no sample.
        """
        deadline = time.monotonic() + timeout
        left = timeout
        while b"\n" not in self._pending:
            if left < 0 or not self._ready.select(left):
                return None
            left = deadline - time.monotonic()
            data = self._file.buffer.raw.read(65536)  # type: ignore[attr-defined]
            if data is None:  # another process read it, or made the input non-blocking
                continue
            if not data:
                if self._pending.strip():  # its last number may be cut
                    add_event(self.events, f"line {self._lines + 1} has no end and was left out")
                    self._pending = b""
                raise StreamClosed("the input has ended")
            self._pending += data
            if len(self._pending) > LONGEST and b"\n" not in self._pending:
                raise StreamClosed(
                    f"line {self._lines + 1}: more than {LONGEST} bytes without an end", lost=True
                )
        arrived = time.monotonic_ns()
        line, _, self._pending = self._pending.partition(b"\n")
        self._lines += 1
        return self._sample(line, arrived)

    def _sample(self, line: bytes, arrived: int) -> Sample:
        n = len(self.joint_names)
        try:
            values = np.array([float(cell) for cell in line.split(b",")])
        except ValueError:
            values = np.empty(0)
        if len(values) != 1 + 3 * n:
            wrong = (
                f"line {self._lines}: expected {1 + 3 * n} numbers (t, {n} q, {n} qd, {n} "
                f"currents) separated by commas, got {line[:60]!r}"
            )
            if self._lines == 1:
                raise ArgumentError(wrong)
            add_event(self.events, wrong)
            values = np.full(1 + 3 * n, np.nan)
        q, qd, current = np.split(values[1:], 3)
        return Sample(float(values[0]), q, qd, current, arrived)

    def close(self) -> None:
        """Stop reading."""
        self._ready.close()
