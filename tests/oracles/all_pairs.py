"""Which pairs of features may touch? Every pair, tried one by one; the broad phase's definition."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Index = NDArray[np.int64]

#: Axes of the k-DOPs by k.
AXES: dict[int, list[tuple[int, int, int]]] = {
    6: [(1, 0, 0), (0, 1, 0), (0, 0, 1)],
    14: [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1), (1, 1, -1), (1, -1, 1), (-1, 1, 1)],
}
AXES[16] = [*AXES[6], (1, 1, 0), (1, 0, 1), (0, 1, 1), (1, -1, 0), (1, 0, -1)]
AXES[18] = [*AXES[16], (0, 1, -1)]
AXES[26] = [*AXES[18], *AXES[14][3:]]


def edges_of(faces: ArrayLike) -> Index:
    """Unique pairs of vertices (E, 2) of the faces (F, 3), sorted."""
    faces = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
    pairs = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return np.unique(pairs, axis=0)


def queries(faces: ArrayLike) -> tuple[Index, Index, Index, Index]:
    """All (vertex, face) and (edge, edge) that share no vertex, and their four vertices a row."""
    faces = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
    edges = edges_of(faces)
    used = np.unique(faces)
    v = np.repeat(used, len(faces))
    f = np.tile(np.arange(len(faces)), len(used))
    free = (faces[f] != v[:, None]).all(axis=1) if len(f) else np.zeros(0, bool)
    vf = np.stack([v, f], axis=1)[free]
    i, j = np.triu_indices(len(edges), 1)
    free = (edges[i][:, :, None] != edges[j][:, None, :]).all(axis=(1, 2))
    ee = np.stack([i, j], axis=1)[free]
    vf_rows = np.concatenate([vf[:, :1], faces[vf[:, 1]]], axis=1)
    ee_rows = np.concatenate([edges[ee[:, 0]], edges[ee[:, 1]]], axis=1)
    return vf, vf_rows, ee, ee_rows


def axis_distance(
    x_t0: NDArray[Any], x_t1: NDArray[Any], rows: Index, split: int, k: int, moving: bool
) -> NDArray[np.float64]:
    """Distance of the two k-DOPs of each row along their best axis; below 0 where they overlap."""
    best = np.full(len(rows), -np.inf)
    for axis in np.asarray(AXES[k], dtype=float):
        p = np.stack([(x_t0 @ axis)[rows], (x_t1 @ axis)[rows]], axis=1) / np.linalg.norm(axis)
        a, b = p[:, :, :split], p[:, :, split:]
        if moving:
            above = (b.min(axis=2) - a.max(axis=2)).min(axis=1)
            below = (a.min(axis=2) - b.max(axis=2)).min(axis=1)
        else:
            above = b.min(axis=(1, 2)) - a.max(axis=(1, 2))
            below = a.min(axis=(1, 2)) - b.max(axis=(1, 2))
        best = np.maximum(best, np.maximum(above, below))
    return best
