"""Style and helpers that the charts of all studies share."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

#: Colours that colour-blind readers can distinguish: Okabe and Ito's without yellow, two of Tol's.
COLOURS = (
    *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00"),
    *("#56B4E9", "#000000", "#999999", "#882255", "#117733"),
)
#: Matplotlib settings of every chart; text is readable at half of a page's width.
STYLE: dict[str, Any] = {
    "axes.prop_cycle": f"cycler('color', {list(COLOURS)})",
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": "medium",
    "figure.figsize": (9.0, 5.8),
    "font.size": 11.0,
    "grid.alpha": 0.3,
    "legend.fontsize": "small",
    "legend.framealpha": 0.7,
    "savefig.dpi": 125.0,
}


def errorbars(axes: Any, at: ArrayLike, figures: Iterable[Mapping[str, Any]], **style: Any) -> None:
    """Draw values with their intervals: ``value`` or ``median``, ``low`` and ``high`` of each.

    Args:
        axes: matplotlib axes to draw on.
        at: position of each value along x.
        figures: the values with their intervals, at least one.
        style: keywords of matplotlib's ``errorbar``.
    """
    rows = [(f["value"] if "value" in f else f["median"], f["low"], f["high"]) for f in figures]
    middle, low, high = np.array(rows, dtype=np.float64).reshape(-1, 3).T
    spread = np.stack([middle - low, high - middle])
    axes.errorbar(at, middle, yerr=spread, **style)
