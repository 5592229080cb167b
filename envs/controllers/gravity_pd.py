"""PD control with gravity compensation."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from tauguard.arrays import Array
from tauguard.envs.controllers.checks import per_joint


class GravityPD:
    """tau = g(q) + Kp (q_des - q) + Kd (qd_des - qd): goes to a pose (Takegaki & Arimoto 1981).

    With a ``bandwidth`` the gains follow each joint's inertia, Kp = w^2 M_ii(q) and Kd = 2 w
    M_ii(q): every joint of every arm is critically damped, where fixed numbers fit one arm.
    """

    def __init__(
        self,
        model: pin.Model,
        kp: ArrayLike = 400.0,
        kd: ArrayLike = 40.0,
        bandwidth: float | None = None,
    ) -> None:
        """For an arm.

        Args:
            model: what the controller believes about the arm.
            kp: stiffness [N m/rad], a number or (n,).
            kd: damping [N m s/rad], a number or (n,).
            bandwidth: w [rad/s]; replaces both.

        Raises:
            ValueError: gains of another shape, negative or not finite, or a bandwidth not above 0.
        """
        if bandwidth is not None and not (np.isfinite(bandwidth) and bandwidth > 0):
            raise ValueError(f"bandwidth {bandwidth}: expected rad/s above 0")
        self.model, self._data, self.bandwidth = model, model.createData(), bandwidth
        self.kp, self.kd = per_joint(kp, model.nv, "kp"), per_joint(kd, model.nv, "kd")

    def torque(self, q: Array, qd: Array, q_des: Array, qd_des: Array | None = None) -> Array:
        """Torque [N m] towards ``q_des`` [rad] at ``qd_des`` [rad/s] (default 0); shapes (n,)."""
        gravity = pin.computeGeneralizedGravity(self.model, self._data, q)
        kp, kd = self.kp, self.kd
        if self.bandwidth is not None:
            inertia = np.diag(pin.crba(self.model, self._data, q))
            kp, kd = self.bandwidth**2 * inertia, 2 * self.bandwidth * inertia
        speed = -qd if qd_des is None else qd_des - qd
        return np.asarray(gravity + kp * (q_des - q) + kd * speed)
