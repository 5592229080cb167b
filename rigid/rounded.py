"""Batches of rounded bodies: a convex core grown by a ball."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.arrays import in_a_line
from tauguard.findings import ArgumentError
from tauguard.geometry import Rebuilt, frozen_finite, sealed
from tauguard.rigid.shapes import (
    SHARP,
    Bodies,
    Boxes,
    Hulls,
    Parallelepipeds,
    Polygons,
    Tetrahedra,
)

Spatial = Tetrahedra | Boxes | Parallelepipeds | Hulls

#: Largest coordinate and radius; products of larger ones would overflow.
MOST_COORDINATE = 1e100


def _radius(value: ArrayLike, count: int) -> NDArray[np.float64]:
    given = np.asarray(value)
    radius = frozen_finite(
        "radius", np.broadcast_to(given, (count,)) if given.ndim == 0 else given, (count,)
    )
    if (radius < 0).any():
        row = int(np.argmax(radius < 0))
        raise ArgumentError(f"radius: {radius[row]} in row {row}; expected 0 or more")
    return radius


@dataclass(frozen=True, eq=False)
class Rounded(Rebuilt):
    """Convex bodies grown by a ball: every point within ``radius`` of the core.

    A rounded box of outer half extents h is ``Rounded(Boxes(center, h - r, rotation), r)``.

    Args:
        core: N bodies.
        radius: Zero or more. Shape (N,), or one number for all.

    Raises:
        ArgumentError: a core that is not a batch of three-dimensional bodies, wrong lengths, an
            entry that is not finite, or a negative radius (named with its row).
    """

    core: Spatial
    radius: NDArray[np.float64]

    __repr__ = in_a_line

    def __init__(self, core: Spatial, radius: ArrayLike) -> None:
        """Check the core, and copy the radii."""
        if not isinstance(core, Spatial):
            raise ArgumentError(f"core: {type(core).__name__}, expected convex bodies in space")
        object.__setattr__(self, "core", core)
        object.__setattr__(self, "radius", _radius(radius, len(core)))

    def __len__(self) -> int:
        return len(self.core)


@dataclass(frozen=True, eq=False)
class Spheres(Rebuilt):
    """A batch of balls.

    Args:
        center: Shape (N, 3).
        radius: Zero or more. Shape (N,), or one number for all.

    Raises:
        ArgumentError: as for :class:`Rounded`.
    """

    center: NDArray[np.float64]
    radius: NDArray[np.float64]

    __repr__ = in_a_line

    def __init__(self, center: ArrayLike, radius: ArrayLike) -> None:
        """Check and copy the arrays."""
        object.__setattr__(self, "center", frozen_finite("center", center, (None, 3)))
        object.__setattr__(self, "radius", _radius(radius, len(self.center)))

    def __len__(self) -> int:
        return len(self.center)

    @cached_property
    def core(self) -> Hulls:
        """The centres as hulls of one point."""
        return Hulls(self.center, np.arange(len(self) + 1))


@dataclass(frozen=True, eq=False)
class Capsules(Rebuilt):
    """Segments grown by a ball; a segment may have length zero.

    Args:
        start: One end of the segment. Shape (N, 3).
        end: The other end. Shape (N, 3).
        radius: Zero or more. Shape (N,), or one number for all.

    Raises:
        ArgumentError: as for :class:`Rounded`.
    """

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    radius: NDArray[np.float64]

    __repr__ = in_a_line

    def __init__(self, start: ArrayLike, end: ArrayLike, radius: ArrayLike) -> None:
        """Check and copy the arrays."""
        object.__setattr__(self, "start", frozen_finite("start", start, (None, 3)))
        object.__setattr__(self, "end", frozen_finite("end", end, (len(self.start), 3)))
        object.__setattr__(self, "radius", _radius(radius, len(self.start)))

    def __len__(self) -> int:
        return len(self.start)

    @cached_property
    def core(self) -> Hulls:
        """The segments as hulls of two points."""
        points = sealed(np.stack([self.start, self.end], axis=1).reshape(-1, 3))
        return Hulls(points, 2 * np.arange(len(self) + 1))


Solid = Bodies | Rounded | Spheres | Capsules


def parts(solid: Solid) -> tuple[Bodies, NDArray[np.float64]]:
    """The core of a batch and the radii; a single zero for bodies without radii."""
    if isinstance(solid, Rounded | Spheres | Capsules):
        return solid.core, solid.radius
    return solid, SHARP


def solid_parts(
    name: str, solid: Solid, most: float = MOST_COORDINATE
) -> tuple[Bodies, NDArray[np.float64]]:
    """Core and radii of three-dimensional bodies.

    Raises:
        ArgumentError: not a batch of bodies, polygons, or a number beyond ``most``.
    """
    core, radius = parts(solid)
    if isinstance(core, Polygons):
        raise ArgumentError(
            f"{name}: Polygons, expected bodies in space; give them thickness as Hulls"
        )
    if not isinstance(core, Spatial):
        kinds = "Tetrahedra, Boxes, Parallelepipeds, Hulls, Rounded, Spheres, Capsules, MeshTree"
        triangles = hasattr(core, "vertices") and hasattr(core, "faces")
        way = "; a mesh is MeshTree(mesh.vertices, mesh.faces)" if triangles else ""
        raise ArgumentError(f"{name}: {type(core).__name__}, expected one of {kinds}{way}")
    if core.largest > most or (radius is not SHARP and radius.max(initial=0.0) > most):
        raise ArgumentError(
            f"{name}: a number beyond {most:g}; scale the scene down".replace("+", "")
        )
    return core, radius
