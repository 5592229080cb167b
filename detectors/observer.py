"""The generalised-momentum observer: an estimate of ``tau_ext`` from positions, speeds, torques."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.detectors import _observer

if TYPE_CHECKING:
    import pinocchio as pin

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RobotNumbers:
    """The numbers of a rigid-body model: plain arrays that a file can hold.

    A tree of one-degree-of-freedom joints, each after its parent.
    """

    parents: tuple[int, ...]  #: index of the joint before, -1 for the world
    prismatic: tuple[bool, ...]  #: else revolute
    placements: Array  #: of each joint in its parent at position 0, shape (n, 4, 4)
    axes: Array  #: unit vectors in the joint's frame, shape (n, 3)
    masses: Array  #: [kg], shape (n,)
    coms: Array  #: in the joint's frame [m], shape (n, 3)
    inertias: Array  #: about the centre of mass [kg m^2], shape (n, 3, 3)
    armature: Array  #: [kg m^2], shape (n,)
    gravity: Array  #: in the world [m/s^2], shape (3,)

    @classmethod
    def from_pin(cls, model: pin.Model) -> RobotNumbers:
        """From a Pinocchio model.

        Raises:
            ValueError: a joint with other than one degree of freedom (named), or one whose
                position is not an angle or a length.
        """
        axes, prismatic = [], []
        for joint, name in zip(list(model.joints)[1:], list(model.names)[1:], strict=True):
            if joint.nv != 1 or joint.nq != 1:
                raise ValueError(f"joint {name!r}: {joint.nq} positions; expected hinge or slide")
            axis, slides = _axis(joint)
            axes.append(axis)
            prismatic.append(slides)
        inertias = list(model.inertias)[1:]
        return cls(
            parents=tuple(int(p) - 1 for p in list(model.parents)[1:]),
            prismatic=tuple(prismatic),
            placements=np.array([p.homogeneous for p in list(model.jointPlacements)[1:]]),
            axes=np.array(axes),
            masses=np.array([i.mass for i in inertias]),
            coms=np.array([i.lever for i in inertias]),
            inertias=np.array([i.inertia for i in inertias]),
            armature=np.array(model.armature),
            gravity=np.array(model.gravity.linear),
        )

    @property
    def joints(self) -> int:
        """How many joints."""
        return len(self.parents)

    def native(self) -> _observer.Robot:
        """The compiled form."""
        return _observer.make_robot(
            list(self.parents),
            list(self.prismatic),
            *(
                np.ascontiguousarray(values, dtype=np.float64)
                for values in (
                    self.placements,
                    self.axes,
                    self.masses,
                    self.coms,
                    self.inertias,
                    self.armature,
                    self.gravity,
                )
            ),
        )


def _axis(joint: pin.JointModel) -> tuple[Array, bool]:
    """Axis and whether it slides, from the joint's motion subspace at position 0."""
    data = joint.createData()
    joint.calc(data, np.zeros(1), np.zeros(1)) if joint.idx_q == 0 else joint.calc(
        data, np.zeros(joint.idx_q + 1), np.zeros(joint.idx_v + 1)
    )
    subspace = np.asarray(data.S).reshape(6)
    slides = bool(np.abs(subspace[:3]).max() > 0.5)
    return subspace[:3] if slides else subspace[3:], slides


