"""Exact signs of orientation: a floating-point filter (Shewchuk 1997), then dyadic numbers."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.geometry import _geometry
from tauguard.geometry.arrays import finite, thread_count


def orient3d(points: ArrayLike, threads: int = 1) -> NDArray[np.int8]:
    """Sign of ``((b - a) x (c - a)) . (d - a)`` for rows ``a, b, c, d``.

    Args:
        points: Shape (N, 4, 3), any unit. Every finite double is legal.
        threads: 0 means all processors; the result does not depend on it.

    Returns:
        Exact signs -1, 0 or 1. Shape (N,).

    Raises:
        ValueError: wrong shape, an entry that is not finite, or ``threads`` is not an integer from
            0 to 1024.
    """
    array = finite("points", points, (None, 4, 3))
    out = np.empty(len(array), dtype=np.int8)
    _geometry.orient3d(array, out, thread_count(threads))
    return out


def orient2d(points: ArrayLike, threads: int = 1) -> NDArray[np.int8]:
    """Sign of ``(b - a) x (c - a)`` for rows ``a, b, c``, shape (N, 3, 2); see :func:`orient3d`."""
    array = finite("points", points, (None, 3, 2))
    out = np.empty(len(array), dtype=np.int8)
    _geometry.orient2d(array, out, thread_count(threads))
    return out
