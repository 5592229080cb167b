"""Linear algebra on one thread, so that results do not depend on the number of threads."""

from __future__ import annotations

from threadpoolctl import threadpool_limits


def one_thread() -> threadpool_limits:
    """A context in which BLAS uses one thread.

    The order of a sum depends on the number of threads. With the few hundred unknowns of an arm,
    threads also cost more time than they save.
    """
    import scipy.linalg  # noqa: F401  its BLAS is another library than NumPy's, and is limited too

    return threadpool_limits(1, "blas")
