"""The tightness of bounding volumes: the hulls of pieces of a mesh, and what a volume encloses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from tauguard.arrays import Array
from tauguard.rigid import Hulls

#: The 18-DOP's directions, one of each pair.
DIRECTIONS = np.array(
    [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, -1, 0], [1, 0, 1], [1, 0, -1], [0, 1, 1],
     [0, 1, -1]], dtype=np.float64,
)  # fmt: skip


class HullVolumes:
    """The convex hulls of the pieces."""

    def __init__(self, corners: Array, offsets: NDArray[np.int64]) -> None:
        """Build them all."""
        self.points = [part.reshape(-1, 3) for part in np.split(corners, offsets[1:-1])]
        self.fit()

    def fit(self) -> None:
        """Qhull on every piece; a flat one keeps all its corners and has no volume."""
        kept, self.size = [], np.zeros(len(self.points))
        for i, points in enumerate(self.points):
            try:
                hull = ConvexHull(points)
                kept.append(points[hull.vertices])
                self.size[i] = hull.volume
            except QhullError:
                kept.append(points)
        self.counts = np.array([len(points) for points in kept])
        self.vertices = np.concatenate(kept)

    def place(self, pose: Array) -> Array:
        """The vertices in the world. Shape (V, 3)."""
        rotation = np.repeat(pose[:, :3, :3], self.counts, axis=0)
        moved = np.einsum("nij,nj->ni", rotation, self.vertices)
        return np.asarray(moved + np.repeat(pose[:, :3, 3], self.counts, axis=0))

    def sides(self, pose: Array, pairs: NDArray[np.int64]) -> tuple[Hulls, Hulls]:
        """Both columns of the pairs as batches."""
        placed = np.split(self.place(pose), np.cumsum(self.counts)[:-1])

        def side(column: NDArray[np.int64]) -> Hulls:
            points = np.concatenate([placed[i] for i in column])
            return Hulls(points, np.cumsum([0, *self.counts[column]]))

        return side(pairs[:, 0]), side(pairs[:, 1])


def enclosed(name: str, numbers: Array) -> float:
    """The volume that a bounding volume's numbers enclose [m^3]."""
    if name == "sphere":
        return float(4 / 3 * np.pi * numbers[3] ** 3)
    if name == "aabb":
        return float(np.prod(numbers[3:] - numbers[:3]))
    if name == "obb":
        return float(8 * np.prod(numbers[3:6]))
    planes = np.r_[np.c_[DIRECTIONS, -numbers[9:]], np.c_[-DIRECTIONS, numbers[:9]]]
    corners = HalfspaceIntersection(planes, np.zeros(3)).intersections  # the piece's mean is inside
    return float(ConvexHull(corners).volume)
