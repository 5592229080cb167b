"""Support vector regression with the squared rational quadratic (SRQ) kernel."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.svm import SVR
from sklearn.utils.validation import check_is_fitted, validate_data

from tauguard.arrays import Array
from tauguard.detectors import _kernel
from tauguard.detectors.frozen import Frozen
from tauguard.findings import ArgumentError


@dataclass(frozen=True, eq=False)
class KernelMachine(Frozen):
    """``intercept + sum_i weight_i / (1 + |x - vector_i|^2 / sigma^2)^2``."""

    vectors: Array  #: shape (S, d)
    weights: Array  #: shape (S,)
    intercept: float
    sigma: float

    def __post_init__(self) -> None:
        """Check the shapes and sigma: ``ArgumentError`` names what does not fit."""
        if self.vectors.ndim != 2 or self.weights.shape != self.vectors.shape[:1]:
            raise ArgumentError(
                f"vectors {self.vectors.shape}, weights {self.weights.shape}: differ"
            )
        if not (np.isfinite(self.sigma) and self.sigma > 0):
            raise ArgumentError(f"sigma: {self.sigma}, expected above 0")

    @cached_property
    def native(self) -> _kernel.KernelSum:
        """The native form."""
        vectors, weights = map(np.ascontiguousarray, (self.vectors, self.weights))
        return _kernel.KernelSum(vectors, weights, self.intercept, self.sigma)

    def __call__(self, x: Array) -> Array:
        """Values at the rows of x, shape (N, d) -> (N,)."""
        out = np.empty(len(x))
        self.native.rows(x, out, 0)
        return out

    def reduced(self, count: int) -> KernelMachine:
        """An approximation of the function with at most ``count`` vectors.

        See :func:`reduced_set`.

        Raises:
            ArgumentError: a count outside 1 to the number of vectors.
        """
        vectors, weights = reduced_set(self.vectors, self.weights, self.sigma, count)
        return KernelMachine(vectors, weights, self.intercept, self.sigma)


def srq_kernel(a: ArrayLike, b: ArrayLike, sigma: float = 3.0, *, threads: int = 0) -> Array:
    """The squared rational quadratic kernel ``K_ij = 1 / (1 + |a_i - b_j|^2 / sigma^2)^2``.

    Args:
        a: shape (N, d).
        b: shape (M, d).
        sigma: length scale, above 0.
        threads: 0: all processors; the result does not depend on it.

    Returns:
        Shape (N, M).
    """
    left = np.ascontiguousarray(a, dtype=np.float64)
    right = np.ascontiguousarray(b, dtype=np.float64)
    if left.ndim != 2 or right.ndim != 2 or left.shape[1] != right.shape[1]:
        raise ArgumentError(
            f"a, b: shapes {left.shape} and {right.shape}, expected (N, d) and (M, d)"
        )
    if not sigma > 0:
        raise ArgumentError(f"sigma: {sigma}, expected above 0")
    out = np.empty((len(left), len(right)))
    _kernel.gram(left, right, float(sigma), out, threads)
    return out


class SrqRegressor(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """A scikit-learn regressor: epsilon-SVR with the kernel of :func:`srq_kernel`.

    Attributes:
        svr_: the fitted ``sklearn.svm.SVR(kernel="precomputed")``.
        machine_: the fitted function, without scikit-learn.
    """

    def __init__(self, sigma: float = 3.0, C: float = 1.0, epsilon: float = 0.02) -> None:
        """Keep the settings: the kernel's sigma; C and epsilon as in ``sklearn.svm.SVR``."""
        self.sigma = sigma
        self.C = C
        self.epsilon = epsilon

    def fit(self, X: ArrayLike, y: ArrayLike) -> SrqRegressor:
        """Fit on X of shape (N, d) and y of shape (N,)."""
        rows: Array
        rows, y = validate_data(self, X, y, dtype=np.float64, y_numeric=True)
        svr = SVR(kernel="precomputed", C=self.C, epsilon=self.epsilon, cache_size=500)
        svr.fit(srq_kernel(rows, rows, self.sigma), y)
        self.svr_ = svr
        self.machine_ = KernelMachine(
            np.ascontiguousarray(rows[svr.support_]),
            np.ascontiguousarray(svr.dual_coef_[0]),
            float(svr.intercept_[0]),
            float(self.sigma),
        )
        return self

    def predict(self, X: ArrayLike) -> Array:
        """Values at the rows of X, shape (N, d) -> (N,)."""
        check_is_fitted(self)
        rows: Array = validate_data(self, X, dtype=np.float64, reset=False, order="C")
        return self.machine_(rows)


#: Least squared distance, in the kernel's norm, of a picked vector from the span of the vectors
#: picked before it. A nearer vector adds only rounding errors, as every vector has the norm 1.
DEPENDENT = 1e-8


def reduced_set(
    vectors: Array, coefficients: Array, sigma: float, count: int
) -> tuple[Array, Array]:
    """Approximate a weighted sum of kernels by a sum over at most ``count`` of its vectors.

    Args:
        vectors: support vectors, shape (S, d).
        coefficients: coefficients of the vectors, shape (S,).
        sigma: length scale of the SRQ kernel.
        count: largest number of vectors, 1 to S.

    Returns:
        Picked vectors (C, d) and new coefficients (C,), C <= count. In the kernel's norm, no sum
        over the picked vectors is nearer to the given sum. C is less than ``count`` if all other
        vectors depend linearly on the picked ones.

    Raises:
        ArgumentError: a count outside 1 to S.
    """
    total = len(vectors)
    if not 1 <= count <= total:
        raise ArgumentError(f"count: {count}, expected 1 to the {total} support vectors there are")
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
    # The columns are the Cholesky factor of the picked vectors' kernel matrix. A new factorisation
    # could fail if vectors are nearly linearly dependent.
    lower = columns[picked, : len(picked)]
    new = solve_triangular(lower, values[picked], lower=True)
    new = solve_triangular(lower, new, lower=True, trans="T")
    order = np.argsort(picked)
    return np.ascontiguousarray(vectors[np.array(picked)[order]]), new[order]
