"""The noise model: the standard deviation of the residual in collision-free motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """What free motion leaves of the residual: per joint a + b |qd_j| + c sum |qd| + d sum |qdd|.

    The sums run over all joints; the acceleration is the estimator's.
    """

    weights: Array  #: shape (n, 4), not negative [N m per unit]

    @classmethod
    def fit(cls, residual: Array, qd: Array, acceleration: Array) -> NoiseModel:
        """Non-negative least squares of ``|residual|``, scaled to its standard deviation.

        Args:
            residual: residual of free motion [N m], shape (T, n).
            qd: [rad/s], shape (T, n).
            acceleration: [rad/s^2], shape (T, n).
        """
        from scipy.optimize import nnls

        columns = cls._columns(qd, acceleration)
        weights = np.zeros((residual.shape[1], 4))
        for j in range(residual.shape[1]):
            weights[j] = nnls(columns[:, j], np.abs(residual[:, j]))[0]
            weights[j, 0] = max(weights[j, 0], 1e-3 * float(np.abs(residual[:, j]).mean()), 1e-9)
        return cls(weights * np.sqrt(np.pi / 2))

    @classmethod
    def constant(cls, scale: ArrayLike) -> NoiseModel:
        """The same at every speed, shape (n,) [N m]."""
        level = np.asarray(scale, dtype=np.float64)
        return cls(np.column_stack([level, np.zeros((len(level), 3))]))

    def at_least(self, scale: ArrayLike) -> NoiseModel:
        """At rest no less than ``scale``, shape (n,) [N m]; what motion adds is as before."""
        weights = self.weights.copy()
        weights[:, 0] = np.maximum(weights[:, 0], scale)
        return NoiseModel(weights)

    @staticmethod
    def _columns(qd: Array, acceleration: Array) -> Array:
        speed, total = np.abs(qd), np.abs(acceleration).sum(axis=-1, keepdims=True)
        return np.stack(
            [
                np.ones_like(qd),
                speed,
                np.broadcast_to(speed.sum(axis=-1, keepdims=True), qd.shape),
                np.broadcast_to(total, qd.shape),
            ],
            axis=-1,
        )

    def scale(self, qd: Array, acceleration: Array) -> Array:
        """The standard deviation [N m] at every sample, shape (..., n)."""
        w = self.weights
        speed = np.abs(qd)
        total = speed.sum(axis=-1, keepdims=True)
        shaken = np.abs(acceleration).sum(axis=-1, keepdims=True)
        value: Array = w[:, 0] + w[:, 1] * speed + w[:, 2] * total + w[:, 3] * shaken
        return value
