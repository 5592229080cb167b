"""Which rows of a trace show motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tauguard.arrays import Bools
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace

#: A joint moves in a log if its speed is above this in some sample [rad/s].
MOVING = 0.01
#: A joint whose position varies by less does not move: the cause is noise or a touch [rad].
SHIFTED = 0.01


def moves(trace: Trace) -> bool:
    """Whether a joint exceeds :data:`MOVING` and its position varies by :data:`SHIFTED`."""
    quick = (np.abs(trace.qd) > MOVING).any(axis=0)
    return bool((quick & (np.ptp(trace.q, axis=0) > SHIFTED)).any())


def moving_span(trace: Trace, margin: float = 1.0) -> Bools:
    """Rows from the first to the last motion of any joint, shape (T,).

    Before and after, static friction takes up an unknown fraction of the torque.

    Args:
        trace: the log.
        margin: time at the beginning of the log that is always left out [s].

    Raises:
        ArgumentError: no joint moves, or only within ``margin``.
    """
    moves = np.flatnonzero((np.abs(trace.qd) > MOVING).any(axis=1))
    if not len(moves):
        raise ArgumentError(f"no joint moves faster than {MOVING} rad/s")
    rows = np.zeros(len(trace.t), dtype=np.bool_)
    rows[moves[0] : moves[-1] + 1] = True
    rows &= trace.t >= trace.t[0] + margin
    if not rows.any():
        raise ArgumentError(
            f"no motion is left without the first {margin:g} s of the log: give a longer log"
        )
    return rows


def motion_length(traces: Sequence[Trace]) -> float:
    """Sum over traces of the time from the first motion to the last one [s]."""
    moving = [trace for trace in traces if moves(trace)]
    return sum(float(moving_span(trace, 0.0).sum()) * trace.dt for trace in moving)
