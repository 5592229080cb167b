"""Results of queries of points and rays on a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import in_a_line


@dataclass(frozen=True, eq=False)
class PointDistances:
    """Signed distances of points from a closed mesh, row by row.

    Attributes:
        distance: Distance from the surface; negative inside, 0 on it. Shape (N,), m.
        point: The nearest point of the surface. Shape (N, 3).
        face: The face with this point. Shape (N,).
    """

    distance: NDArray[np.float64]
    point: NDArray[np.float64]
    face: NDArray[np.int32]

    __repr__ = in_a_line


@dataclass(frozen=True, eq=False)
class RayHits:
    """First hits of rays on a mesh, row by row.

    Attributes:
        hit: Whether the ray meets a face. Shape (N,).
        distance: Distance from the origin to the first face; inf without a hit. Shape (N,), m.
        face: The face that is hit; -1 without a hit. Shape (N,).
        normal: Its unit normal, by the winding of its corners; NaN without a hit, 0 for a face
            without area. Shape (N, 3).
    """

    hit: NDArray[np.bool_]
    distance: NDArray[np.float64]
    face: NDArray[np.int32]
    normal: NDArray[np.float64]

    __repr__ = in_a_line


def unit_vectors(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors divided by their lengths; those of length 0 stay 0. Shape (N, 3)."""
    largest = np.abs(vectors).max(axis=1, keepdims=True, initial=0)
    scaled = vectors / np.where(largest > 0, largest, 1)
    length = np.linalg.norm(scaled, axis=1, keepdims=True)
    return np.asarray(scaled / np.where(length > 0, length, 1))
