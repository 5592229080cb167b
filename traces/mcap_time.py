"""Times of a trace as MCAP log times and as ROS 2 time stamps."""

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.traces.mcap_cdr import Anything


def nanoseconds(t: Array) -> NDArray[np.uint64]:
    """Times ``t`` [s] as log times [ns].

    Raises:
        ValueError: a time below 0 or after the year 2262.
    """
    bad = np.flatnonzero(~((t >= 0) & (t < 2**63 / 1e9)))
    if bad.size:
        raise ValueError(f"t: {t[bad[0]]} s in row {bad[0]}, expected 0 to 9.2e9 s; shift the time")
    whole = np.floor(t)
    return whole.astype(np.uint64) * np.uint64(10**9) + np.rint((t - whole) * 1e9).astype(np.uint64)


def stamp(t: Array) -> dict[str, Anything]:
    """The fields ``sec`` and ``nanosec`` of message headers at times ``t`` [s]."""
    ns = nanoseconds(t)
    return {"sec": (ns // 10**9).astype(np.int32), "nanosec": (ns % 10**9).astype(np.uint32)}
