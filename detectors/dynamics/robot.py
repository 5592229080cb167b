"""The numbers of a robot for the native kernels: a tree of joints with one degree of freedom."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.arrays import Array
from tauguard.detectors import _observer
from tauguard.detectors.dynamics.physical_consistency import inertial_numbers, pseudo_inertia
from tauguard.detectors.frozen import Frozen
from tauguard.findings import ArgumentError

#: Inertial numbers per link: mass, mass times centre of mass (3), Ixx Ixy Iyy Ixz Iyz Izz.
INERTIAL = 10


@dataclass(frozen=True, eq=False)
class RobotNumbers(Frozen):
    """A fixed-base tree of revolute and prismatic joints; link i moves with joint i.

    All arrays are read-only. The frame of link i is Pinocchio's joint frame.
    """

    joint_names: tuple[str, ...]
    parent: NDArray[np.int64]  #: joint that carries joint i, -1 for the base, shape (n,)
    prismatic: NDArray[np.bool_]  #: False: revolute, shape (n,)
    rotation: Array  #: rotation from the joint's frame to the parent's at q = 0, shape (n, 3, 3)
    translation: Array  #: joint origin in the parent's frame [m], shape (n, 3)
    axis: Array  #: unit joint axis in the link's frame, shape (n, 3)
    inertial: Array  #: see INERTIAL; inertia about the link's origin [kg m^2], shape (n, 10)
    armature: Array  #: reflected rotor inertia [kg m^2], shape (n,)
    gravity: Array  #: in the base frame [m/s^2], shape (3,)

    def __post_init__(self) -> None:
        """Check shapes and freeze the arrays.

        Raises:
            ArgumentError: a shape that does not fit, a number that is not finite, a parent that
                does not come before its child; the message names the field.
        """
        n = len(self.joint_names)
        shapes = {
            "rotation": (n, 3, 3),
            "translation": (n, 3),
            "axis": (n, 3),
            "inertial": (n, INERTIAL),
            "armature": (n,),
            "gravity": (3,),
        }
        kinds: dict[str, tuple[type, tuple[int, ...]]] = {
            "parent": (np.int64, (n,)),
            "prismatic": (np.bool_, (n,)),
        } | {name: (np.float64, shape) for name, shape in shapes.items()}
        for name, (dtype, shape) in kinds.items():
            value: NDArray[Any] = np.array(getattr(self, name), dtype=dtype, order="C")
            if value.shape != shape:
                raise ArgumentError(
                    f"RobotNumbers.{name}: shape {value.shape}, expected {shape} for {n} joints"
                )
            if not np.isfinite(value).all():
                raise ArgumentError(f"RobotNumbers.{name}: every number must be finite")
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        if ((self.parent < -1) | (self.parent >= np.arange(n))).any():
            raise ArgumentError(
                "RobotNumbers.parent: a joint's parent must come before it (base: -1)"
            )

    @property
    def joints(self) -> int:
        """Number of joints, n."""
        return len(self.joint_names)

    @cached_property
    def chain(self) -> _observer.Chain:
        """The native form of these numbers."""
        return _observer.Chain(
            self.parent,
            self.prismatic.astype(np.int64),
            self.rotation,
            self.translation,
            self.axis,
            self.inertial,
            self.armature,
            self.gravity,
        )

    def __deepcopy__(self, memo: object) -> RobotNumbers:
        """The object itself, because it is immutable."""
        return self

    def with_inertial(self, inertial: Array) -> RobotNumbers:
        """The same robot with other inertial numbers, shape (n, 10)."""
        return replace(self, inertial=inertial)

    @classmethod
    def from_pin(cls, model: Any) -> RobotNumbers:
        """The numbers of a ``pinocchio.Model``.

        Args:
            model: a fixed base, and joints with one degree of freedom each.

        Raises:
            ArgumentError: a joint of another kind; the message names it.
        """
        joints = list(range(1, model.njoints))
        for i in joints:
            if model.joints[i].nv != 1:
                raise ArgumentError(
                    f"joint {model.names[i]}: {model.joints[i].shortname()} has "
                    f"{model.joints[i].nv} degrees of freedom; expected revolute or prismatic"
                )
        motions = [_motion_axis(model.joints[i]) for i in joints]
        return cls(
            joint_names=tuple(str(model.names[i]) for i in joints),
            parent=np.array([model.parents[i] - 1 for i in joints], dtype=np.int64),
            prismatic=np.array([bool(np.any(m[:3] != 0)) for m in motions]),
            rotation=np.array([model.jointPlacements[i].rotation for i in joints]),
            translation=np.array([model.jointPlacements[i].translation for i in joints]),
            axis=np.array([m[:3] if np.any(m[:3] != 0) else m[3:] for m in motions]),
            inertial=np.array([model.inertias[i].toDynamicParameters() for i in joints]),
            armature=np.array([model.armature[model.joints[i].idx_v] for i in joints]),
            gravity=np.array(model.gravity.linear),
        )


def _motion_axis(joint: Any) -> Array:
    """The joint's constant motion subspace (linear, angular), shape (6,)."""
    kind = joint.shortname()
    if "Helical" in kind or "Mimic" in kind:
        raise ArgumentError(f"{kind}: expected a revolute or prismatic joint")
    data = joint.createData()
    joint.calc(data, *_neutral(joint))
    subspace = np.asarray(data.S() if callable(data.S) else data.S, dtype=float)
    return subspace.reshape(6)


