"""Whether a mesh is closed, and which of its faces are inverted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tauguard.findings import ArgumentError

Faces = NDArray[np.int32]


def merged_corners(vertices: NDArray[np.float64], faces: Faces) -> Faces:
    """Corners of the faces, numbered so that equal positions have equal numbers. Shape (F, 3)."""
    positions = vertices + 0.0  # -0 becomes 0
    order = np.lexsort(positions.T)
    new = (positions[order[1:]] != positions[order[:-1]]).any(axis=1)
    number = np.empty(len(order), dtype=np.int32)
    number[order] = np.concatenate([[0], np.cumsum(new)])
    return np.ascontiguousarray(number[faces])


def first_of_parts(corners: Faces) -> NDArray[np.intp]:
    """The first face of each part: of faces that are connected by corners."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    ends = np.concatenate([corners[:, :2], corners[:, 1:]])
    n = int(corners.max()) + 1
    graph = coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(n, n))
    _, part = connected_components(graph, directed=False)
    return np.unique(part[corners[:, 0]], return_index=True)[1]


def check_closed(vertices: NDArray[np.float64], corners: Faces) -> None:
    """Raise an ``ArgumentError`` if the faces are not a closed surface that turns outward.

    Each edge must belong to as many faces in one direction as in the other. Faces with two equal
    corners do not count. Volumes of all parts must be positive in total.

    Args:
        vertices: Positions of the corners, shape (F, 3, 3).
        corners: Numbers of :func:`merged_corners`, shape (F, 3).
    """
    used = np.flatnonzero(
        (corners[:, 0] != corners[:, 1])
        & (corners[:, 1] != corners[:, 2])
        & (corners[:, 2] != corners[:, 0])
    )
    ends = corners[used][:, [[0, 1], [1, 2], [2, 0]]].astype(np.int64)
    low, high = ends.min(axis=2), ends.max(axis=2)
    _, edge = np.unique((low << 32 | high).ravel(), return_inverse=True)
    forward = (ends[:, :, 0] < ends[:, :, 1]).ravel()
    count = np.bincount(edge)
    balance = np.bincount(edge, weights=np.where(forward, 1.0, -1.0))
    odd = count % 2 == 1
    if len(used) == 0 or odd.any():
        where = int(np.argmax(odd[edge])) if len(used) else 0
        detail = ""
        if len(used):
            row, side = divmod(where, 3)
            a, b = vertices[used[row], [side, (side + 1) % 3]]
            detail = (
                f": the edge from {_place(a)} to {_place(b)} of face {used[row]} has no partner"
            )
        raise ArgumentError(
            f"the mesh is open, {int(odd.sum())} edges have an odd number of faces{detail}; close "
            "it (trimesh.repair.fill_holes), or ask for overlap and distances of the surface"
        )
    if balance.any():
        rows = used[_inverted(edge.reshape(-1, 3), forward.reshape(-1, 3), len(count))]
        names = ", ".join(str(row) for row in rows[:5]) + (" ..." if len(rows) > 5 else "")
        raise ArgumentError(
            f"faces: {len(rows)} are inverted against their neighbours (rows {names}); exchange "
            "two corners of each: faces[rows] = faces[rows][:, ::-1], or trimesh.repair.fix_normals"
        )
    a, b, c = np.moveaxis(vertices[used] - vertices[used[0], 0], 1, 0)
    if np.einsum("ij,ij->", a, np.cross(b, c)) <= 0:
        raise ArgumentError(
            "faces: all are inverted, their normals point inward; reverse them: faces[:, ::-1]"
        )


def _place(point: NDArray[np.float64]) -> str:
    return "(" + ", ".join(f"{x:.6g}" for x in point) + ")"


def _inverted(edge: NDArray[np.intp], forward: NDArray[np.bool_], edges: int) -> NDArray[np.intp]:
    """Faces that turn against most of their part: rows of ``edge``.

    Every face is a node with two states. Faces that share an edge of two faces in opposite
    directions have the same state, others have different ones. Each connected part then has two
    sides; those of the smaller one are inverted.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    order = np.argsort(edge.ravel(), kind="stable")
    sorted_edges = edge.ravel()[order]
    pair = np.flatnonzero(np.bincount(edge.ravel(), minlength=edges)[sorted_edges[:-1]] == 2)
    pair = pair[sorted_edges[pair] == sorted_edges[pair + 1]]
    one, other = order[pair], order[pair + 1]
    turned = forward.ravel()[one] == forward.ravel()[other]
    n = len(edge)
    i, j = one // 3, other // 3
    rows = np.concatenate([i, i + n])
    columns = np.concatenate([np.where(turned, j + n, j), np.where(turned, j, j + n)])
    graph = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(2 * n, 2 * n))
    _, part = connected_components(graph, directed=False)
    size = np.bincount(part[:n], minlength=part.max() + 1)
    mine, mirrored = size[part[:n]], size[part[n:]]
    return np.flatnonzero((mine < mirrored) | ((mine == mirrored) & (part[:n] > part[n:])))
