"""What friction and ripple leave: a random function of the angle, which repeats with the motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tauguard.arrays import Array

#: Cycles of the lines per revolution of the joint, which nothing else explains.
CYCLES = np.geomspace(6.0, 300.0, 24)
#: A line is looked for in spans of so many samples: it need not keep its phase for longer.
SPAN = 250


def line_heights(q: Array, left: Array) -> Array:
    """Amplitudes of the lines, such that their sum has the variance of what is left.

    Args:
        q: angles while the joint moves [rad], shape (T,).
        left: what the identified drive does not explain, in any unit, shape (T,).

    Returns:
        In the unit of ``left``, shape (lines,).
    """
    if len(q) < SPAN:
        return np.zeros(len(CYCLES))
    power = np.zeros(len(CYCLES))
    spans: Sequence[slice] = [slice(k, k + SPAN) for k in range(0, len(q) - SPAN + 1, SPAN)]
    for span in spans:
        turns = np.outer(q[span], CYCLES)
        rest = left[span] - left[span].mean()
        # A line longer than the travelled angle cannot be told from a trend.
        seen = CYCLES * np.ptp(q[span]) > 2 * np.pi
        cosine, sine = rest @ np.cos(turns), rest @ np.sin(turns)
        power += np.where(seen, cosine**2 + sine**2, 0.0)
    power = power + 1e-3 * power.max()
    total = power.sum()
    if total <= 0:
        return np.zeros(len(CYCLES))
    heights: Array = np.sqrt(2 * np.var(left) * power / total)
    return heights
