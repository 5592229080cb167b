"""Results of the queries, row by row, as frozen dataclasses of arrays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import in_a_line
from tauguard.findings import ArgumentError


@dataclass(frozen=True, eq=False)
class Witness:
    """Evidence of overlap or of separation, subject to rounding.

    ``point`` is NaN for pairs that are apart; ``normal`` and ``offset`` are NaN for overlap.

    Attributes:
        point: A common point. Shape (N, 3).
        normal: Unit normal, from a to b, of a separating plane. Shape (N, 3).
        offset: The separating plane is ``normal @ x = offset``. Shape (N,).
    """

    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    offset: NDArray[np.float64]

    __repr__ = in_a_line


@dataclass(frozen=True, eq=False)
class Overlap:
    """Result of an overlap query.

    Attributes:
        hit: True if the two sets share a point (touching is a hit). Shape (N,).
    """

    hit: NDArray[np.bool_]
    _find_witness: Callable[[], Witness] = field(repr=False)

    __repr__ = in_a_line

    @cached_property
    def witness(self) -> Witness:
        """A common point or a separating plane of each row, computed at the first access."""
        return self._find_witness()


@dataclass(frozen=True, eq=False)
class Impacts:
    """First contact of two moving bodies, row by row.

    Attributes:
        hit: True if they touch within the step. Shape (N,).
        time_of_impact: Fraction of the step in [0, 1]; inf without a hit. Shape (N,).
        point: A common point at that time, world frame; NaN without a hit. Shape (N, 3).
        normal: Unit contact normal from a to b at that time. NaN without a hit, and where the
            bodies overlap from the start and no normal is defined. Shape (N, 3).
        depth: Penetration at t = 0 of bodies that overlap from the start, 0 for others; ``None``
            without ``compute_impact_geometry_on_penetration``. Shape (N,).
    """

    hit: NDArray[np.bool_]
    time_of_impact: NDArray[np.float64]
    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    depth: NDArray[np.float64] | None = field(default=None, kw_only=True, repr=False)

    __repr__ = in_a_line


@dataclass(frozen=True, eq=False)
class MeshImpacts(Impacts):
    """First contact of two moving meshes, or of a mesh and convex bodies, row by row.

    Attributes:
        faces: The triangles that touch first, (face of a, face of b). Without a hit, and on the
            side of a convex body, the entry is -1. Shape (N, 2).
    """

    faces: NDArray[np.int32]

    __repr__ = in_a_line


@dataclass(frozen=True, eq=False)
class Distances:
    """Signed distance of two bodies, row by row: ``(point_b - point_a) . normal``.

    Attributes:
        distance: If the bodies are apart, the length of the shortest segment between them. If they
            overlap, minus the length of the shortest translation that separates them. Zero if they
            touch. Shape (N,).
        point_a: The point of a nearest to b; if they overlap, the deepest point of a in b along
            the normal. Shape (N, 3).
        point_b: The point of b nearest to a; if they overlap, the deepest point of b in a along
            the normal. Shape (N, 3).
        normal: Unit vector from a to b, along the shortest segment or translation. If bodies
            without thickness touch, any normal of the plane or line that they span. Shape (N, 3).
    """

    distance: NDArray[np.float64]
    point_a: NDArray[np.float64]
    point_b: NDArray[np.float64]
    normal: NDArray[np.float64]

    __repr__ = in_a_line

    @classmethod
    def of_rows(cls, out: NDArray[np.float64]) -> Distances:
        """Of rows of distance, both points and normal. Shape (N, 10)."""
        self = object.__new__(Distances)
        self.__dict__.update(
            distance=out[:, 0], point_a=out[:, 1:4], point_b=out[:, 4:7], normal=out[:, 7:10]
        )
        return self

    def within(self, min_distance: float) -> NDArray[np.bool_]:
        """Whether each distance is at most ``min_distance`` [m]. Shape (N,).

        Raises:
            ArgumentError: ``min_distance`` is not a number.
        """
        least = np.asarray(min_distance)
        if least.dtype.kind not in "fiu" or np.isnan(least).any():
            raise ArgumentError(f"min_distance: {min_distance!r}, expected a number [m]")
        return np.asarray(self.distance <= least)


@dataclass(frozen=True, eq=False)
class MeshDistances(Distances):
    """Signed distance of a mesh and convex bodies, row by row.

    If the surface and the body overlap, the distance is that of the body and the deepest triangle
    alone: moving the body by it separates the body from this triangle, not always from the whole
    mesh. If a corner of the body (of a curved body: its centre) is inside of a closed mesh, the
    distance is at most minus the corner's depth and the body's radius: no shorter translation takes
    the body out.

    Attributes:
        face: The triangle nearest to the body or to its deepest corner, or the deepest one in the
            body. Shape (N,).
    """

    face: NDArray[np.int32]

    __repr__ = in_a_line
