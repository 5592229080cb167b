"""Check arguments and convert them to the arrays that native kernels take."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def finite(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """``value`` as a C-contiguous float64 array of ``shape`` (``None``: any length).

    Raises:
        ValueError: the shape differs, an entry is NaN or infinite, or entries are text, complex
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
        raise ValueError(f"{name}: not an array of numbers ({error})") from None
    fits = [want is None or have == want for have, want in zip(array.shape, shape, strict=False)]
    if array.ndim != len(shape) or not all(fits):
        wanted = ", ".join("N" if want is None else str(want) for want in shape)
        raise ValueError(f"{name}: shape {array.shape}, expected ({wanted})")
    return array


def all_finite(name: str, array: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ``array``, or raise the error of :func:`finite` if an entry is not finite."""
    known = np.isfinite(array)  # once: another thread may write the array meanwhile
    if not known.all():
        bad = np.argwhere(~known)[0]
        where = f"row {bad[0]}" if array.ndim > 1 else f"index {bad[0]}"
        raise ValueError(f"{name}: {array[tuple(bad)]} in {where}; every entry must be finite")
    return array


def indices(
    name: str, value: ArrayLike, shape: tuple[int | None, ...], upper: int
) -> NDArray[np.int32]:
    """``value`` as a C-contiguous int32 array of ``shape`` with entries in ``[0, upper)``.

    Raises:
        ValueError: entries that are not integers, another shape, or an index out of range (the
            message names its row).
    """
    array = np.asarray(value)
    if array.size == 0:
        array = array.astype(np.int32)
    if not np.issubdtype(array.dtype, np.integer):
        raise ValueError(f"{name}: dtype {array.dtype}, expected integers")
    if array.ndim != len(shape) or any(
        want is not None and have != want for have, want in zip(array.shape, shape, strict=True)
    ):
        wanted = ", ".join("N" if want is None else str(want) for want in shape)
        raise ValueError(f"{name}: shape {array.shape}, expected ({wanted})")
    outside = (array < 0) | (array >= upper)
    if outside.any():
        bad = np.argwhere(outside)[0]
        raise ValueError(
            f"{name}: index {array[tuple(bad)]} in row {bad[0]}, expected 0 to {upper - 1}"
        )
    return np.ascontiguousarray(array, dtype=np.int32)
