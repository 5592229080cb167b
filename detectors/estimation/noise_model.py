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
    """The standard deviation of joint j's residual in free motion is
    a + b |qd_j| + c T_j + d |M_j| + e C_j + f S_j.

    T_j is the torque of accelerations, as inertia is known only to a few percent. |M_j| is the norm
    of row j of the mass matrix with the payload, which multiplies the noise of velocities. C_j is
    the recent change of the joint's friction, as at starts, stops and reversals. S_j is half the
    change of the joint's torque between two samples at low sample rates, where the torque between
    them is assumed to be their mean. T, M, C and S are the rows of
    :attr:`~tauguard.detectors.Estimate.motion`.
    """

    weights: Array  #: shape (n, 6), not negative [N m per unit]

    @classmethod
    def fit(cls, residual: Array, qd: Array, motion: Array) -> NoiseModel:
        """Non-negative least squares of ``|residual|``, scaled to its standard deviation.

        Args:
            residual: residual of free motion [N m], shape (T, n).
            qd: [rad/s], shape (T, n).
            motion: ``Estimate.motion``, shape (T, 4, n).
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
        """A model whose standard deviation is ``scale`` in any motion [N m], shape (n,)."""
        level = np.asarray(scale, dtype=np.float64)
        return cls(np.column_stack([level, np.zeros((len(level), TERMS - 1))]))

    def at_least(self, scale: ArrayLike) -> NoiseModel:
        """The model with a standard deviation at rest of ``scale`` or more [N m], shape (n,)."""
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
