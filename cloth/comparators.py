"""For comparison only: narrow phases of earlier work, with missed and false collisions.

They use the candidates, data layout, compiler flags and threads of ab2pf, the product's narrow
phase. So a comparison measures the narrow phase alone. ``comparators.hpp`` cites the publications.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.cloth import _mesh
from tauguard.cloth.mesh import MeshCCD
from tauguard.cloth.topology import Groups, Isolated
from tauguard.findings import ArgumentError

#: Narrow phases of earlier work by name, with their numbers in the native module.
COMPARATORS = {"naive": 2, "iccd": 3, "dnf": 4, "scd": 5, "vcd": 6}

#: Every narrow phase: ab2pf, the comparators, and the exact reference.
METHODS = {"ab2pf": 0, **COMPARATORS, "exact": 1}


class ComparedMeshCCD(MeshCCD):
    """A :class:`MeshCCD` whose ``method`` may be any of :data:`METHODS`.

    Raises:
        ArgumentError: as :class:`MeshCCD`; isolated vertices or a minimum distance with a
            comparator, which supports neither.
    """

    methods = METHODS

    def _checked_parts(
        self, faces: ArrayLike, edges: ArrayLike, points: ArrayLike, groups: Groups | None
    ) -> tuple[NDArray[np.int32], Isolated]:
        checked, isolated = super()._checked_parts(faces, edges, points, groups)
        if isolated.points.size and self.method in COMPARATORS:
            raise ArgumentError(
                f"points: not available with method {self.method!r}; expected ab2pf or exact"
            )
        return checked, isolated


def solve(
    vertex: bool,
    x_t0: NDArray[np.float64],
    x_t1: NDArray[np.float64],
    rows: NDArray[np.int32],
    method: str,
    hit: NDArray[np.uint8],
    *out: NDArray[np.float64],
) -> dict[str, int]:
    """Solve queries on shared positions with any of :data:`METHODS`, into the caller's arrays.

    Args:
        vertex: True for vertex-face queries, False for edge-edge queries.
        x_t0: Positions at the start of the step. Shape (V, 3).
        x_t1: Positions at the end of the step. Shape (V, 3).
        rows: Four vertices per query. Shape (N, 4).
        method: One of :data:`METHODS`.
        hit: Output. Shape (N,).
        out: Output: toi, point, normal and weights as in :class:`tauguard.cloth.Impacts`. Rows
            without a hit are not written.

    Returns:
        The number of queries that each stage decided, as in :class:`tauguard.cloth.FrameStats`.
    """
    return _mesh.solve(vertex, x_t0, x_t1, rows, METHODS[method], 0.0, hit, *out)
