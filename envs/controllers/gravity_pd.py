"""PD control with gravity compensation."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from tauguard.envs.controllers.checks import per_joint

Array = NDArray[np.float64]


class GravityPD:
    """tau = g(q) + Kp (q_des - q) - Kd qd: goes to a pose and stays (Takegaki & Arimoto 1981)."""

    def __init__(self, model: pin.Model, kp: ArrayLike = 400.0, kd: ArrayLike = 40.0) -> None:
        """For an arm.

        Args:
            model: what the controller believes about the arm.
            kp: stiffness [N m/rad], a number or (n,).
            kd: damping [N m s/rad], a number or (n,).

        Raises:
            ValueError: gains of another shape, negative or not finite.
        """
        self.model, self._data = model, model.createData()
        self.kp, self.kd = per_joint(kp, model.nv, "kp"), per_joint(kd, model.nv, "kd")

    def torque(self, q: Array, qd: Array, q_des: Array) -> Array:
        """Torque [N m] towards ``q_des`` [rad]; all of shape (n,)."""
        gravity = pin.computeGeneralizedGravity(self.model, self._data, q)
        return np.asarray(gravity + self.kp * (q_des - q) - self.kd * qd)
