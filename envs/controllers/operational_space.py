"""Operational space control: the tool on a spring and a damper, everything else at ease."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from tauguard.arrays import Array
from tauguard.envs.controllers.checks import per_joint

#: A direction that is this much less mobile than the most mobile one counts as nearly lost: there
#: the tool grows soft instead of the torque growing without bound. Elsewhere nothing is damped.
NEARLY_LOST = 1e-4
#: The integral stays within what the spring gives at this error [m, rad].
INTEGRAL_REACH = 0.05


class OperationalSpace:
    """tau = J^T L (K e + D (v_des - v) + I sum e) + h + N^T (Kn (q_rest - q) - Dn qd).

    L = (J M^-1 J^T)^-1. The tool's error e decays as if every direction had the same unit mass
    (Khatib 1987); what the tool does not need is held near a rest pose in the null space, which
    does not move the tool. The integral overcomes static friction.
    """

    def __init__(
        self,
        model: pin.Model,
        frame: str = "flange",
        stiffness: ArrayLike = 225.0,
        damping: ArrayLike = 30.0,
        rest: ArrayLike | None = None,
        rest_gains: tuple[float, float] = (10.0, 5.0),
        integral: ArrayLike = 0.0,
        dt: float = 2e-3,
    ) -> None:
        """For an arm.

        Args:
            model: what the controller believes about the arm.
            frame: name of the tool's frame in ``model``.
            stiffness: K [1/s^2], a number or (6,): three for position, three for orientation.
            damping: D [1/s], a number or (6,).
            rest: pose of the null space [rad], (n,); the default is all zero.
            rest_gains: Kn [N m/rad] and Dn [N m s/rad].
            integral: I [1/s^3], a number or (6,), below K D for stability; 0 is none.
            dt: time between two calls of :meth:`torque` [s]; only the integral needs it.

        Raises:
            ValueError: no such frame (the message lists those there are), or gains out of range.
        """
        names = [f.name for f in model.frames]
        if frame not in names:
            raise ValueError(f"frame {frame!r}: the model has {', '.join(names)}")
        self.model, self._data = model, model.createData()
        self._frame = model.getFrameId(frame)
        self.stiffness = per_joint(stiffness, 6, "stiffness")
        self.damping = per_joint(damping, 6, "damping")
        self.rest = np.zeros(model.nq) if rest is None else np.asarray(rest, dtype=float)
        self.rest_gains = rest_gains
        self.integral = per_joint(integral, 6, "integral")
        self._dt, self._sum = dt, np.zeros(6)

    def reset(self) -> None:
        """Forget the integral."""
        self._sum[:] = 0

    def pose(self, q: Array) -> Array:
        """Pose of the tool in the world, (4, 4)."""
        pin.framesForwardKinematics(self.model, self._data, q)
        return np.asarray(self._data.oMf[self._frame].homogeneous)

    def torque(
        self, q: Array, qd: Array, pose_des: Array, twist_des: ArrayLike | None = None
    ) -> Array:
        """Torque [N m], (n,), that takes the tool to a pose.

        Args:
            q: joint positions [rad], (n,).
            qd: joint velocities [rad/s], (n,).
            pose_des: wanted pose in the world, (4, 4).
            twist_des: wanted velocity [m/s] and angular velocity [rad/s] in the world, (6,);
                default 0.
        """
        model, data = self.model, self._data
        pin.computeAllTerms(model, data, q, qd)
        pin.updateFramePlacements(model, data)
        here = data.oMf[self._frame]
        jac = pin.getFrameJacobian(model, data, self._frame, pin.LOCAL_WORLD_ALIGNED)
        turn = here.rotation @ pin.log3(here.rotation.T @ pose_des[:3, :3])
        error = np.concatenate([pose_des[:3, 3] - here.translation, turn])
        mass = np.triu(data.M) + np.triu(data.M, 1).T
        inverse = np.linalg.solve(mass, jac.T)
        values, axes = np.linalg.eigh(jac @ inverse)
        share = values / (NEARLY_LOST * values[-1])
        soft = np.where(share < 1, np.clip(share, 0, 1), 1.0) / np.maximum(values, 1e-300)
        kept = np.where(share > 1e-4, 1 / np.maximum(values, 1e-300), 0.0)
        twist = -(jac @ qd) if twist_des is None else np.asarray(twist_des) - jac @ qd
        wanted = self.stiffness * error + self.damping * twist + self._integrated(error)
        force = axes @ (soft * (axes.T @ wanted))
        kn, dn = self.rest_gains
        ease = kn * (self.rest - q) - dn * qd
        ease -= jac.T @ (axes @ (kept * (axes.T @ (inverse.T @ ease))))
        return np.asarray(jac.T @ force + data.nle + ease)

    def _integrated(self, error: Array) -> Array:
        most = INTEGRAL_REACH * self.stiffness
        self._sum = np.clip(self._sum + self._dt * self.integral * error, -most, most)
        return self._sum
