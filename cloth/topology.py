"""Faces, edges, loose parts and groups that belong together."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.cloth.groups import Groups
from tauguard.cloth.impacts import Impacts
from tauguard.cloth.loose import Loose


class Topology:
    """What a :class:`MeshCCD` answers for, and how many vertices its frames have."""

    def __init__(
        self,
        faces: NDArray[np.int32],
        loose: Loose,
        edges: NDArray[np.int32],
        groups: Groups | None,
    ) -> None:
        """All checked; edges are those of the faces and the loose ones, sorted."""
        self.faces, self.loose, self.edges, self.groups = faces, loose, edges, groups
        used = max((int(x.max()) for x in (faces, loose.edges, loose.points) if x.size), default=-1)
        self._rows = used + 1
        self._vertices: int | None = None
        keys = edges[:, 0].astype(np.int64) << 32 | edges[:, 1]
        wanted = loose.edges[:, 0].astype(np.int64) << 32 | loose.edges[:, 1]
        self._row_of_loose = np.searchsorted(keys, wanted).astype(np.int32)

    def check(self, start: int, end: int) -> None:
        """Raise a ``ValueError`` for numbers of vertices that do not fit."""
        if start != end:
            raise ValueError(f"x_t1: {end} vertices, but x_t0 has {start}")
        if self._vertices is not None and start != self._vertices:
            raise ValueError(
                f"x_t0: {start} vertices, but the frames before had {self._vertices}; "
                "update_topology comes first where the mesh changes"
            )
        if self.groups is not None and start != len(self.groups.ids):
            raise ValueError(f"x_t0: {start} vertices, but groups has {len(self.groups.ids)}")
        if start < self._rows:
            parts = (("faces", self.faces), ("edges", self.edges), ("points", self.loose.points))
            name, rows = next((n, r) for n, r in parts if r.size and int(r.max()) >= start)
            row = int(np.argmax((rows >= start).reshape(len(rows), -1).any(axis=1)))
            raise ValueError(
                f"{name}: row {row} is {rows[row].tolist()}, but x_t0 has {start} vertices"
            )
        self._vertices = start

    def parts(self, pairs: NDArray[np.int32], impacts: Impacts) -> dict[str, Any]:
        """Fields of a frame: what the kernel calls vertex and face, by what the face stands for."""
        number = pairs[:, 1] - len(self.faces)
        edges = len(self.loose.edges)
        of_face, of_point = number < 0, number >= edges
        of_edge = ~of_face & ~of_point
        ends = pairs[of_edge].copy()
        ends[:, 1] = self._row_of_loose[number[of_edge]]
        points = pairs[of_point].copy()
        points[:, 1] = self.loose.points[number[of_point] - edges]
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
