"""Immutable arrays for native kernels, which keep arrays after they were checked."""

from dataclasses import fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.geometry.arrays import all_finite, indices, numbers

_T = TypeVar("_T", bound=np.generic)


def frozen(array: NDArray[_T]) -> NDArray[_T]:
    """A C-contiguous copy over immutable memory, which no flag makes writeable again."""
    if array.size == 0:
        return sealed(np.empty(array.shape, dtype=array.dtype))
    return np.frombuffer(array.tobytes(), dtype=array.dtype).reshape(array.shape)


def sealed(array: NDArray[_T]) -> NDArray[_T]:
    """A read-only view, without a copy, of an array that only the caller holds."""
    array.setflags(write=False)
    return array[:]


def frozen_finite(
    name: str, value: ArrayLike, shape: tuple[int | None, ...]
) -> NDArray[np.float64]:
    """As :func:`finite`, but a private copy, so that nothing can change it after the check."""
    return all_finite(name, frozen(numbers(name, value, shape)))


def frozen_indices(
    name: str, value: ArrayLike, shape: tuple[int | None, ...], upper: int
) -> NDArray[np.int32]:
    """As :func:`indices`, but a private copy, so that nothing can change it after the check."""
    return indices(name, frozen(indices(name, value, shape, upper)), shape, upper)


class Rebuilt:
    """Mixin of frozen dataclasses: a copy or an unpickled value passes the constructor's checks."""

    def __reduce__(self) -> tuple[type, tuple[Any, ...]]:
        """The class and the arguments of its constructor."""
        given = tuple(getattr(self, f.name) for f in fields(self) if f.init)  # type: ignore[arg-type]
        return type(self), given
