"""Traces at the sample interval that a detector was trained at.

A detector's noise, confirmation and thresholds belong to one sample rate. A faster trace is brought
to it by the mean of every few samples, which is causal: each result belongs to the last of them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tauguard.traces.trace import Array, Trace

#: A trace whose interval is within this factor of training's is taken as it is.
ALIKE = 1.3


def samples_each(trace: Trace, dt: float) -> int:
    """How many samples of ``trace`` make one of ``dt`` seconds.

    Raises:
        ValueError: it is sampled too slowly.
    """
    if len(trace.t) < 2:
        return 1
    count = max(1, round(dt / trace.dt))
    if trace.dt * count > ALIKE * dt and count > 1:
        count -= 1
    if trace.dt > ALIKE * dt:
        raise ValueError(
            f"the trace has a sample every {1e3 * trace.dt:g} ms, this detector works at "
            f"{1e3 * dt:g} ms: record at {1 / dt:.0f} Hz or faster, or train it on logs as slow"
        )
    return count


def coarser(trace: Trace, count: int) -> Trace:
    """Every ``count`` samples as one: their means, at the time of the last; a rest is left out.

    Truth, contacts and commanded signals are left out.
    """
    if count <= 1:
        return trace
    rows = len(trace.t) // count

    def mean(x: Array) -> Array:
        out: Array = x[: rows * count].reshape(rows, count, *x.shape[1:]).mean(axis=1)
        return np.ascontiguousarray(out)

    return replace(
        trace,
        t=trace.t[count - 1 : rows * count : count],
        q=mean(trace.q),
        qd=mean(trace.qd),
        current=mean(trace.current),
        q_des=None,
        qd_des=None,
        qdd_des=None,
        truth=None,
        contacts=(),
    )


def rows_known(count: int, length: int, rows: int) -> NDArray[np.intp]:
    """Which of the ``rows`` that :func:`coarser` gave is the last one known at each of its samples.

    Args:
        count: samples that each row is the mean of.
        length: of the trace before.
        rows: at least 1.

    Returns:
        Shape (length,); before the first row is known, it is the first.
    """
    return np.clip((np.arange(length) + 1) // count - 1, 0, rows - 1)