def _neutral(joint: Any) -> Sequence[Array]:
    q, v = np.zeros(joint.nq), np.zeros(joint.nv)
    if joint.nq == 2:  # a continuous joint: cosine and sine
        q[0] = 1.0
    return q, v


def rows(name: str, value: ArrayLike, joints: int) -> Array:
    """``value`` as a C-contiguous float64 array of shape (T, joints).

    Raises:
        ArgumentError: another shape, or an entry that is not finite; names the first bad row.
    """
    try:
        array = np.ascontiguousarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"{name}: not an array of numbers ({error})") from None
    if array.ndim != 2 or array.shape[1] != joints:
        raise ArgumentError(f"{name}: shape {array.shape}, expected (samples, {joints})")
    if not np.isfinite(array).all():
        raise ArgumentError(f"{name}: not finite in row {np.argwhere(~np.isfinite(array))[0][0]}")
    return array


def same_rows(joints: int, **arrays: ArrayLike) -> list[Array]:
    """All of ``arrays`` checked by :func:`rows` and of equal length."""
    checked = [rows(name, value, joints) for name, value in arrays.items()]
    if len({len(array) for array in checked}) > 1:
        lengths = ", ".join(f"{k} {len(v)}" for k, v in zip(arrays, checked, strict=True))
        raise ArgumentError(f"numbers of samples differ: {lengths}")
    return checked


def inverse_dynamics(
    robot: RobotNumbers, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, threads: int = 0
) -> Array:
    """Torques ``M(q) qdd + C(q, qd) qd + g(q)`` that a motion needs.

    Args:
        robot: the arm.
        q: positions [rad or m], shape (T, n).
        qd: velocities, shape (T, n).
        qdd: accelerations, shape (T, n).
        threads: 0: all processors; the result does not depend on it.

    Returns:
        Torques [N m], forces [N] for prismatic joints, shape (T, n).
    """
    q, qd, qdd = same_rows(robot.joints, q=q, qd=qd, qdd=qdd)
    tau = np.empty_like(q)
    robot.chain.rnea(q, qd, qdd, tau, threads)
    return tau


def gravity_torque(robot: RobotNumbers, q: ArrayLike, *, threads: int = 0) -> Array:
    """Torques [N m] that hold the arm still at ``q`` [rad], shapes (T, n)."""
    q = rows("q", q, robot.joints)
    still = np.zeros_like(q)
    return inverse_dynamics(robot, q, still, still, threads=threads)


