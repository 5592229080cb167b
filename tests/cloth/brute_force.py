"""The broad phase by its definition: all pairs of features, nothing shared with the package."""

import numpy as np

AXES = {
    6: [(1, 0, 0), (0, 1, 0), (0, 0, 1)],
    14: [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1), (1, 1, -1), (1, -1, 1), (-1, 1, 1)],
}
AXES[16] = [*AXES[6], (1, 1, 0), (1, 0, 1), (0, 1, 1), (1, -1, 0), (1, 0, -1)]
AXES[18] = [*AXES[16], (0, 1, -1)]
AXES[26] = [*AXES[18], *AXES[14][3:]]


def edges_of(faces):
    """The unique pairs of vertices of the faces, sorted."""
    faces = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
    pairs = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return np.unique(pairs, axis=0)


def queries(faces):
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


def gap(x_t0, x_t1, rows, split, k, moving):
    """How far apart the two volumes of each row are along their best axis (< 0: they overlap)."""
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
