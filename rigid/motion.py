"""Checked rigid poses and motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.arrays import in_a_line
from tauguard.findings import ArgumentError
from tauguard.geometry import Rebuilt, frozen_finite
from tauguard.rigid import _rigid
from tauguard.rigid.shapes import FROM_QUATERNIONS, ORTHONORMAL_TOLERANCE, not_orthonormal

#: Largest component of the rotation vector of a step [rad]. Computing time and the rounding error
#: of the angle grow with the rotation.
MOST_TURN = 1e4


#: Poses (4, 4) or (N, 4, 4), or none.
PoseLike = ArrayLike | None


def poses(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """``value`` as homogeneous matrices of shape (N, 4, 4); a (4, 4) matrix is a batch of one.

    Raises:
        ArgumentError: another shape, an entry that is not finite, a bottom row other than 0 0 0 1,
            or a rotation further than 1e-6 from a proper orthonormal one; the message names the
            row.
    """
    raw = np.asarray(value)
    if raw.shape[-1:] in ((4,), (7,)) and raw.ndim < 3 and raw.shape != (4, 4):
        raise ArgumentError(
            f"{name}: shape {raw.shape}, expected (N, 4, 4) or (4, 4); {FROM_QUATERNIONS}"
        )
    if raw.shape[-2:] == (3, 3):
        raise ArgumentError(
            f"{name}: shape {raw.shape}, expected (N, 4, 4) or (4, 4); for rotations alone set "
            "pose[:, :3, :3] of np.tile(np.eye(4), (N, 1, 1))"
        )
    batch = frozen_finite(name, raw[None] if raw.ndim == 2 else raw, (None, 4, 4))
    if _rigid.first_bad_pose(batch, ORTHONORMAL_TOLERANCE) == len(batch):
        return batch
    bottom = (batch[:, 3] != (0.0, 0.0, 0.0, 1.0)).any(axis=1)
    if bottom.any():
        row = int(np.argmax(bottom))
        raise ArgumentError(f"{name}: bottom row {batch[row, 3]} in row {row}, expected 0 0 0 1")
    rotation = batch[:, :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs(rotation.transpose(0, 2, 1) @ rotation - np.eye(3)).max(axis=(1, 2), initial=0)
        bad = ~(off <= ORTHONORMAL_TOLERANCE) | (np.linalg.det(rotation) < 0)
    if bad.any():
        row = int(np.argmax(bad))
        if off[row] <= ORTHONORMAL_TOLERANCE:
            raise ArgumentError(
                f"{name}: the rotation in row {row} is a reflection (determinant -1); "
                "reverse one axis"
            )
        raise ArgumentError(
            f"{name}: the rotation in row {row} is not proper orthonormal: "
            f"{not_orthonormal(rotation[row])}"
        )
    return batch


def optional_poses(name: str, value: PoseLike) -> NDArray[np.float64] | None:
    """As :func:`poses`; ``None`` stays ``None``."""
    return None if value is None else poses(name, value)


@dataclass(frozen=True, eq=False)
class Motion(Rebuilt):
    """Constant linear and angular velocity over a step, t in [0, 1].

    A point y of the body moves as ``x(t) = x0 + t linear + exp(t [angular]x) R0 y``, where ``R0``
    and ``x0`` are the pose at t = 0. Both velocities are in the world frame; the body rotates about
    the origin of its pose.

    Args:
        pose_t0: Shape (N, 4, 4), or (4, 4) for a batch of one.
        linear: Displacement of the origin over the step. Shape (N, 3) or (3,), m.
        angular: Rotation vector over the step. Shape (N, 3) or (3,), rad.

    Raises:
        ArgumentError: wrong shapes or lengths, an entry that is not finite, a rotation further than
            1e-6 from orthonormal, or more than 10,000 rad about an axis (named with its row).
    """

    pose_t0: NDArray[np.float64]
    linear: NDArray[np.float64]
    angular: NDArray[np.float64]

    __repr__ = in_a_line

    def __init__(self, pose_t0: ArrayLike, linear: ArrayLike, angular: ArrayLike) -> None:
        """Check and copy the arrays."""
        pose = poses("pose_t0", pose_t0)
        object.__setattr__(self, "pose_t0", pose)
        for name, given in (("linear", linear), ("angular", angular)):
            value = np.asarray(given)
            value = np.broadcast_to(value, (len(pose), 3)) if value.shape == (3,) else value
            object.__setattr__(self, name, frozen_finite(name, value, (len(pose), 3)))
        fast = np.abs(self.angular).max(axis=1, initial=0) > MOST_TURN
        if fast.any():
            row = int(np.argmax(fast))
            raise ArgumentError(
                f"angular: {self.angular[row]} in row {row}, expected at most {MOST_TURN:g} rad; "
                "divide the step"
            )

    def __len__(self) -> int:
        return len(self.pose_t0)

    @property
    def packed(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """The three arrays, for native kernels."""
        return self.pose_t0, self.linear, self.angular

    def at(self, t: ArrayLike) -> NDArray[np.float64]:
        """Poses at time ``t``, a number or an array of shape (N,). Shape (N, 4, 4)."""
        from scipy.spatial.transform import Rotation

        time = np.broadcast_to(np.asarray(t, dtype=np.float64), (len(self),))[:, None]
        out = self.pose_t0.copy()
        turn = Rotation.from_rotvec(time * self.angular).as_matrix()
        out[:, :3, :3] = turn @ self.pose_t0[:, :3, :3]
        out[:, :3, 3] += time * self.linear
        return out


def bounded(name: str, motion: Motion) -> None:
    """Raise an ``ArgumentError`` for coordinates beyond 1e100, whose products would overflow."""
    for value in (motion.pose_t0[:, :3, 3], motion.linear):
        if np.abs(value).max(initial=0.0) > 1e100:
            raise ArgumentError(f"{name}: a coordinate beyond 1e100; scale the scene down")


def common_length(lengths: dict[str, int]) -> int:
    """The common length of several named batches; each has this length or 1.

    Raises:
        ArgumentError: lengths that do not match.
    """
    count = 0 if 0 in lengths.values() else max(lengths.values())
    for name, length in lengths.items():
        if length not in (1, count):
            raise ArgumentError(f"{name}: {length} rows, expected {count} or 1")
    return count
