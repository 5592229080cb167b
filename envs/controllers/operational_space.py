"""Operational space control: the tool on a spring and a damper, everything else at ease."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from tauguard.envs.controllers.checks import per_joint

Array = NDArray[np.float64]

#: Added to J M^-1 J^T, relative to its largest entry: near a singular pose the tool grows soft
#: along the lost direction instead of the torque growing without bound.
DAMPING = 1e-4


class OperationalSpace:
    """tau = J^T L (K e - D v) + h + N^T (Kn (q_rest - q) - Dn qd), L = (J M^-1 J^T)^-1.

    The tool's error e decays as if every direction had the same unit mass (Khatib 1987); what the
    tool does not need is held near a rest pose in the null space.
    """

    def __init__(
        self,
        model: pin.Model,
        frame: str = "flange",
        stiffness: ArrayLike = 225.0,
        damping: ArrayLike = 30.0,
        rest: ArrayLike | None = None,
        rest_gains: tuple[float, float] = (10.0, 5.0),
    ) -> None:
        """For an arm.

        Args:
            model: what the controller believes about the arm.
            frame: name of the tool's frame in ``model``.
            stiffness: K [1/s^2], a number or (6,): three for position, three for orientation.
            damping: D [1/s], a number or (6,).
            rest: pose of the null space [rad], (n,); the default is all zero.
            rest_gains: Kn [N m/rad] and Dn [N m s/rad].

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

    def pose(self, q: Array) -> Array:
        """Pose of the tool in the world, (4, 4)."""
        pin.framesForwardKinematics(self.model, self._data, q)
        return np.asarray(self._data.oMf[self._frame].homogeneous)

    def torque(self, q: Array, qd: Array, pose_des: Array) -> Array:
        """Torque [N m], (n,), that takes the tool to ``pose_des``, (4, 4), in the world."""
        model, data = self.model, self._data
        pin.computeAllTerms(model, data, q, qd)
        pin.updateFramePlacements(model, data)
        here = data.oMf[self._frame]
        jac = pin.getFrameJacobian(model, data, self._frame, pin.LOCAL_WORLD_ALIGNED)
        turn = here.rotation @ pin.log3(here.rotation.T @ pose_des[:3, :3])
        error = np.concatenate([pose_des[:3, 3] - here.translation, turn])
        mass = np.triu(data.M) + np.triu(data.M, 1).T
        inverse = np.linalg.solve(mass, jac.T)
        mobility = jac @ inverse
        mobility += DAMPING * np.abs(mobility).max() * np.eye(6)
        force = np.linalg.solve(mobility, self.stiffness * error - self.damping * (jac @ qd))
        kn, dn = self.rest_gains
        ease = kn * (self.rest - q) - dn * qd
        ease -= jac.T @ np.linalg.solve(mobility, inverse.T @ ease)
        return np.asarray(jac.T @ force + data.nle + ease)
