"""The argument ``threads`` of every native kernel."""

import operator
import os

#: A larger number of threads is probably a mistake and is refused.
MOST_THREADS = 1024


def thread_count(threads: int) -> int:
    """The number of threads; 0 means all processors.

    Raises:
        ValueError: ``threads`` is not an integer from 0 to 1024.
    """
    try:
        count = operator.index(threads)
    except TypeError:
        count = -1
    if isinstance(threads, bool) or not 0 <= count <= MOST_THREADS:
        raise ValueError(
            f"threads: {threads!r:.40}, expected an integer from 0 (all processors) "
            f"to {MOST_THREADS}"
        )
    return count or os.cpu_count() or 1
