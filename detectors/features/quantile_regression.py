"""Linear bounds on what is seen: quantile regression with a prior."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog

from tauguard.arrays import Array

#: More rows than this are thinned out.
ROWS = 2000


def upper_quantile(
    x: Array, y: Array, quantile: float, prior: Array, weight: Array, rows: int = ROWS
) -> Array:
    """Coefficients c >= 0 so that ``x @ c`` is about the quantile of ``y``.

    They minimise the pinball loss and ``weight @ |c - prior|``: what the rows do not show keeps
    the prior. The linear programme is solved in its dual, whose constraints are as few as the
    coefficients.

    Args:
        x: at least 0, shape (R, k).
        y: shape (R,).
        quantile: between 0 and 1.
        prior: shape (k,).
        weight: of the distance from the prior, in rows of x = 1 that say less, shape (k,).
        rows: how many are used; the sum of the loss stays that of all.

    Returns:
        Shape (k,).

    Raises:
        ValueError: the programme has no solution: numbers that are not finite.
    """
    k, stride = x.shape[1], max(1, -(-len(y) // rows))
    x, y = x[::stride], y[::stride]
    # max a (y - x prior) - m prior over a in [-(1 - quantile), quantile] stride and m >= 0 with
    # |x^T a + m| <= pull; c - prior is what its constraints cost.
    columns = np.vstack([x, np.eye(k)]).T
    pull = np.maximum((1 - quantile) * weight, 1e-9)
    each = (-(1 - quantile) * stride, quantile * stride)
    found = linprog(
        np.concatenate([x @ prior - y, prior]),
        A_ub=np.vstack([columns, -columns]),
        b_ub=np.tile(pull, 2),
        bounds=[each] * len(y) + [(0.0, None)] * k,
        method="highs",
    )
    if found.x is None:
        raise ValueError(f"quantile regression: {found.message}")
    cost = found.ineqlin.marginals
    coefficients: Array = np.maximum(prior - (cost[:k] - cost[k:]), 0.0)
    return coefficients
