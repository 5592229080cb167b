"""Columns of a log that label contacts."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array, runs

#: Names, in lower case, of columns that label contact if all their cells are in LABEL.
LABELS = ("label", "contact", "collision", "touch", "in_contact", "in_collision")
LABEL = {"0": False, "false": False, "1": True, "true": True}


def labelled(
    header: Sequence[str],
    rows: Sequence[tuple[int, list[str]]],
    lines: NDArray[np.int64],
    t: Array,
) -> tuple[tuple[float, float], ...] | None:
    """Times of the contacts that a label column of a log states.

    Args:
        header: names of the columns.
        rows: lines of the file, each with its cells.
        lines: line of each sample, shape (T,).
        t: time of each sample [s], shape (T,).

    Returns:
        Times of the first and last sample of each contact; None without a column in LABELS whose
        values are all 0 and 1, or false and true.
    """
    columns = [k for k, name in enumerate(header) if name.lower() in LABELS]
    cells = dict(rows) if columns else {}
    for column in columns:
        marks = [LABEL.get(cells[n][column].strip().lower().removesuffix(".0")) for n in lines]
        if None in marks:
            continue
        return tuple((float(t[a]), float(t[b - 1])) for a, b in runs(np.array(marks)))
    return None
