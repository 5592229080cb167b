"""Argument checks that name what is wrong and what would work."""

import dataclasses
import functools
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.findings import ArgumentError


def above_zero(owner: object, *names: str, zero: bool = False) -> None:
    """Raise ``ArgumentError`` unless every number of the named fields is finite and above 0.

    If ``zero``, 0 is allowed.
    """
    for name in names:
        value = np.asarray(getattr(owner, name), dtype=float)
        if not (np.isfinite(value) & ((value >= 0) if zero else (value > 0))).all():
            wanted = "0 or more" if zero else "above 0"
            raise ArgumentError(f"{type(owner).__name__}.{name} {value}: expected {wanted}")


not_negative = functools.partial(above_zero, zero=True)


def vector(owner: object, name: str, size: int) -> tuple[float, ...]:
    """The numbers of a field; raise ``ArgumentError`` unless they are ``size`` finite numbers."""
    value = getattr(owner, name)
    try:
        numbers = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        numbers = np.zeros(0)
    if numbers.shape != (size,) or not np.isfinite(numbers).all():
        raise ArgumentError(
            f"{type(owner).__name__}.{name} {value!r}: expected {size} finite numbers"
        )
    return tuple(numbers.tolist())


def shaped(owner: object, shape: tuple[int, ...], meaning: str, *names: str) -> None:
    """Raise ``ArgumentError`` with the meaning of the axes if a named field lacks ``shape``."""
    for name in names:
        found = np.shape(getattr(owner, name))
        if found != shape:
            raise ArgumentError(
                f"{type(owner).__name__}.{name}: shape {found}, expected {shape}: {meaning}"
            )


def check_keys(found: Iterable[str], kind: Any, where: str = "") -> None:
    """Raise ``ArgumentError`` if a key is not a field of the dataclass ``kind``."""
    known = [field.name for field in dataclasses.fields(kind)]
    for key in found:
        if key not in known:
            raise ArgumentError(f"{where}no key {key!r}; expected some of {', '.join(known)}")


def rigid_pose(pose: object) -> NDArray[np.float64]:
    """``pose`` as an array.

    Raises:
        ArgumentError: not a homogeneous (4, 4) matrix of a rotation and a translation.
    """
    matrix = np.asarray(pose, dtype=float)
    good = matrix.shape == (4, 4) and bool(np.isfinite(matrix).all())
    if good:
        turn = matrix[:3, :3]
        good = np.allclose(turn @ turn.T, np.eye(3), atol=1e-6) and np.linalg.det(turn) > 0
        good = good and np.array_equal(matrix[3], [0, 0, 0, 1])
    if not good:
        raise ArgumentError(
            "base_pose: expected a homogeneous (4, 4) transform: a rotation and a translation"
        )
    return matrix
