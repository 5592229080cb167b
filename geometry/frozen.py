"""Immutable arrays: native kernels read them long after they were checked."""

from dataclasses import fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.geometry.arrays import all_finite, indices, numbers

_T = TypeVar("_T", bound=np.generic)


def frozen(array: NDArray[_T]) -> NDArray[_T]:
    """A C-contiguous copy in immutable memory; ``setflags`` cannot make it writeable."""
    if array.size == 0:
        return sealed(np.empty(array.shape, dtype=array.dtype))
    return np.frombuffer(array.tobytes(), dtype=array.dtype).reshape(array.shape)


def sealed(array: NDArray[_T]) -> NDArray[_T]:
    """A read-only view without a copy. The caller must have the only reference to ``array``."""
    array.setflags(write=False)
    return array[:]


def frozen_finite(
    name: str, value: ArrayLike, shape: tuple[int | None, ...]
) -> NDArray[np.float64]:
    """As :func:`finite`, but an immutable copy."""
    return all_finite(name, frozen(numbers(name, value, shape)))


def frozen_indices(
    name: str, value: ArrayLike, shape: tuple[int | None, ...], upper: int
) -> NDArray[np.int32]:
    """As :func:`indices`, but an immutable copy."""
    return indices(name, frozen(indices(name, value, shape, upper)), shape, upper)


class Rebuilt:
    """Mixin for frozen dataclasses: ``copy`` and ``pickle`` call the constructor and its checks."""

    def __reduce__(self) -> tuple[type, tuple[Any, ...]]:
        """The class and the arguments of its constructor."""
        given = tuple(getattr(self, f.name) for f in fields(self) if f.init)  # type: ignore[arg-type]
        return type(self), given
