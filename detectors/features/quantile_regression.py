"""Linear bounds on what is seen: quantile regression with a prior."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import csr_matrix, eye_array, hstack, vstack

Array = NDArray[np.float64]

#: More rows than this are thinned out.
ROWS = 1200


def upper_quantile(
    x: Array, y: Array, quantile: float, prior: Array, weight: Array, rows: int = ROWS
) -> Array:
    """Coefficients c >= 0 so that ``x @ c`` is about the quantile of ``y``.

    They minimise the pinball loss and ``weight @ |c - prior|``: what the rows do not show keeps
    the prior.

    Args:
        x: at least 0, shape (R, k).
        y: shape (R,).
        quantile: between 0 and 1.
        prior: shape (k,).
        weight: of the distance from the prior, in rows of x = 1 that say less, shape (k,).
        rows: how many are used; the sum of the loss stays that of all.

    Returns:
        Shape (k,).
    """
    k, stride = x.shape[1], max(1, -(-len(y) // rows))
    x, y = x[::stride], y[::stride]
    m = len(y)
    share = stride * np.concatenate([np.full(m, quantile), np.full(m, 1 - quantile)])
    pull = np.tile((1 - quantile) * weight, 2)
    # Unknowns: c; y - x c above and below; c - prior above and below.
    left = hstack([csr_matrix(x), eye_array(m), -eye_array(m), csr_matrix((m, 2 * k))])
    right = hstack([eye_array(k), csr_matrix((k, 2 * m)), -eye_array(k), eye_array(k)])
    found = linprog(
        np.concatenate([np.zeros(k), share, pull]),
        A_eq=vstack([left, right]).tocsr(),
        b_eq=np.concatenate([y, prior]),
        bounds=(0, None),
        method="highs",
    )
    if found.x is None:
        raise ValueError(f"quantile regression: {found.message}")
    coefficients: Array = found.x[:k]
    return coefficients
