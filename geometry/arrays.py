"""Check arguments and convert them to the (immutable) arrays that native kernels take."""

import math
import operator
import os
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.findings import ArgumentError


def finite(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """``value`` as a C-contiguous float64 array of ``shape`` (``None``: any length).

    Raises:
        ArgumentError: the shape differs, an entry is NaN or infinite, or entries are text, complex
            or dates; the message names the argument and the first bad row.
    """
    return all_finite(name, numbers(name, value, shape))


def numbers(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """As :func:`finite`, but NaN and infinite entries are accepted."""
    try:
        given = np.asarray(value)
        if given.dtype.kind in "cSUVMm":
            raise TypeError(f"its entries are {given.dtype}")
        array = np.ascontiguousarray(given, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(f"{name}: not an array of numbers ({error})") from None
    fits = [want is None or have == want for have, want in zip(array.shape, shape, strict=False)]
    if array.ndim != len(shape) or not all(fits):
        wanted = ", ".join("N" if want is None else str(want) for want in shape)
        raise ArgumentError(f"{name}: shape {array.shape}, expected ({wanted})")
    return array


def all_finite(name: str, array: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ``array``, or raise the error of :func:`finite` if an entry is not finite."""
    known = np.isfinite(array)  # only once: another thread may change the array meanwhile
    if not known.all():
        bad = np.argwhere(~known)[0]
        where = f"row {bad[0]}" if array.ndim > 1 else f"index {bad[0]}"
        raise ArgumentError(f"{name}: {array[tuple(bad)]} in {where}; every entry must be finite")
    return array


def indices(
    name: str, value: ArrayLike, shape: tuple[int | None, ...], upper: int
) -> NDArray[np.int32]:
    """``value`` as a C-contiguous int32 array of ``shape`` with entries in ``[0, upper)``.

    Raises:
        ArgumentError: entries that are not integers, another shape, or an index out of range (the
            message names its row).
    """
    array = np.asarray(value)
    if array.size == 0:
        array = array.astype(np.int32)
    if not np.issubdtype(array.dtype, np.integer):
        raise ArgumentError(f"{name}: dtype {array.dtype}, expected integers")
    if array.ndim != len(shape) or any(
        want is not None and have != want for have, want in zip(array.shape, shape, strict=True)
    ):
        wanted = ", ".join("N" if want is None else str(want) for want in shape)
        raise ArgumentError(f"{name}: shape {array.shape}, expected ({wanted})")
    outside = (array < 0) | (array >= upper)
    if outside.any():
        bad = np.argwhere(outside)[0]
        raise ArgumentError(
            f"{name}: index {array[tuple(bad)]} in row {bad[0]}, expected 0 to {upper - 1}"
        )
    return np.ascontiguousarray(array, dtype=np.int32)


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
    if type(value) is np.ndarray and value.dtype == np.float64 and value.ndim == len(shape):
        fits = all(n is None or n == have for n, have in zip(shape, value.shape, strict=True))
        if fits and 0 < value.size <= 1000:  # longer products start the threads of BLAS
            array: NDArray[np.float64] = np.frombuffer(value.tobytes()).reshape(value.shape)
            if math.isfinite(np.vdot(array, array)):  # only if all entries are
                return array
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


#: A larger number of threads is probably a mistake and is refused.
MOST_THREADS = 1024


def thread_count(threads: int) -> int:
    """The number of threads; 0 means all processors.

    Raises:
        ArgumentError: ``threads`` is not an integer from 0 to 1024.
    """
    try:
        count = operator.index(threads)
    except TypeError:
        count = -1
    if isinstance(threads, bool) or not 0 <= count <= MOST_THREADS:
        raise ArgumentError(
            f"threads: {threads!r:.40}, expected an integer from 0 (all processors) "
            f"to {MOST_THREADS}"
        )
    return count or os.cpu_count() or 1
