"""Edges and points that belong to no face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.cloth.groups import Groups
from tauguard.geometry import frozen, frozen_indices

_MOST = np.iinfo(np.int32).max


@dataclass(frozen=True, eq=False)
class Loose:
    """What of the edges and points given no face has, each once, in order.

    Attributes:
        edges: Smaller vertex first. Shape (L, 2).
        points: Of no face and no edge. Shape (P,).
    """

    edges: NDArray[np.int32]
    points: NDArray[np.int32]

    @staticmethod
    def of(
        faces: NDArray[np.int32], edges: ArrayLike, points: ArrayLike, groups: Groups | None
    ) -> Loose:
        """Check both lists and leave out what faces and edges have.

        Raises:
            ValueError: not (L, 2) or (P,) integers from 0, an edge between equal vertices, an edge
                of two groups, a vertex without a group.
        """
        rows = _rows("edges", edges, (None, 2))
        spots = _rows("points", points, (None,))
        if (rows[:, 0] == rows[:, 1]).any():
            row = int(np.argmax(rows[:, 0] == rows[:, 1]))
            raise ValueError(f"edges: row {row} is {rows[row].tolist()}: it repeats a vertex")
        if groups is not None:
            groups.check("edges", rows)
            groups.check("points", spots[:, None])
        rows = np.unique(np.sort(rows, axis=1), axis=0)
        of_faces = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        rows = rows[~np.isin(_keys(rows), _keys(of_faces))]
        return Loose(frozen(rows), frozen(np.setdiff1d(spots, np.r_[faces.ravel(), rows.ravel()])))

    def rows(self) -> NDArray[np.int32]:
        """As faces without area, for the kernel: (a, b, b) of an edge, (p, p, p) of a point."""
        return np.concatenate([self.edges[:, [0, 1, 1]], np.repeat(self.points, 3).reshape(-1, 3)])


def _rows(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.int32]:
    array = np.asarray(value)
    if array.size == 0:
        array = np.zeros([0 if n is None else n for n in shape], dtype=np.int32)
    return frozen_indices(name, array, shape, _MOST)


def _keys(edges: NDArray[np.int32]) -> NDArray[np.int64]:
    return edges[:, 0].astype(np.int64) << 32 | edges[:, 1]
