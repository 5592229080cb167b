"""For comparison only: narrow phases of earlier work, which miss collisions and report false ones.

They use the candidates, data layout, compiler flags and threads of ab2pf, so a comparison
measures the narrow phase alone. ``comparators.hpp`` says what was taken from which publication
and what was inferred.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.cloth import _mesh, impacts
from tauguard.cloth.groups import Groups
from tauguard.cloth.mesh import MeshCCD
from tauguard.cloth.topology import Isolated

#: Narrow phases of earlier work by name.
COMPARATORS: dict[str, int] = {"naive": 0, "iccd": 1, "dnf": 2, "scd": 3, "vcd": 4}

#: Every narrow phase: ab2pf, the comparators, and the exact reference.
METHODS = ("ab2pf", *COMPARATORS, "exact")


class ComparedMeshCCD(MeshCCD):
    """A :class:`MeshCCD` whose ``method`` may be any of :data:`METHODS`.

    Raises:
        ValueError: as :class:`MeshCCD`; isolated vertices or a minimum distance with a comparator,
            which has neither.
    """

    def _check_method(self, method: str) -> None:
        if not isinstance(method, str) or method not in METHODS:
            raise ValueError(f"method {method!r}: there are {', '.join(METHODS)}")

    def _checked_parts(
        self, faces: ArrayLike, edges: ArrayLike, points: ArrayLike, groups: Groups | None
    ) -> tuple[NDArray[np.int32], Isolated]:
        checked, isolated = super()._checked_parts(faces, edges, points, groups)
        if isolated.points.size and self.method in COMPARATORS:
            raise ValueError(f"method {self.method!r} has no queries of points")
        return checked, isolated

    def _collisions(
        self,
        x_t0: NDArray[np.float64],
        x_t1: NDArray[np.float64],
        min_distance: float,
        fresh: bool,
        limit: int,
    ) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
        if self.method not in COMPARATORS:
            return super()._collisions(x_t0, x_t1, min_distance, fresh, limit)
        return self._mesh.compare(x_t0, x_t1, COMPARATORS[self.method], fresh, limit)


def solve(
    vertex: bool,
    x_t0: NDArray[np.float64],
    x_t1: NDArray[np.float64],
    rows: NDArray[np.int32],
    method: str,
    hit: NDArray[np.uint8],
    *out: NDArray[np.float64],
) -> dict[str, int]:
    """Answer queries on shared positions with any of :data:`METHODS`, into the caller's arrays.

    Args:
        vertex: Vertex and face, otherwise edge and edge.
        x_t0: Positions at the start of the step. Shape (V, 3).
        x_t1: At its end. Shape (V, 3).
        rows: Four vertices a query. Shape (N, 4).
        method: One of :data:`METHODS`.
        hit: Written. Shape (N,).
        out: toi, point, normal, weights as in :class:`tauguard.cloth.Impacts`, written for hits
            only.

    Returns:
        The number of queries that each stage decided, as in :class:`tauguard.cloth.FrameStats`.
    """
    if method in COMPARATORS:
        return _mesh.solve_compared(vertex, x_t0, x_t1, rows, COMPARATORS[method], hit, *out)
    number = impacts.method_number(method)
    return _mesh.solve(vertex, x_t0, x_t1, rows, number, 0.0, hit, *out)
