"""Batches of cylinders, cones, ellipsoids and half-spaces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.arrays import in_a_line
from tauguard.findings import ArgumentError
from tauguard.geometry import frozen_finite, sealed
from tauguard.rigid.shapes import ORTHONORMAL_TOLERANCE, Core, placed_rows, rotations


def lengths(name: str, value: ArrayLike, count: int, instead: str = "") -> NDArray[np.float64]:
    """``value`` as ``count`` lengths; one number is repeated. Zero is accepted without ``instead``.

    Raises:
        ArgumentError: another shape, an entry that is not finite or negative, or a zero where
            ``instead`` says what to use.
    """
    if type(value) in (int, float) and 0 < value < np.inf:  # type: ignore[operator]
        return sealed(np.full(count, value, dtype=np.float64))
    raw = np.asarray(value)
    raw = np.broadcast_to(raw, (count,)) if raw.ndim == 0 else raw
    out = frozen_finite(name, raw, (count,))
    bad = out <= 0 if instead else out < 0
    if bad.any():
        row = int(np.argmax(bad))
        wanted = f"more than 0; {instead}" if instead else "0 or more"
        raise ArgumentError(f"{name}: {out[row]} in row {row}; expected {wanted}")
    return out


def _pairs(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Two lengths and a zero in one row. Shape (N, 3)."""
    out = np.zeros((len(first), 3))
    out[:, 0], out[:, 1] = first, second
    return out


def _set_axial(
    body: object,
    center: ArrayLike,
    radius: ArrayLike,
    name: str,
    half: ArrayLike,
    rotation: ArrayLike | None,
) -> None:
    """Check and copy the arrays of bodies with an axis; ``name`` is that of half their length."""
    middle = frozen_finite("center", center, (None, 3))
    count = len(middle)
    object.__setattr__(body, "center", middle)
    line = "a segment is Capsules(start, end, 0)"
    object.__setattr__(body, "radius", lengths("radius", radius, count, line))
    disc = "a disc is a cylinder with a small half length"
    object.__setattr__(body, name, lengths(name, half, count, disc))
    object.__setattr__(body, "rotation", rotations("rotation", rotation, count)[0])


@dataclass(frozen=True, eq=False)
class Cylinders(Core):
    """Cylinders, whose axis is the z axis of ``rotation``.

    Args:
        center: The middle of the axis. Shape (N, 3).
        radius: More than 0. Shape (N,), or one number for all.
        half_length: Half the length along the axis, more than 0. Shape (N,), or one number.
        rotation: Body to world, as for :class:`Boxes`. Shape (N, 3, 3) or (3, 3).

    Raises:
        ArgumentError: wrong shapes or lengths, an entry that is not finite, a length that is not
            positive, or a rotation that is not orthonormal (named with its row).
    """

    kind: ClassVar[int] = 9
    center: NDArray[np.float64]
    radius: NDArray[np.float64]
    half_length: NDArray[np.float64]
    rotation: NDArray[np.float64]

    __repr__ = in_a_line

    def __init__(
        self,
        center: ArrayLike,
        radius: ArrayLike,
        half_length: ArrayLike,
        rotation: ArrayLike | None = None,
    ) -> None:
        """Check and copy the arrays."""
        _set_axial(self, center, radius, "half_length", half_length, rotation)

    def __len__(self) -> int:
        return len(self.center)

    @cached_property
    def packed(self) -> NDArray[np.float64]:
        """Centre, radius, half length, 0 and rotation in one row. Shape (N, 15)."""
        return placed_rows(self.center, _pairs(self.radius, self.half_length), self.rotation)