def _rows(name: str, value: ArrayLike, joints: int) -> Array:
    array = np.ascontiguousarray(value, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != joints:
        raise ValueError(f"{name}: shape {array.shape}, expected (T, {joints}) for this robot")
    if not np.isfinite(array).all():
        row = int(np.argwhere(~np.isfinite(array))[0][0])
        raise ValueError(f"{name}: not finite in row {row}")
    return array


def _gains(gain: ArrayLike, joints: int) -> Array:
    gains = np.ascontiguousarray(np.broadcast_to(np.asarray(gain, dtype=np.float64), (joints,)))
    if not (np.isfinite(gains).all() and (gains > 0).all()):
        raise ValueError(f"gain {gains}: expected numbers above 0 [1/s]")
    return gains


def momentum_terms(
    robot: RobotNumbers, q: ArrayLike, qd: ArrayLike, threads: int = 1
) -> tuple[Array, Array]:
    """Generalised momentum and ``beta = C^T qd - g`` at every row.

    Args:
        robot: the nominal model.
        q: [rad], shape (T, n).
        qd: [rad/s], shape (T, n).
        threads: 0 means all processors; the result does not depend on it.

    Returns:
        p [N m s] and beta [N m], each (T, n).
    """
    positions, speeds = _rows("q", q, robot.joints), _rows("qd", qd, robot.joints)
    p, beta = np.empty_like(positions), np.empty_like(positions)
    _observer.momentum(robot.native(), positions, speeds, p, beta, threads)
    return p, beta


def inverse_dynamics(
    robot: RobotNumbers, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, threads: int = 1
) -> Array:
    """Joint torques of a motion without contact and friction, armature included [N m], (T, n)."""
    positions, speeds = _rows("q", q, robot.joints), _rows("qd", qd, robot.joints)
    accelerations = _rows("qdd", qdd, robot.joints)
    tau = np.empty_like(positions)
    _observer.inverse(robot.native(), positions, speeds, accelerations, tau, threads)
    return tau


class MomentumObserver:
    """The observer sample by sample (De Luca & Mattone 2003; exact discretisation).

    The residual follows ``tau_ext`` with the first-order lag 1/gain and is stable at any gain x dt.
    It is 0 at the first sample.
    """

    def __init__(self, robot: RobotNumbers, gain: ArrayLike = 100.0) -> None:
        """For the nominal model ``robot`` with ``gain`` [1/s], a number or one a joint."""
        self._gain = _gains(gain, robot.joints)
        self._native = robot.native()
        self._observer = _observer.Observer(self._native, self._gain)
        self._out = np.zeros(robot.joints)

    def reset(self) -> None:
        """Forget the past."""
        self._observer.reset()

    def step(self, dt: float, q: Array, qd: Array, tau: Array) -> Array:
        """The residual [N m] at this sample, shape (n,); the array is reused by the next call.

        Args:
            dt: time since the previous sample [s].
            q: [rad], shape (n,).
            qd: [rad/s], shape (n,).
            tau: what the drives apply from this sample on, friction taken off [N m], shape (n,).
        """
        self._observer.step(dt, q, qd, tau, self._out)
        return self._out


def observe(
    robot: RobotNumbers,
    t: ArrayLike,
    q: ArrayLike,
    qd: ArrayLike,
    tau: ArrayLike,
    gain: ArrayLike = 100.0,
) -> Array:
    """The residual of a whole recording, the same numbers as :class:`MomentumObserver` gives.

    Args:
        robot: the nominal model.
        t: increasing sample times, jitter allowed [s], shape (T,).
        q: [rad], shape (T, n).
        qd: [rad/s], shape (T, n).
        tau: what the drives apply from each sample on, friction taken off [N m], shape (T, n).
        gain: [1/s], a number or one a joint.

    Returns:
        Estimate of ``tau_ext`` [N m], shape (T, n).

    Raises:
        ValueError: shapes that do not fit the robot, values that are not finite, time not
            increasing, a gain that is not positive.
    """
    positions, speeds = _rows("q", q, robot.joints), _rows("qd", qd, robot.joints)
    torques = _rows("tau", tau, robot.joints)
    times = np.ascontiguousarray(t, dtype=np.float64)
    if times.shape != (len(positions),) or (np.diff(times) <= 0).any():
        raise ValueError(f"t: expected {len(positions)} increasing times")
    out = np.empty_like(positions)
    native = robot.native()
    _observer.Observer(native, _gains(gain, robot.joints)).run(
        times, positions, speeds, torques, out
    )
    return out
