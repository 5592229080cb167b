"""Overlap in successive frames: test the separating planes of the last frame first."""

from threading import Lock

import numpy as np
from numpy.typing import NDArray

from tauguard.geometry import thread_count
from tauguard.rigid import _rigid
from tauguard.rigid.queries import find_witness, native, rows
from tauguard.rigid.results import Overlap
from tauguard.rigid.shapes import Bodies


class PlaneCache:
    """Overlap queries on the same pairs frame after frame.

    The cache keeps the normal of a separating plane for each pair that was apart. While this normal
    separates the bodies, nothing else is computed. The result always equals that of
    :func:`tauguard.rigid.overlap`. Calls from several threads wait for each other.

    Args:
        count: The number of pairs N, the same in every frame.

    Raises:
        ValueError: ``count`` is not an integer of 0 or more.
    """

    def __init__(self, count: int) -> None:
        """Start without planes; see the class."""
        if not isinstance(count, int | np.integer) or isinstance(count, bool) or count < 0:
            raise ValueError(f"count: {count!r:.40}, expected an integer of 0 or more")
        self._lock = Lock()
        self._normals: NDArray[np.float64] = np.zeros((count, 3))
        #: Number of pairs of the last frame that were decided by their cached plane.
        self.answered = 0

    def overlap(self, a: Bodies, b: Bodies, threads: int = 1) -> Overlap:
        """Overlap in one frame; the separating planes are kept. Arguments as for ``overlap``.

        Raises:
            ValueError: the number of pairs is not ``count``, or an error of ``overlap``.
        """
        count = rows(a, b)
        if count != len(self._normals):
            raise ValueError(f"a, b: {count} pairs, expected {len(self._normals)}")
        hit = np.empty(count, dtype=np.uint8)
        with self._lock:
            self.answered = _rigid.overlap_cached(
                *native(a), *native(b), thread_count(threads), self._normals, hit
            )
        found = hit.view(np.bool_)
        return Overlap(found, lambda: find_witness(a, b, found, threads))
