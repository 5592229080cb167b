"""Support vector regression with the SRQ kernel 1 / (1 + |x - z|^2 / sigma^2)^2.

The dissertation's regressor: the squared rational quadratic kernel with sigma = 3, C = 1 and
epsilon = 0.02. scikit-learn fits it on the precomputed kernel; evaluation is native.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.svm import SVR
from sklearn.utils.validation import check_is_fitted, validate_data

from tauguard.arrays import Array
from tauguard.detectors import _kernel
from tauguard.detectors.methods.kernel_machine import KernelMachine


def srq_kernel(a: ArrayLike, b: ArrayLike, sigma: float = 3.0, *, threads: int = 0) -> Array:
    """K_ij = 1 / (1 + |a_i - b_j|^2 / sigma^2)^2.

    Args:
        a: shape (N, d).
        b: shape (M, d).
        sigma: length scale, above 0.
        threads: 0 takes all processors; the result does not depend on it.

    Returns:
        Shape (N, M).
    """
    left = np.ascontiguousarray(a, dtype=np.float64)
    right = np.ascontiguousarray(b, dtype=np.float64)
    if left.ndim != 2 or right.ndim != 2 or left.shape[1] != right.shape[1]:
        raise ValueError(f"a, b: shapes {left.shape} and {right.shape}, expected (N, d) and (M, d)")
    if not sigma > 0:
        raise ValueError(f"sigma: {sigma}, expected above 0")
    out = np.empty((len(left), len(right)))
    _kernel.gram(left, right, float(sigma), out, threads)
    return out


class SrqSVR(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """Epsilon-SVR with the SRQ kernel, a scikit-learn regressor.

    Attributes:
        svr_: the fitted ``sklearn.svm.SVR(kernel="precomputed")``.
        machine_: the fitted function, without scikit-learn.
    """

    def __init__(self, sigma: float = 3.0, C: float = 1.0, epsilon: float = 0.02) -> None:
        """Keep the settings (sigma: kernel length; C, epsilon: those of the SVR)."""
        self.sigma = sigma
        self.C = C
        self.epsilon = epsilon

    def fit(self, X: ArrayLike, y: ArrayLike) -> SrqSVR:
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
