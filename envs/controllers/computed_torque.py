"""Computed torque: the arm's own dynamics cancelled, a linear error left."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from tauguard.arrays import Array


class ComputedTorque:
    """tau = ID(q, qd, qdd_des + 2 w (qd_des - qd) + w^2 (q_des - q)): follows a path.

    ID is the inverse dynamics (Luh, Walker & Paul 1980); the error of every joint decays critically
    damped with w where the model is right.
    """

    def __init__(self, model: pin.Model, bandwidth: float = 30.0) -> None:
        """For an arm; ``bandwidth`` is w [rad/s].

        Raises:
            ValueError: a bandwidth that is not above 0.
        """
        if not (np.isfinite(bandwidth) and bandwidth > 0):
            raise ValueError(f"bandwidth {bandwidth}: expected rad/s above 0")
        self.model, self._data = model, model.createData()
        self.bandwidth = bandwidth

    def torque(self, q: Array, qd: Array, q_des: Array, qd_des: Array, qdd_des: Array) -> Array:
        """Torque [N m] along the path's position [rad], velocity and acceleration; shapes (n,)."""
        w = self.bandwidth
        wanted = qdd_des + 2 * w * (qd_des - qd) + w * w * (q_des - q)
        return np.asarray(pin.rnea(self.model, self._data, q, qd, wanted))
