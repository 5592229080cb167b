"""The noise model: the standard deviation of the residual in collision-free motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array

#: Weights of a joint.
TERMS = 6


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """What free motion leaves of the residual of joint j: its standard deviation is
    a + b |qd_j| + c T_j + d |M_j| + e C_j + f S_j.

    T_j is the torque that accelerations take (inertia is known to some percent), |M_j| the norm of
    the joint's row of the mass matrix with the payload that it carries (the noise of velocities,
    times inertia), C_j how far the joint's friction has lately changed (it starts, stops or turns),
    and S_j half the change of its torque between two samples of a slow log, which is the largest
    error of the mean that stands for what happens between them: the rows of
    :attr:`~tauguard.detectors.Estimate.motion`.
    """

    weights: Array  #: shape (n, 6), not negative [N m per unit]

    @classmethod
    def fit(cls, residual: Array, qd: Array, motion: Array) -> NoiseModel:
        """Non-negative least squares of ``|residual|``, scaled to its standard deviation.

        Args:
            residual: residual of free motion [N m], shape (T, n).
            qd: [rad/s], shape (T, n).
            motion: motion of the estimate, shape (T, 4, n).
        """
        from scipy.optimize import nnls

        columns = cls._columns(qd, motion)
        weights = np.zeros((residual.shape[1], TERMS))
        for j in range(residual.shape[1]):
            weights[j] = nnls(columns[:, j], np.abs(residual[:, j]))[0]
            weights[j, 0] = max(weights[j, 0], 1e-3 * float(np.abs(residual[:, j]).mean()), 1e-9)
        return cls(weights * np.sqrt(np.pi / 2))

    @classmethod
    def constant(cls, scale: ArrayLike) -> NoiseModel:
        """The same at every speed, shape (n,) [N m]."""
        level = np.asarray(scale, dtype=np.float64)
        return cls(np.column_stack([level, np.zeros((len(level), TERMS - 1))]))

    def at_least(self, scale: ArrayLike) -> NoiseModel:
        """At rest no less than ``scale``, shape (n,) [N m]; what motion adds is as before."""
        weights = self.weights.copy()
        weights[:, 0] = np.maximum(weights[:, 0], scale)
        return NoiseModel(weights)

    @staticmethod
    def _columns(qd: Array, motion: Array) -> Array:
        rows = [np.ones_like(qd), np.abs(qd), *np.moveaxis(motion, -2, 0)]
        return np.stack(rows, axis=-1)

    def scale(self, qd: Array, motion: Array) -> Array:
        """The standard deviation [N m] at every sample, shape (..., n)."""
        value: Array = (self._columns(qd, motion) * self.weights).sum(axis=-1)
        return value
