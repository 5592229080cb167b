"""A map over processes, one thread each, whose answers come in the order of the jobs."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from threadpoolctl import threadpool_limits


class Workers:
    """A context manager that gives the map; in this process where one worker is asked for."""

    def __init__(self, count: int | None = None) -> None:
        """Keep the number of processes (default: one a processor)."""
        self._count = count or os.cpu_count() or 1
        self._processes: Any = None

    def __enter__(self) -> Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[Any]]:
        """Start the processes; the map takes a function of a module and its jobs."""
        if self._count == 1:
            return lambda call, jobs: map(call, jobs)
        context = multiprocessing.get_context("spawn")
        # One thread a process: more of both than processors slows linear algebra many times over.
        self._processes = context.Pool(self._count, threadpool_limits, (1,))
        imap: Callable[..., Iterator[Any]] = self._processes.imap
        return imap

    def __exit__(self, *_: object) -> None:
        """Stop the processes."""
        if self._processes is not None:
            self._processes.terminate()
