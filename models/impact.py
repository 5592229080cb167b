"""The effective mass of an arm at an impact: reflected mass, and the standard's estimate."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array
from tauguard.findings import ArgumentError
from tauguard.models.body_regions import BODY_REGIONS
from tauguard.models.derive import largest_energy
from tauguard.models.scene import Scene


def reflected_mass(
    scene: Scene, q: ArrayLike, body: int, point: ArrayLike, direction: ArrayLike
) -> float:
    """Effective mass of the arm at a point of impact [kg]: 1 / (n^T J M^-1 J^T n).

    M includes the rotors' inertia (armature), because an impact is shorter than the response of any
    drive. Source: Khatib, "Inertial properties in robotic manipulation", 1995.

    Args:
        scene: a composed scene.
        q: joint positions [rad], shape (n,).
        body: id of the body that is hit.
        point: point of impact in the world frame [m], shape (3,).
        direction: n, the direction of the impact, of any length, shape (3,).

    Raises:
        ArgumentError: a zero direction, or one in which no joint can move the point.
    """
    mass, column = _along(scene, q, body, point, direction)
    mobility = float(column @ np.linalg.solve(mass, column))
    if not mobility > 0:
        raise ArgumentError(
            f"direction {np.asarray(direction).tolist()}: no joint moves body {body} along it"
        )
    return 1.0 / mobility


def impact_velocity(
    scene: Scene,
    q: ArrayLike,
    body: int,
    point: ArrayLike,
    direction: ArrayLike,
    speed: float,
) -> Array:
    """Joint velocities [rad/s] that move the point at ``speed`` [m/s] along the direction, (n,).

    Of all such velocities these have the least kinetic energy. The arguments are those of
    :func:`reflected_mass`.
    """
    mass, column = _along(scene, q, body, point, direction)
    step = np.linalg.solve(mass, column)
    return np.asarray(step * (speed / (column @ step)))


def standard_mass(scene: Scene, payload: float = 0.0) -> float:
    """The standard's estimate of a robot's effective mass [kg]: M / 2 + m_L.

    M is the mass of the moving parts, m_L the payload with its tool (ISO/TS 15066:2016, annex A).
    """
    bodies = [int(body) for body in scene.link_bodies]
    return float(scene.model.body_mass[bodies].sum()) / 2 + payload


def largest_force(scene: Scene, region: str = "skull") -> float:
    """The largest force that the arm without a load can exert on a body region [N].

    It is sqrt(2 k E), with the region's stiffness k and the largest energy E of motion and drives.
    """
    facts = scene.facts
    limit = facts.drive.torque_limit
    energies = largest_energy(scene.model, facts.joints, facts.max_speed, limit)
    return float((2 * BODY_REGIONS[region].stiffness * sum(energies)) ** 0.5)


def _along(
    scene: Scene, q: ArrayLike, body: int, point: ArrayLike, direction: ArrayLike
) -> tuple[Array, Array]:
    """The arm's mass matrix (n, n) and J^T n (n,)."""
    n = np.asarray(direction, dtype=float)
    length = np.linalg.norm(n)
    if n.shape != (3,) or not length > 0:
        raise ArgumentError(f"direction {n.tolist()}: expected three numbers, not all zero")
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[scene.qpos_adr] = q
    mujoco.mj_forward(model, data)
    mass, jac = np.zeros((model.nv, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_fullM(model, data, mass)
    mujoco.mj_jac(model, data, jac, None, np.asarray(point, dtype=float), body)
    dofs = scene.dof_adr
    return mass[np.ix_(dofs, dofs)], (jac.T @ (n / length))[dofs]
