"""Batches of polytopes on plain arrays: tetrahedra, boxes, parallelepipeds, hulls, polygons.

A batch has N bodies of one kind. Degenerate bodies are legal: a flat tetrahedron, a box without
thickness, a single point. Lengths may be in any unit; both sides of a query must use the same one.
A batch has its own immutable copy of its arrays.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.arrays import in_a_line
from tauguard.findings import ArgumentError
from tauguard.geometry import Rebuilt, frozen, frozen_finite, sealed
from tauguard.rigid import _rigid

#: Largest deviation of an entry of R^T R from the identity; beyond it R is refused.
ORTHONORMAL_TOLERANCE = 1e-6
#: Largest coordinate and radius; products of larger ones would overflow.
MOST_COORDINATE = 1e100
#: The radii of bodies without radii.
SHARP = np.zeros(1)
_NO_OFFSETS = np.zeros(1, dtype=np.int64)
_S = TypeVar("_S", bound="Shape")


class Shape(Rebuilt):
    """A batch of N convex bodies of one kind.

    ``len(bodies)`` is N. ``bodies[i]``, a slice, an array of rows and a mask give batches again,
    and a loop over ``bodies`` gives batches of one body.
    """

    def __len__(self) -> int:
        raise NotImplementedError

    def __getitem__(self, rows: int | slice | ArrayLike) -> Self:
        """The bodies of some rows, as a batch.

        Raises:
            IndexError: a row that does not exist.
        """
        index = np.atleast_1d(
            np.arange(len(self))[rows if isinstance(rows, slice) else _index(rows)]
        )
        return self._at(index)

    def __iter__(self) -> Iterator[Self]:
        return (self[i] for i in range(len(self)))

    def _at(self, index: NDArray[np.int64]) -> Self:
        return type(self)(*(getattr(self, f.name)[index] for f in fields(self) if f.init))  # type: ignore[arg-type]

    @property
    def ready(self) -> _rigid.Batch | None:
        """The native form, if :func:`distance` takes the bodies; else ``None``."""
        raise NotImplementedError

    @classmethod
    def from_trimesh(cls, meshes: Any) -> Self:
        """The convex hulls of one or more ``trimesh.Trimesh``.

        Raises:
            ArgumentError: objects that are no meshes, or a class that does not include hulls.
        """
        from tauguard.rigid.imports import from_trimesh

        return _expected(cls, from_trimesh(meshes))

    @classmethod
    def from_mujoco(cls, model: Any, geoms: Any) -> Self:
        """Geoms of a MuJoCo model, in the frames of their bodies (``pose=`` is the body's pose).

        Args:
            model: MjModel.
            geoms: A name or id, or several of the same type. ``Shape.from_mujoco`` takes any type.

        Raises:
            ArgumentError: geoms of several types or of a type without a convex shape (named), a
                name that the model does not have, or a type that is not this class.
        """
        from tauguard.rigid.imports import from_mujoco

        return _expected(cls, from_mujoco(model, geoms))

    @classmethod
    def from_coal(cls, shapes: Any) -> Self:
        """One or more shapes of coal, of one class, in their own frames.

        Raises:
            ArgumentError: several classes, a class without a counterpart, or one that is not this.
        """
        from tauguard.rigid.imports import from_coal

        return _expected(cls, from_coal(shapes))


def _index(rows: Any) -> Any:
    index = np.asarray(rows)
    return index if index.size else index.astype(np.int64)


def _expected(cls: type[_S], bodies: Shape) -> _S:
    if not isinstance(bodies, cls):
        kind = type(bodies).__name__
        raise ArgumentError(
            f"{cls.__name__}: these are {kind}; use {kind} or Shape, which takes every kind"
        )
    return bodies


class Core(Shape):
    """A batch of bodies without radii."""

    #: Number of this kind of bodies in native code.
    kind: ClassVar[int]

    def grown(
        self,
        radius: NDArray[np.float64],
        poses: NDArray[np.float64] | None = None,
        moving: bool = False,
    ) -> _rigid.Batch:
        """The native form of the bodies grown by balls, with one radius per body or one for all.

        ``moving``: the bodies of this or the other side have poses.
        """
        if radius is SHARP and not moving:
            return self.native
        offsets = getattr(self, "offsets", _NO_OFFSETS)
        index = self.index if moving else None
        return _rigid.Batch(self.kind, self.packed, offsets, radius, poses, index)

    @property
    def index(self) -> _rigid.HullIndex | None:
        """For fast queries at many poses; only of a batch of one hull."""
        return None

    @cached_property
    def native(self) -> _rigid.Batch:
        """The native form of the bodies."""
        return _rigid.Batch(self.kind, self.packed, getattr(self, "offsets", _NO_OFFSETS), SHARP)

    @cached_property
    def ready(self) -> _rigid.Batch | None:
        """See :class:`Shape`."""
        return self.native if self.largest <= MOST_COORDINATE else None

    @property
    def packed(self) -> NDArray[np.float64]:
        """The numbers of the batch, for native kernels."""
        raise NotImplementedError

    @cached_property
    def largest(self) -> float:
        """The largest magnitude in ``packed``."""
        return self.native.largest


@dataclass(frozen=True, eq=False)
class Tetrahedra(Core):
    """Tetrahedra: convex hulls of four points, in any order and orientation.

    Args:
        vertices: Shape (N, 4, 3).

    Raises:
        ArgumentError: wrong shape, or an entry that is not finite (named with its row).
    """

    kind: ClassVar[int] = 0
    vertices: NDArray[np.float64]

    __repr__ = in_a_line

    def __init__(self, vertices: ArrayLike) -> None:
        """Check and copy the array."""
        object.__setattr__(self, "vertices", frozen_finite("vertices", vertices, (None, 4, 3)))

    def __len__(self) -> int:
        return len(self.vertices)

    @cached_property
    def packed(self) -> NDArray[np.float64]:
        """The vertices of a body in one row, for native kernels. Shape (N, 12)."""
        return self.vertices.reshape(len(self), 12)


@dataclass(frozen=True, eq=False)
class Boxes(Core):
    """The sets ``center + rotation @ diag(half_extents) @ u``, ``|u| <= 1`` per coordinate.

    A rotation that is not exactly orthonormal gives a slightly oblique box. Queries are exact for
    this box.

    Args:
        center: Shape (N, 3).
        half_extents: Shape (N, 3), zero or more.
        rotation: Shape (N, 3, 3) or (3, 3), body to world; entries of R^T R within 1e-6 of the
            identity. ``None``: along the axes.

    Raises:
        ArgumentError: wrong shapes or lengths, an entry that is not finite, a negative half extent,
            a rotation that is not orthonormal (named with its row).
    """

    kind: ClassVar[int] = 1
    center: NDArray[np.float64]
    half_extents: NDArray[np.float64]
    rotation: NDArray[np.float64]
    #: The largest entry of ``|R^T R - I|`` over the batch, rounded up.
    skew: float = field(init=False, repr=False)

    __repr__ = in_a_line

    def __init__(
        self, center: ArrayLike, half_extents: ArrayLike, rotation: ArrayLike | None = None
    ) -> None:
        """Check and copy the arrays."""
        center = frozen_finite("center", center, (None, 3))
        half_extents = frozen_finite("half_extents", half_extents, (len(center), 3))
        rotation, skew = rotations("rotation", rotation, len(center))
        if _rigid.first_negative(half_extents) < half_extents.size:
            row, axis = np.argwhere(half_extents < 0)[0]
            raise ArgumentError(
                f"half_extents: {half_extents[row, axis]} in row {row}; expected 0 or more"
            )
        object.__setattr__(self, "skew", skew)
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "half_extents", half_extents)
        object.__setattr__(self, "rotation", rotation)

    def __len__(self) -> int:
        return len(self.center)

    @cached_property
    def packed(self) -> NDArray[np.float64]:
        """Centre, half extents and rotation (row-major) of a body in one row. Shape (N, 15)."""
        return placed_rows(self.center, self.half_extents, self.rotation)

    @cached_property
    def blocks(self) -> NDArray[np.float64]:
        """Eight boxes per row, for batched queries. Shape (ceil(N / 8), 72).

        Centres are in double precision, the rest in single precision. The last row is filled up
        with copies of the last box.
        """
        out = np.empty((-(-len(self) // 8), 72))
        _rigid.pack_boxes(self.packed, out)
        return sealed(out)


@dataclass(frozen=True, eq=False)
class Parallelepipeds(Core):
    """The sets ``origin + s @ edges``, ``0 <= s <= 1`` per coordinate.

    Args:
        origin: A corner. Shape (N, 3).
        edges: ``edges[n, k]`` is the k-th edge vector from the corner. Shape (N, 3, 3).

    Raises:
        ArgumentError: wrong shapes or lengths, or an entry that is not finite (named with its row).
    """

    kind: ClassVar[int] = 2
    origin: NDArray[np.float64]
    edges: NDArray[np.float64]

    __repr__ = in_a_line

    def __init__(self, origin: ArrayLike, edges: ArrayLike) -> None:
        """Check and copy the arrays."""
        object.__setattr__(self, "origin", frozen_finite("origin", origin, (None, 3)))
        object.__setattr__(self, "edges", frozen_finite("edges", edges, (len(self.origin), 3, 3)))

    def __len__(self) -> int:
        return len(self.origin)

    @cached_property
    def packed(self) -> NDArray[np.float64]:
        """Origin and the three edges of a body in one row. Shape (N, 12)."""
        out = np.concatenate([self.origin, self.edges.reshape(len(self), 9)], axis=1)
        return sealed(out)


@dataclass(frozen=True, eq=False)
class PointSets(Core):
    """Base of :class:`Hulls` and :class:`Polygons`, whose bodies have any number of points."""

    vertices: NDArray[np.float64]
    offsets: NDArray[np.int64]

    dimensions: ClassVar[int]

    __repr__ = in_a_line

    def __init__(self, vertices: ArrayLike, offsets: ArrayLike) -> None:
        """Check and copy the arrays."""
        if isinstance(vertices, list | tuple) and any(_ndim(v) > 1 for v in vertices[:1]):
            raise ArgumentError(
                f"vertices: {len(vertices)} arrays, expected one (M, {self.dimensions}): "
                "np.concatenate(arrays) and the offsets np.cumsum([0, *map(len, arrays)])"
            )
        points = frozen_finite("vertices", vertices, (None, self.dimensions))
        object.__setattr__(self, "vertices", points)
        object.__setattr__(self, "offsets", _partition(offsets, len(points)))

    @classmethod
    def of_checked(cls, vertices: NDArray[np.float64], offsets: NDArray[np.int64]) -> Self:
        """Of immutable arrays that need no checks."""
        self = object.__new__(cls)
        self.__dict__.update(vertices=vertices, offsets=offsets)
        return self

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def _at(self, index: NDArray[np.int64]) -> Self:
        parts = [self.vertices[self.offsets[i] : self.offsets[i + 1]] for i in index]
        points = np.concatenate(parts) if parts else self.vertices[:0]
        return type(self)(points, np.cumsum([0, *map(len, parts)]))

    @property
    def packed(self) -> NDArray[np.float64]:
        """The vertices of all bodies. Shape (M, 2) or (M, 3)."""
        return self.vertices


class Hulls(PointSets):
    """Convex hulls; each body has any number of points.

    Body n owns ``vertices[offsets[n]:offsets[n + 1]]``.

    Args:
        vertices: Shape (M, 3). Points inside the hull are legal.
        offsets: Shape (N + 1,), integers, strictly increasing from 0 to M.

    Raises:
        ArgumentError: wrong shapes, an entry that is not finite, offsets that do not partition the
            vertices, or an empty hull (named with its row).
    """

    kind, dimensions = 3, 3

    @cached_property
    def index(self) -> _rigid.HullIndex | None:
        """See :class:`Core`. Hulls of fewer points are faster without."""
        if len(self) > 1 or len(self.vertices) <= 32:
            return None
        return _rigid.HullIndex(self.vertices)


class Polygons(PointSets):
    """Convex polygons in the plane: hulls of any number of points, in any order.

    They are tested against polygons only. Arguments and errors are those of :class:`Hulls`, with
    ``vertices`` of shape (M, 2).
    """

    kind, dimensions = 4, 2


def rotations(name: str, value: ArrayLike | None, count: int) -> tuple[NDArray[np.float64], float]:
    """Rotations of shape (count, 3, 3), and the largest entry of ``|R^T R - I|``, rounded up.

    One matrix is repeated for all rows; ``None`` is the identity.

    Raises:
        ArgumentError: quaternions or another shape, an entry that is not finite, or a matrix that
            is not orthonormal (named with its row).
    """
    if value is None:
        return sealed(np.tile(np.eye(3), (count, 1, 1))), 2.0**-50
    raw = np.asarray(value)
    if raw.ndim == 2 and raw.shape == (3, 3):
        raw = np.broadcast_to(raw, (count, 3, 3))
    if raw.shape[-1:] == (4,) and raw.ndim < 3:
        raise ArgumentError(f"{name}: shape {raw.shape}, expected (N, 3, 3); {FROM_QUATERNIONS}")
    rotation = frozen_finite(name, raw, (count, 3, 3))
    skew, row = _rigid.box_skew(rotation.reshape(-1, 9), ORTHONORMAL_TOLERANCE)
    if row < count:
        raise ArgumentError(
            f"{name}: row {row} is not orthonormal: {not_orthonormal(rotation[row])}"
        )
    return rotation, skew


#: What works in place of quaternions.
FROM_QUATERNIONS = (
    "for quaternions use scipy's Rotation.from_quat(q).as_matrix(), where q is x, y, z, w; "
    "with MuJoCo's order w, x, y, z add scalar_first=True"
)


def not_orthonormal(rotation: NDArray[np.float64]) -> str:
    """How far a (3, 3) matrix is from orthonormal, and how to mend it."""
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs(rotation.T @ rotation - np.eye(3)).max()
    text = f"R^T R differs from the identity by {off:.3g}, allowed is {ORTHONORMAL_TOLERANCE:g}"
    if off < 0.1:
        return f"{text}; the nearest rotation is u @ vt of u, _, vt = np.linalg.svd(R)"
    return text


def placed_rows(
    center: NDArray[np.float64], size: NDArray[np.float64], rotation: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Centre, three sizes and rotation (row-major) of a body in one row. Shape (N, 15)."""
    out = np.empty((len(center), 15))
    out[:, :3], out[:, 3:6], out[:, 6:] = center, size, rotation.reshape(len(center), 9)
    return sealed(out)


def _ndim(value: ArrayLike) -> int:
    return np.asarray(value, dtype=object).ndim  # without an error for rows of several lengths


def _partition(given: ArrayLike, count: int) -> NDArray[np.int64]:
    array = np.asarray(given)
    if array.ndim != 1 or len(array) == 0 or not np.issubdtype(array.dtype, np.integer):
        raise ArgumentError(
            f"offsets: shape {array.shape} of {array.dtype}, expected (N + 1,) integers"
        )
    offsets = frozen(array.astype(np.int64))  # an overflow becomes negative and is refused below
    if offsets[0] != 0 or offsets[-1] != count:
        raise ArgumentError(
            f"offsets: run from {offsets[0]} to {offsets[-1]}, expected 0 to {count}"
        )
    empty = offsets[1:] <= offsets[:-1]
    if empty.any():
        row = int(np.argmax(empty))
        raise ArgumentError(
            f"offsets: hull {row} is empty (offsets {offsets[row]} and {offsets[row + 1]}); "
            "expected strictly increasing offsets"
        )
    return offsets


Bodies = Tetrahedra | Boxes | Parallelepipeds | Hulls | Polygons
