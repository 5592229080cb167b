"""The native narrow phase with its counts, which the public queries do not return."""

from typing import NamedTuple

import numpy as np

from tauguard.cloth import _mesh
from tauguard.cloth.impacts import METHODS


class Answer(NamedTuple):
    hit: np.ndarray
    toi: np.ndarray
    counts: dict


def solve(vertex, x_t0, x_t1, rows, method="ab2pf", distance=0.0):
    """Queries (N, 4) of rows on shared positions (V, 3); ``vertex``: against faces."""
    n = len(rows)
    hit, toi = np.zeros(n, dtype=np.uint8), np.full(n, np.inf)
    out = [np.empty((n, k)) for k in (3, 3, 4)]
    counts = _mesh.solve(vertex, x_t0, x_t1, rows, METHODS[method], distance, hit, toi, *out)
    return Answer(hit.astype(bool), toi, counts)


def solve_each(vertex, x, method="ab2pf", distance=0.0):
    """Queries of their own positions (N, 2, 4, 3)."""
    start, end = (np.ascontiguousarray(x[:, i]).reshape(-1, 3) for i in (0, 1))
    rows = np.arange(4 * len(x), dtype=np.int32).reshape(-1, 4)
    return solve(vertex, start, end, rows, method, distance)