def mass_matrix(robot: RobotNumbers, q: ArrayLike, *, threads: int = 0) -> Array:
    """Joint-space inertia [kg m^2] at ``q`` [rad], shape (T, n) -> (T, n, n)."""
    q = rows("q", q, robot.joints)
    m = np.empty((*q.shape, robot.joints))
    robot.chain.mass_matrix(q, m, threads)
    return m


def momentum_terms(
    robot: RobotNumbers, q: ArrayLike, qd: ArrayLike, *, threads: int = 0
) -> tuple[Array, Array]:
    """``p = M(q) qd`` and ``beta = C(q, qd)^T qd - g(q)``: ``dp/dt = tau + beta + tau_ext``.

    Args:
        robot: the arm.
        q: positions [rad], shape (T, n).
        qd: velocities [rad/s], shape (T, n).
        threads: 0 takes all processors; the result does not depend on it.

    Returns:
        p [N m s] and beta [N m], each of shape (T, n).
    """
    q, qd = same_rows(robot.joints, q=q, qd=qd)
    p, beta = np.empty_like(q), np.empty_like(q)
    robot.chain.momentum(q, qd, p, beta, threads)
    return p, beta


def momentum_regressor(
    robot: RobotNumbers,
    q: ArrayLike,
    qd: ArrayLike,
    *,
    link: int | None = None,
    count: int = INERTIAL,
    threads: int = 0,
) -> tuple[Array, Array]:
    """Derivatives of p and beta by the inertial numbers: ``p = P @ inertial + armature * qd``.

    Args:
        robot: the arm.
        q: positions [rad], shape (T, n).
        qd: velocities [rad/s], shape (T, n).
        link: 0-based; only the numbers of this link (default: of all links).
        count: with ``link``, only its first ``count`` numbers (4: mass and first moment).
        threads: 0 takes all processors; the result does not depend on it.

    Returns:
        P and B, each of shape (T, n, 10 n), or (T, n, count) for one link.
    """
    q, qd = same_rows(robot.joints, q=q, qd=qd)
    if link is not None and not 0 <= link < robot.joints:
        raise ArgumentError(f"link: {link}, expected 0 to {robot.joints - 1}")
    if not 1 <= count <= INERTIAL:
        raise ArgumentError(f"count: {count}, expected 1 to {INERTIAL}")
    columns = INERTIAL * robot.joints if link is None else count
    p, beta = np.empty((*q.shape, columns)), np.empty((*q.shape, columns))
    if link is None:
        robot.chain.regressor(q, qd, p, beta, threads)
    else:
        robot.chain.link_regressor(link, q, qd, p, beta, threads)
    return p, beta


def holding(robot: RobotNumbers, held: Collection[str]) -> RobotNumbers:
    """The robot with the joints ``held`` fixed."""
    kept: list[int] = []
    inertial: list[Array] = []
    parent: list[int] = []
    placed: list[Array] = []
    frames: list[tuple[int, Array]] = []  # of each joint: its carrier among kept joints, pose
    for i, name in enumerate(robot.joint_names):
        above = int(robot.parent[i])
        carrier, pose = frames[above] if above >= 0 else (-1, np.eye(4))
        own = np.eye(4)
        own[:3, :3], own[:3, 3] = robot.rotation[i], robot.translation[i]
        pose = pose @ own
        if name not in held:
            parent.append(carrier)
            placed.append(pose)
            inertial.append(robot.inertial[i].copy())
            frames.append((len(kept), np.eye(4)))
            kept.append(i)
            continue
        frames.append((carrier, pose))
        if carrier >= 0:
            moved = pose @ pseudo_inertia(robot.inertial[i]) @ pose.T
            inertial[carrier] += inertial_numbers(moved)
    poses = np.array(placed)
    return replace(
        robot,
        joint_names=tuple(robot.joint_names[i] for i in kept),
        parent=np.array(parent, dtype=np.int64),
        prismatic=robot.prismatic[kept],
        rotation=np.ascontiguousarray(poses[:, :3, :3]),
        translation=np.ascontiguousarray(poses[:, :3, 3]),
        axis=robot.axis[kept],
        inertial=np.array(inertial),
        armature=robot.armature[kept],
    )
