"""Display in a separate thread: a slow viewer misses results, but never delays the detector."""

import threading
from collections import deque
from collections.abc import Callable
from typing import Self

from tauguard.detectors.alarms.monitor import Answer
from tauguard.live.stream import Sample

#: Largest number of queued answers; further ones are dropped. Changes of state may use twice this.
WAITING = 1000
#: At the end, wait this long for answers that have not been shown [s].
PATIENCE = 1.0


class BackgroundDisplay:
    """Shows answers in a separate thread, and drops those that come too fast for it.

    Attributes:
        dropped: answers that were not shown.
    """

    def __init__(self, show: Callable[[Sample, Answer], None], waiting: int = WAITING) -> None:
        """Show answers by the function ``show``, which may block."""
        self._show, self._most = show, waiting
        self._queue: deque[tuple[Sample, Answer]] = deque()
        self._wake, self._over = threading.Event(), False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._state = ""
        self._failed: Exception | None = None
        self.dropped = 0

    def put(self, sample: Sample, answer: Answer) -> None:
        """Queue one answer; returns at once.

        Raises:
            Exception: the error of an earlier call of the function, after which nothing is shown.
        """
        if self._failed is not None:
            raise self._failed
        changed, self._state = answer.state != self._state, answer.state
        if len(self._queue) >= self._most and not (changed and len(self._queue) < 2 * self._most):
            self.dropped += 1
            return
        self._queue.append((sample, answer))
        self._wake.set()

    def __enter__(self) -> Self:
        """Begin to show."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Show the remaining answers, for a second at most."""
        self._over = True
        self._wake.set()
        self._thread.join(PATIENCE)

    def _run(self) -> None:
        while not self._over or self._queue:
            self._wake.wait()
            self._wake.clear()
            try:
                while self._queue:
                    self._show(*self._queue.popleft())
            except Exception as error:
                self._failed = error
                return
