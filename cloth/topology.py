"""Faces, edges, isolated vertices and edges, and groups of vertices of one mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.cloth.impacts import Impacts
from tauguard.findings import ArgumentError
from tauguard.geometry import Rebuilt, frozen, frozen_indices


@dataclass(frozen=True, eq=False)
class Groups(Rebuilt):
    """The group of every vertex, and a table of the pairs of groups to test; read-only copies.

    Attributes:
        ids: Shape (V,), the group of every vertex, 0 to G - 1. All vertices of a face belong to one
            group.
        meets: Shape (G, G), symmetric. ``meets[a, b]`` is False where features of ``a`` and ``b``
            are not tested; ``meets[a, a]`` is False for a body that is not tested against itself.

    Raises:
        ArgumentError: the table is not square, not symmetric or not of bools (or 0 and 1), or an id
            has no row in the table.

    Example:
        A cloth (group 0) tested against itself and against a rigid body (group 1)::

            Groups(ids, [[True, True], [True, False]])
    """

    ids: NDArray[np.int32]
    meets: NDArray[np.bool_]

    def __init__(self, ids: ArrayLike, meets: ArrayLike) -> None:
        """Check and copy both arrays."""
        table = frozen(_table(meets))
        if (table != table.T).any():
            a, b = np.argwhere(table != table.T)[0]
            raise ArgumentError(
                f"meets: [{a}, {b}] is {table[a, b]} but [{b}, {a}] is {table[b, a]}"
            )
        object.__setattr__(self, "ids", frozen_indices("ids", ids, (None,), len(table)))
        object.__setattr__(self, "meets", table)

    def check(self, name: str, rows: NDArray[np.int32]) -> None:
        """Raise ``ArgumentError`` for a row with a vertex outside ``ids``, or of several groups."""
        if rows.size and int(rows.max()) >= len(self.ids):
            row = int(np.argmax((rows >= len(self.ids)).any(axis=1)))
            raise ArgumentError(
                f"{name}: row {row} is {rows[row].tolist()}, but groups has {len(self.ids)} ids"
            )
        of_row = self.ids[rows]
        mixed = (of_row != of_row[:, :1]).any(axis=1)
        if mixed.any():
            row = int(np.argmax(mixed))
            raise ArgumentError(f"{name}: row {row} has vertices of groups {of_row[row].tolist()}")


def _table(meets: ArrayLike) -> NDArray[np.bool_]:
    try:
        array = np.asarray(meets)
    except ValueError as error:
        raise ArgumentError(
            f"meets: rows of different lengths, expected (G, G) ({error})"
        ) from None
    if array.ndim != 2 or array.shape[0] != array.shape[1]:
        raise ArgumentError(f"meets: shape {array.shape}, expected (G, G)")
    if array.dtype.kind not in "biuf" or not ((array == 0) | (array == 1)).all():
        raise ArgumentError(f"meets: dtype {array.dtype}, expected bools, or only 0 and 1")
    return np.ascontiguousarray(array, dtype=bool)


_MOST = np.iinfo(np.int32).max


@dataclass(frozen=True, eq=False)
class Isolated:
    """Edges that belong to no face, and vertices that belong to no face and no edge.

    Attributes:
        edges: Isolated edges, smaller vertex first, sorted and unique. Shape (L, 2).
        points: Isolated vertices, sorted and unique. Shape (P,).
    """

    edges: NDArray[np.int32]
    points: NDArray[np.int32]

    @staticmethod
    def of(
        faces: NDArray[np.int32], edges: ArrayLike, points: ArrayLike, groups: Groups | None
    ) -> Isolated:
        """Check both lists; remove edges of faces, and vertices of faces or edges.

        Raises:
            ArgumentError: arrays that are not (L, 2) or (P,) integers >= 0, an edge between equal
                vertices or between two groups, a vertex without a group.
        """
        rows = _rows("edges", edges, (None, 2))
        spots = _rows("points", points, (None,))
        if (rows[:, 0] == rows[:, 1]).any():
            row = int(np.argmax(rows[:, 0] == rows[:, 1]))
            raise ArgumentError(f"edges: row {row} is {rows[row].tolist()}: it repeats a vertex")
        if groups is not None:
            groups.check("edges", rows)
            groups.check("points", spots[:, None])
        rows = np.unique(np.sort(rows, axis=1), axis=0)
        of_faces = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        rows = rows[~np.isin(_keys(rows), _keys(of_faces))]
        return Isolated(
            frozen(rows), frozen(np.setdiff1d(spots, np.r_[faces.ravel(), rows.ravel()]))
        )

    def rows(self) -> NDArray[np.int32]:
        """Degenerate faces for the kernel: edges as (a, b, b), points as (p, p, p)."""
        return np.concatenate([self.edges[:, [0, 1, 1]], np.repeat(self.points, 3).reshape(-1, 3)])


class Topology:
    """Parts of a :class:`MeshCCD`, and the number of vertices that its frames have."""

    def __init__(
        self,
        faces: NDArray[np.int32],
        isolated: Isolated,
        edges: NDArray[np.int32],
        groups: Groups | None,
    ) -> None:
        """``edges``: all edges, of faces and isolated ones, sorted."""
        self.faces, self.isolated, self.edges, self.groups = faces, isolated, edges, groups
        used = max(
            (int(x.max()) for x in (faces, isolated.edges, isolated.points) if x.size), default=-1
        )
        self._rows = used + 1
        self._vertices: int | None = None
        keys = edges[:, 0].astype(np.int64) << 32 | edges[:, 1]
        wanted = isolated.edges[:, 0].astype(np.int64) << 32 | isolated.edges[:, 1]
        self._row_of_isolated = np.searchsorted(keys, wanted).astype(np.int32)

    def check(self, start: int, end: int) -> None:
        """Raise an ``ArgumentError`` if the numbers of vertices of a step do not fit the mesh."""
        if start != end:
            raise ArgumentError(f"x_t1: {end} vertices, but x_t0 has {start}")
        if self._vertices is not None and start != self._vertices:
            raise ArgumentError(
                f"x_t0: {start} vertices, but the frames before had {self._vertices}; "
                "call update_topology first if the mesh has changed"
            )
        if self.groups is not None and start != len(self.groups.ids):
            raise ArgumentError(f"x_t0: {start} vertices, but groups has {len(self.groups.ids)}")
        if start < self._rows:
            parts = (("faces", self.faces), ("edges", self.edges), ("points", self.isolated.points))
            name, rows = next((n, r) for n, r in parts if r.size and int(r.max()) >= start)
            row = int(np.argmax((rows >= start).reshape(len(rows), -1).any(axis=1)))
            raise ArgumentError(
                f"{name}: row {row} is {rows[row].tolist()}, but x_t0 has {start} vertices"
            )
        self._vertices = start

    def parts(self, pairs: NDArray[np.int32], impacts: Impacts) -> dict[str, Any]:
        """Divide vertex-face pairs of the kernel by the second feature: face, edge or vertex."""
        number = pairs[:, 1] - len(self.faces)
        edges = len(self.isolated.edges)
        of_face, of_point = number < 0, number >= edges
        of_edge = ~of_face & ~of_point
        ends = pairs[of_edge].copy()
        ends[:, 1] = self._row_of_isolated[number[of_edge]]
        points = pairs[of_point].copy()
        points[:, 1] = self.isolated.points[number[of_point] - edges]
        of_ends, of_points = _chosen(impacts, of_edge), _chosen(impacts, of_point)
        w = of_ends.weights
        w = np.concatenate([w[:, :2], w[:, 2:].sum(axis=1, keepdims=True)], axis=1)
        return {
            "vf": pairs if of_face.all() else pairs[of_face],
            "vf_impacts": impacts if of_face.all() else _chosen(impacts, of_face),
            "pe": ends,
            "pe_impacts": _weighted(of_ends, w),
            "pp": points,
            "pp_impacts": _weighted(of_points, np.ones((len(points), 2))),
        }


def _chosen(of: Impacts, rows: NDArray[np.bool_]) -> Impacts:
    return Impacts(of.hit[rows], of.toi[rows], of.point[rows], of.normal[rows], of.weights[rows])


def _weighted(of: Impacts, weights: NDArray[np.float64]) -> Impacts:
    return Impacts(of.hit, of.toi, of.point, of.normal, weights)


def _rows(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.int32]:
    array = np.asarray(value)
    if array.size == 0:
        array = np.zeros([0 if n is None else n for n in shape], dtype=np.int32)
    return frozen_indices(name, array, shape, _MOST)


def _keys(edges: NDArray[np.int32]) -> NDArray[np.int64]:
    return edges[:, 0].astype(np.int64) << 32 | edges[:, 1]
