"""Batches of rounded bodies: a convex core grown by a ball."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.arrays import in_a_line
from tauguard.findings import ArgumentError
from tauguard.geometry import frozen_finite, sealed
from tauguard.rigid import _rigid
from tauguard.rigid.curved import Cones, Cylinders, Ellipsoids, HalfSpaces, lengths
from tauguard.rigid.shapes import (
    MOST_COORDINATE,
    SHARP,
    Bodies,
    Boxes,
    Hulls,
    Parallelepipeds,
    Polygons,
    Shape,
    Tetrahedra,
)

#: Bounded bodies in space without radii.
Spatial = Tetrahedra | Boxes | Parallelepipeds | Hulls | Cylinders | Cones | Ellipsoids


class Grown(Shape):
    """A batch of bodies with radii."""

    core: Any
    radius: NDArray[np.float64]

    @cached_property
    def ready(self) -> _rigid.Batch | None:
        """See :class:`Shape`."""
        fits = self.core.ready is not None and self.radius.max(initial=0.0) <= MOST_COORDINATE
        return self.core.grown(self.radius) if fits else None


@dataclass(frozen=True, eq=False)
class Rounded(Grown):
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
        object.__setattr__(self, "radius", lengths("radius", radius, len(core)))

    def __len__(self) -> int:
        return len(self.core)


@dataclass(frozen=True, eq=False)
class Spheres(Grown):
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
        object.__setattr__(self, "radius", lengths("radius", radius, len(self.center)))

    def __len__(self) -> int:
        return len(self.center)

    @cached_property
    def core(self) -> Hulls:
        """The centres as hulls of one point."""
        return Hulls.of_checked(self.center, np.arange(len(self) + 1))


@dataclass(frozen=True, eq=False)
class Capsules(Grown):
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
        object.__setattr__(self, "radius", lengths("radius", radius, len(self.start)))

    def __len__(self) -> int:
        return len(self.start)

    @cached_property
    def core(self) -> Hulls:
        """The segments as hulls of two points."""
        points = sealed(np.stack([self.start, self.end], axis=1).reshape(-1, 3))
        return Hulls.of_checked(points, 2 * np.arange(len(self) + 1))


Solid = Bodies | Cylinders | Cones | Ellipsoids | HalfSpaces | Rounded | Spheres | Capsules


def parts(solid: Solid) -> tuple[Any, NDArray[np.float64]]:
    """The core of a batch and the radii; a single zero for bodies without radii."""
    if isinstance(solid, Rounded | Spheres | Capsules):
        return solid.core, solid.radius
    return solid, SHARP


def solid_parts(
    name: str, solid: Solid, most: float = MOST_COORDINATE
) -> tuple[Spatial | HalfSpaces, NDArray[np.float64]]:
    """Core and radii of three-dimensional bodies.

    Raises:
        ArgumentError: not a batch of bodies, polygons, or a number beyond ``most``.
    """
    core, radius = parts(solid)
    if not isinstance(core, Spatial | HalfSpaces):
        raise ArgumentError(f"{name}: {no_body(core)}")
    if core.largest > most or (radius is not SHARP and radius.max(initial=0.0) > most):
        raise ArgumentError(
            f"{name}: a number beyond {most:g}; scale the scene down".replace("+", "")
        )
    return core, radius


def no_body(value: object) -> str:
    """What ``value`` is, and what would work in its place."""
    if isinstance(value, Polygons):
        return "Polygons, expected bodies in space; give them thickness as Hulls"
    kinds = (
        "Tetrahedra, Boxes, Parallelepipeds, Hulls, Cylinders, Cones, Ellipsoids, HalfSpaces, "
        "Rounded, Spheres, Capsules, MeshTree"
    )
    way = ""
    if hasattr(value, "vertices") and hasattr(value, "faces"):
        way = "; a mesh is MeshTree(mesh.vertices, mesh.faces), its hull Hulls.from_trimesh(mesh)"
    elif type(value).__module__.startswith("coal"):
        way = "; Shape.from_coal(shape) converts it"
    return f"{type(value).__name__}, expected one of {kinds}{way}"
