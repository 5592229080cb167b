"""Basic controllers that use the arm's nominal Pinocchio model."""

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from tauguard.arrays import Array
from tauguard.findings import ArgumentError
from tauguard.models import Friction

__all__ = ["Admittance", "ComputedTorque", "GravityPD", "OperationalSpace", "friction_torque"]

#: Speed over which the Coulomb friction changes its sign [rad/s], as in the native servo.
SMOOTHING = 0.02
#: A direction is nearly singular if its mobility (an eigenvalue of J M^-1 J^T) is below this
#: fraction of the largest one. The tool's force is reduced in such directions only, so that torques
#: stay bounded.
NEARLY_LOST = 1e-4
#: The integral term is limited to the stiffness times this error [m, rad].
INTEGRAL_REACH = 0.05


def per_joint(value: ArrayLike, joints: int, name: str) -> Array:
    """The gains of n joints, shape (n,), from one number or n numbers of 0 or more.

    Raises:
        ArgumentError: another shape, or a gain that is negative or not finite.
    """
    gain = np.asarray(value, dtype=float)
    if gain.shape not in ((), (joints,)):
        raise ArgumentError(f"{name}: shape {gain.shape}; expected a number or ({joints},)")
    if not (np.isfinite(gain) & (gain >= 0)).all():
        raise ArgumentError(f"{name} {value!r}: expected finite gains of 0 or more")
    return np.array(np.broadcast_to(gain, (joints,)))


def friction_torque(friction: Friction | None, qd_des: Array) -> Array:
    """Nominal friction at the wanted speed [N m], shape (n,); zero without a friction model.

    A compensation by the measured speed would chatter at rest. ``scene.facts.nominal.friction`` is
    the nominal friction of a scene's arm.
    """
    if friction is None:
        return np.zeros_like(qd_des)
    level = friction.coulomb * np.tanh(qd_des / SMOOTHING)
    return np.asarray(level + friction.viscous * qd_des)


class GravityPD:
    """tau = g(q) + Kp (q_des - q) + Kd (qd_des - qd): goes to a pose (Takegaki & Arimoto 1981).

    With a ``bandwidth`` w the gains follow each joint's inertia: Kp = w^2 M_ii(q) and
    Kd = 2 w M_ii(q). Every joint of any arm is then critically damped.
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
            model: the arm as the controller assumes it.
            kp: stiffness [N m/rad], a number or (n,).
            kd: damping [N m s/rad], a number or (n,).
            bandwidth: w [rad/s]; replaces ``kp`` and ``kd``.

        Raises:
            ArgumentError: gains of another shape, negative or not finite, or a bandwidth not above
                0.
        """
        if bandwidth is not None and not (np.isfinite(bandwidth) and bandwidth > 0):
            raise ArgumentError(f"bandwidth {bandwidth}: expected rad/s above 0")
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


class ComputedTorque:
    """tau = ID(q, qd, qdd_des + 2 w (qd_des - qd) + w^2 (q_des - q)): follows a path.

    ID is the inverse dynamics (Luh, Walker & Paul 1980). If the model is correct, the error of
    every joint decays with the bandwidth w, critically damped.
    """

    def __init__(self, model: pin.Model, bandwidth: float = 30.0) -> None:
        """For an arm; ``bandwidth`` is w [rad/s].

        Raises:
            ArgumentError: a bandwidth that is not above 0.
        """
        if not (np.isfinite(bandwidth) and bandwidth > 0):
            raise ArgumentError(f"bandwidth {bandwidth}: expected rad/s above 0")
        self.model, self._data = model, model.createData()
        self.bandwidth = bandwidth

    def torque(self, q: Array, qd: Array, q_des: Array, qd_des: Array, qdd_des: Array) -> Array:
        """Torque [N m] along the path's position [rad], velocity and acceleration; shapes (n,)."""
        w = self.bandwidth
        wanted = qdd_des + 2 * w * (qd_des - qd) + w * w * (q_des - q)
        return np.asarray(pin.rnea(self.model, self._data, q, qd, wanted))


