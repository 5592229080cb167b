"""For comparison only: methods that the studies measure; no query of the package uses them.

* Textbook separating axes (Ericson 2005, 5.2.1) without error bounds: rounding can make an answer
  wrong.
* Mesh trees of 18-DOPs (Klosowski et al. 1998) and of balls.
* Single bounding volumes, which are built, moved and tested as in figure 1.1 of the dissertation.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.geometry import thread_count
from tauguard.rigid import _rigid
from tauguard.rigid.mesh import MeshTree
from tauguard.rigid.queries import native_overlap, refuse_hulls, rows
from tauguard.rigid.shapes import Bodies

#: Classes of single bounding volumes by name; each volume contains consecutive triangles.
VOLUMES: dict[str, Any] = {
    "sphere": _rigid.BallVolumes,
    "aabb": _rigid.AabbVolumes,
    "obb": _rigid.ObbVolumes,
    "k_dop": _rigid.KDopVolumes,
}
#: Native number of the textbook method of separating axes.
_TEXTBOOK = 3


def overlap_by(
    a: Bodies, b: Bodies, method: str, threads: int = 1
) -> tuple[NDArray[np.bool_], int]:
    """``hit``, shape (N,), and the number of rows that exact arithmetic decided.

    Besides the methods of :func:`tauguard.rigid.overlap` there is ``"sat_textbook"``.

    Raises:
        ValueError: lengths that do not match, or ``sat_textbook`` for hulls or polygons.
    """
    if method != "sat_textbook":
        return native_overlap(a, b, method, threads)
    refuse_hulls(a, b)
    hit = np.empty(rows(a, b), dtype=np.uint8)
    left = _rigid.overlap(a.native, b.native, _TEXTBOOK, thread_count(threads), hit)
    return hit.view(np.bool_), left


class ComparedTree(MeshTree):
    """A :class:`~tauguard.rigid.MeshTree` whose volume may also be ``"k_dop"`` or ``"sphere"``."""

    volumes = (*MeshTree.volumes, "k_dop", "sphere")
