"""Fewer support vectors for the same function: speed against error.

Burges, "Simplified support vector decision rules" (ICML 1996), with the reduced vectors taken from
the given ones: orthogonal least squares in the kernel's Hilbert space picks, one by one, the vector
that takes most of what is left of the function; the coefficients are then those of the orthogonal
projection onto the span of the picked ones.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from tauguard.arrays import Array
from tauguard.detectors.methods.svr_regressor import srq_kernel

#: A vector whose squared distance from the span of the picked ones is below this is not
#: picked: it would add nothing but rounding. Its norm is 1 in the SRQ kernel.
DEPENDENT = 1e-8


def reduced_set(
    vectors: Array, coefficients: Array, sigma: float, count: int
) -> tuple[Array, Array]:
    """``count`` of the vectors, or fewer where they depend on each other, and new coefficients.

    Args:
        vectors: support vectors, shape (S, d).
        coefficients: theirs, shape (S,).
        sigma: length of the SRQ kernel.
        count: how many to keep, 1 to S.

    Returns:
        Vectors (C, d) and coefficients (C,) of the function nearest to the given one in the
        kernel's norm over the picked vectors; C <= count.

    Raises:
        ValueError: a count outside 1 to S.
    """
    total = len(vectors)
    if not 1 <= count <= total:
        raise ValueError(f"count: {count}, expected 1 to the {total} support vectors there are")
    kernel = srq_kernel(vectors, vectors, sigma)
    values = kernel @ coefficients
    left, distance = values.copy(), np.ones(total)
    columns = np.empty((total, count))
    picked: list[int] = []
    for k in range(count):
        gain = np.where(distance > DEPENDENT, left**2 / np.maximum(distance, DEPENDENT), -1.0)
        gain[picked] = -1.0
        best = int(gain.argmax())
        if gain[best] <= 0:
            break
        # The next column of a Cholesky factor of the kernel matrix, pivoted by the gain.
        column = kernel[:, best] - columns[:, :k] @ columns[best, :k]
        column /= np.sqrt(distance[best])
        left -= column * (left[best] / np.sqrt(distance[best]))
        distance -= column**2
        columns[:, k] = column
        picked.append(best)
    # The columns are the factor of the picked vectors' kernel matrix: another one could fail where
    # vectors nearly depend on each other.
    lower = columns[picked, : len(picked)]
    new = solve_triangular(lower, values[picked], lower=True)
    new = solve_triangular(lower, new, lower=True, trans="T")
    order = np.argsort(picked)
    return np.ascontiguousarray(vectors[np.array(picked)[order]]), new[order]