@dataclass(frozen=True, eq=False)
class Cones(Core):
    """Circular cones: the apex is at ``half_height`` along the z axis of ``rotation``.

    Args:
        center: The middle between apex and base. Shape (N, 3).
        radius: Radius of the base, more than 0. Shape (N,), or one number for all.
        half_height: More than 0. Shape (N,), or one number for all.
        rotation: Body to world, as for :class:`Boxes`. Shape (N, 3, 3) or (3, 3).

    Raises:
        ArgumentError: as for :class:`Cylinders`.
    """

    kind: ClassVar[int] = 10
    center: NDArray[np.float64]
    radius: NDArray[np.float64]
    half_height: NDArray[np.float64]
    rotation: NDArray[np.float64]

    __repr__ = in_a_line

    def __init__(
        self,
        center: ArrayLike,
        radius: ArrayLike,
        half_height: ArrayLike,
        rotation: ArrayLike | None = None,
    ) -> None:
        """Check and copy the arrays."""
        _set_axial(self, center, radius, "half_height", half_height, rotation)

    def __len__(self) -> int:
        return len(self.center)

    @cached_property
    def packed(self) -> NDArray[np.float64]:
        """Centre, radius, half height, 0 and rotation in one row. Shape (N, 15)."""
        return placed_rows(self.center, _pairs(self.radius, self.half_height), self.rotation)


@dataclass(frozen=True, eq=False)
class Ellipsoids(Core):
    """Ellipsoids with their axes along those of ``rotation``.

    Args:
        center: Shape (N, 3).
        radii: The three half axes, more than 0. Shape (N, 3).
        rotation: Body to world, as for :class:`Boxes`. Shape (N, 3, 3) or (3, 3).

    Raises:
        ArgumentError: as for :class:`Cylinders`.
    """

    kind: ClassVar[int] = 8
    center: NDArray[np.float64]
    radii: NDArray[np.float64]
    rotation: NDArray[np.float64]

    __repr__ = in_a_line

    def __init__(
        self, center: ArrayLike, radii: ArrayLike, rotation: ArrayLike | None = None
    ) -> None:
        """Check and copy the arrays."""
        middle = frozen_finite("center", center, (None, 3))
        size = frozen_finite("radii", radii, (len(middle), 3))
        if (size <= 0).any():
            row, axis = np.argwhere(size <= 0)[0]
            raise ArgumentError(
                f"radii: {size[row, axis]} in row {row}; expected more than 0; use a small radius "
                "for a flat ellipsoid"
            )
        object.__setattr__(self, "center", middle)
        object.__setattr__(self, "radii", size)
        object.__setattr__(self, "rotation", rotations("rotation", rotation, len(middle))[0])

    def __len__(self) -> int:
        return len(self.center)

    @cached_property
    def packed(self) -> NDArray[np.float64]:
        """Centre, radii and rotation in one row. Shape (N, 15)."""
        return placed_rows(self.center, self.radii, self.rotation)


@dataclass(frozen=True, eq=False)
class HalfSpaces(Core):
    """The sets ``normal . x <= offset``; the normal points out of the half-space.

    Args:
        normal: Unit vectors, to 1e-6. Shape (N, 3).
        offset: Distance of the plane from the origin along the normal. Shape (N,), or one number.

    Raises:
        ArgumentError: wrong shapes or lengths, an entry that is not finite, or a normal that is not
            a unit vector (named with its row).
    """

    kind: ClassVar[int] = 5
    normal: NDArray[np.float64]
    offset: NDArray[np.float64]

    __repr__ = in_a_line

    def __init__(self, normal: ArrayLike, offset: ArrayLike) -> None:
        """Check and copy the arrays."""
        unit = frozen_finite("normal", normal, (None, 3))
        given = np.asarray(offset)
        given = np.broadcast_to(given, (len(unit),)) if given.ndim == 0 else given
        length = np.hypot(np.hypot(unit[:, 0], unit[:, 1]), unit[:, 2])
        bad = ~(np.abs(length - 1) <= ORTHONORMAL_TOLERANCE)
        if bad.any():
            row = int(np.argmax(bad))
            mend = (
                "divide normal and offset by the length" if length[row] > 0 else "give a direction"
            )
            raise ArgumentError(
                f"normal: length {length[row]:.7g} in row {row}, expected 1 (to 1e-6); {mend}"
            )
        object.__setattr__(self, "normal", unit)
        object.__setattr__(self, "offset", frozen_finite("offset", given, (len(unit),)))

    def __len__(self) -> int:
        return len(self.normal)

    @cached_property
    def packed(self) -> NDArray[np.float64]:
        """Normal and offset in one row. Shape (N, 4)."""
        return sealed(np.column_stack([self.normal, self.offset]))


Curved = Cylinders | Cones | Ellipsoids
