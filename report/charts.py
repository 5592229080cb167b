"""What charts of studies share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike


def errorbars(
    axes: Any,
    at: ArrayLike,
    figures: Iterable[Mapping[str, Any]],
    across: bool = False,
    **style: Any,
) -> None:
    """Figures with their intervals: ``value`` or ``median``, ``low`` and ``high`` of each.

    Args:
        axes: of matplotlib.
        at: where each stands on the other axis.
        figures: at least one.
        across: along x instead of y.
        style: of matplotlib's errorbar.
    """
    rows = [(f["value"] if "value" in f else f["median"], f["low"], f["high"]) for f in figures]
    middle, low, high = np.array(rows, dtype=np.float64).reshape(-1, 3).T
    spread = np.stack([middle - low, high - middle])
    if across:
        axes.errorbar(middle, at, xerr=spread, **style)
    else:
        axes.errorbar(at, middle, yerr=spread, **style)
