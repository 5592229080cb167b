"""Find crossings of the middle surfaces of two-dimensional flexes, also with themselves."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from tauguard.arrays import Array
from tauguard.cloth import Groups, MeshCCD
from tauguard.models.cloth import flex_elements


class TunnellingEvents:
    """Finds vertices that cross faces, and edges that cross edges, in a step.

    Args:
        model: MjModel.
        pairs: Pairs of two-dimensional flexes, by ids.
        first: Native number of the first of these pairs.
    """

    def __init__(self, model: Any, pairs: Sequence[tuple[int, int]], first: int) -> None:
        """Build the mesh of all flexes in ``pairs``."""
        meets = np.zeros((model.nflex, model.nflex), dtype=bool)
        for a, b in pairs:
            meets[a, b] = meets[b, a] = True
        chosen = np.flatnonzero(meets.any(axis=1))
        faces = np.concatenate([flex_elements(model, int(f)) for f in chosen])
        self._flex = np.repeat(np.arange(model.nflex), model.flex_vertnum)
        self._mesh = MeshCCD(faces, groups=Groups(self._flex, meets))
        self._number = {pair: first + k for k, pair in enumerate(pairs)}

    def find(self, x_t0: Array, x_t1: Array) -> list[tuple[int, list[int], float]]:
        """One row per crossing: number of the pair, its vertices, upper bound of its approach [m].

        Args:
            x_t0: Vertices of all flexes at the start of a step. Shape (V, 3), m.
            x_t1: Vertices of all flexes at the end of the step. Shape (V, 3), m.
        """
        frame = self._mesh.find(x_t0, x_t1)
        faces, edges = self._mesh.faces, self._mesh.edges
        rows = [(v, *faces[f]) for v, f in frame.vf]
        rows += [(*edges[e], *edges[g]) for e, g in frame.ee]
        if not rows:
            return []
        travel = 2 * float(np.linalg.norm(x_t1 - x_t0, axis=1).max())
        return [(self._pair(row), [int(v) for v in row], travel) for row in rows]

    def _pair(self, corners: Sequence[int]) -> int:
        first, second = sorted((int(self._flex[corners[0]]), int(self._flex[corners[-1]])))
        return self._number[first, second]
