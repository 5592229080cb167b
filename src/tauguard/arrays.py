"""Array types for all packages."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Array of doubles; docstrings give units and shapes.
Array = NDArray[np.float64]
#: Array of bools.
Bools = NDArray[np.bool_]

FEW = 7  #: size of the largest array that a message shows whole [elements]
SHORT = 60  #: length of the longest text that a message shows whole [characters]


def runs(mask: ArrayLike) -> NDArray[np.int64]:
    """First row, and row after the last, of each run of True in a mask (T,); shape (K, 2)."""
    padded = np.concatenate([[False], np.asarray(mask, dtype=np.bool_), [False]])
    return np.flatnonzero(np.diff(padded.astype(np.int8))).reshape(-1, 2)


def in_a_line(value: Any) -> str:
    """Short ``repr`` of a dataclass: the shape of a large array, the length of a long text."""
    fields = [field for field in dataclasses.fields(value) if field.repr]
    parts = [f"{field.name}={_brief(getattr(value, field.name))}" for field in fields]
    return f"{type(value).__name__}({', '.join(parts)})"


def _brief(value: Any) -> str:
    if isinstance(value, np.ndarray):
        if value.ndim == 1 and value.size <= FEW and value.dtype.kind in "fiub":
            flags = value.dtype.kind == "b"
            return f"[{', '.join(str(x) if flags else f'{x:.4g}' for x in value)}]"
        return f"array{value.shape}"
    if isinstance(value, str):
        return repr(value) if len(value) <= SHORT else f"<text of {len(value)} characters>"
    if dataclasses.is_dataclass(value) or (isinstance(value, dict) and len(value) > 2):
        return f"<{type(value).__name__}>"
    if isinstance(value, tuple) and len(repr(value)) > 2 * SHORT:
        return f"<{len(value)} entries>"
    said = repr(value)
    return said if len(said) <= 2 * SHORT else f"<{type(value).__name__}>"
