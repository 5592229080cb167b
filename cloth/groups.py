"""Groups of vertices, and the pairs of groups to test."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.geometry import Rebuilt, frozen, frozen_indices


@dataclass(frozen=True, eq=False)
class Groups(Rebuilt):
    """The group of every vertex, and a table of the pairs of groups to test; read-only copies.

    Attributes:
        ids: Shape (V,), the group of every vertex, 0 to G - 1. All vertices of a face belong to one
            group.
        meets: Shape (G, G), symmetric. ``meets[a, b]`` is False where features of ``a`` and ``b``
            are not tested; ``meets[a, a]`` is False for a body that is not tested against itself.

    Raises:
        ValueError: the table is not square, not symmetric or not of bools (or 0 and 1), or an id
            has no row in the table.

    Example:
        A cloth (group 0) tested against itself and against a rigid body (group 1)::

            Groups(ids, [[True, True], [True, False]])
    """

    ids: NDArray[np.int32]
    meets: NDArray[np.bool_]

    def __init__(self, ids: ArrayLike, meets: ArrayLike) -> None:
        """Check and copy both arrays."""
        table = frozen(_table(meets))
        if (table != table.T).any():
            a, b = np.argwhere(table != table.T)[0]
            raise ValueError(f"meets: [{a}, {b}] is {table[a, b]} but [{b}, {a}] is {table[b, a]}")
        object.__setattr__(self, "ids", frozen_indices("ids", ids, (None,), len(table)))
        object.__setattr__(self, "meets", table)

    def check(self, name: str, rows: NDArray[np.int32]) -> None:
        """Raise a ``ValueError`` for a row with a vertex outside ``ids`` or with several groups."""
        if rows.size and int(rows.max()) >= len(self.ids):
            row = int(np.argmax((rows >= len(self.ids)).any(axis=1)))
            raise ValueError(
                f"{name}: row {row} is {rows[row].tolist()}, but groups has {len(self.ids)} ids"
            )
        of_row = self.ids[rows]
        mixed = (of_row != of_row[:, :1]).any(axis=1)
        if mixed.any():
            row = int(np.argmax(mixed))
            raise ValueError(f"{name}: row {row} has vertices of groups {of_row[row].tolist()}")


def _table(meets: ArrayLike) -> NDArray[np.bool_]:
    try:
        array = np.asarray(meets)
    except ValueError as error:
        raise ValueError(f"meets: rows of different lengths, expected (G, G) ({error})") from None
    if array.ndim != 2 or array.shape[0] != array.shape[1]:
        raise ValueError(f"meets: shape {array.shape}, expected (G, G)")
    if array.dtype.kind not in "biuf" or not ((array == 0) | (array == 1)).all():
        raise ValueError(f"meets: dtype {array.dtype}, expected bools, or only 0 and 1")
    return np.ascontiguousarray(array, dtype=bool)