class OperationalSpace:
    """tau = J^T L (K e + D (v_des - v) + I sum e) + h + N^T (Kn (q_rest - q) - Dn qd).

    L = (J M^-1 J^T)^-1, and h is the torque of gravity and velocity. The tool's error e decays as
    if every direction had the same unit mass (Khatib 1987). In the null space (N^T), which does not
    move the tool, the arm is held near a rest pose. The integral overcomes static friction.
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
            model: the arm as the controller assumes it.
            frame: name of the tool's frame in ``model``.
            stiffness: K [1/s^2], a number or (6,): three for position, three for orientation.
            damping: D [1/s], a number or (6,).
            rest: rest pose in the null space [rad], (n,); the default is all zero.
            rest_gains: Kn [N m/rad] and Dn [N m s/rad].
            integral: I [1/s^3], a number or (6,); stable below K D; 0: no integral.
            dt: time between two calls of :meth:`torque` [s]; only the integral needs it.

        Raises:
            ArgumentError: an unknown frame (the message lists the known ones), or gains out of
                range.
        """
        names = [f.name for f in model.frames]
        if frame not in names:
            raise ArgumentError(f"frame {frame!r}: no such frame; the model has {', '.join(names)}")
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
        mobility = values / (NEARLY_LOST * values[-1])
        soft = np.where(mobility < 1, np.clip(mobility, 0, 1), 1.0) / np.maximum(values, 1e-300)
        kept = np.where(mobility > 1e-4, 1 / np.maximum(values, 1e-300), 0.0)
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


class Admittance:
    """M qdd + D qd + K (q - q_rest) = tau_ext: computes the reference of a position loop.

    This is the admittance form of Hogan, "Impedance control" (1985). With K = 0 the arm stays where
    it is pushed to. The step is implicit, so it is stable for any gains and any ``dt``.
    """

    def __init__(
        self,
        q: ArrayLike,
        dt: float,
        mass: ArrayLike = 1.0,
        damping: ArrayLike = 20.0,
        stiffness: ArrayLike = 0.0,
        dead_band: ArrayLike = 0.0,
    ) -> None:
        """Start at rest at ``q``.

        Args:
            q: initial position and rest position of the spring [rad], (n,).
            dt: time between two calls of :meth:`step` [s].
            mass: M [kg m^2], a number or (n,), above 0.
            damping: D [N m s/rad], a number or (n,).
            stiffness: K [N m/rad], a number or (n,).
            dead_band: torque up to which ``tau_ext`` counts as zero [N m], a number or (n,), such
                as the largest residual of an observer without contact.

        Raises:
            ArgumentError: gains of another shape or out of range, or a ``dt`` not above 0.
        """
        self.rest = np.array(q, dtype=float)
        n = len(self.rest)
        self.mass = per_joint(mass, n, "mass")
        if not (self.mass > 0).all() or not dt > 0:
            raise ArgumentError(f"mass {mass!r} and dt {dt}: expected above 0")
        self.damping = per_joint(damping, n, "damping")
        self.stiffness = per_joint(stiffness, n, "stiffness")
        self.dead_band = per_joint(dead_band, n, "dead_band")
        self._dt = dt
        self.q, self.qd = self.rest.copy(), np.zeros(n)

    def step(self, tau_ext: Array) -> tuple[Array, Array]:
        """The next reference position [rad] and velocity [rad/s] under ``tau_ext`` [N m], (n,)."""
        push = np.sign(tau_ext) * np.maximum(np.abs(tau_ext) - self.dead_band, 0)
        dt = self._dt
        force = push - self.stiffness * (self.q - self.rest)
        inertia = self.mass + dt * self.damping + dt * dt * self.stiffness
        self.qd = (self.mass * self.qd + dt * force) / inertia
        self.q = self.q + dt * self.qd
        return self.q.copy(), self.qd.copy()
