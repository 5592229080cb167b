"""The first peak of a contact in closed form: two masses and a spring, in the worst direction."""

from __future__ import annotations

import numpy as np

from tauguard.arrays import Array


def impact_energy(velocity: Array, mobility: Array, person_mass: float) -> tuple[Array, Array]:
    """Energy that the contact's spring takes up in the worst direction, and that direction.

    The energy along a unit normal n is (n . v)^2 / (2 (n^T W n + 1 / m_H)) for a point of mobility
    W = J M^-1 J^T (Khatib 1995) and a person's effective mass m_H. It is largest along
    (W + I / m_H)^-1 v, and is v^T (W + I / m_H)^-1 v / 2 there.

    Args:
        velocity: of the points [m/s], shape (..., 3).
        mobility: of the points [1/kg], shape (..., 3, 3).
        person_mass: m_H [kg]; infinite: the person is clamped.

    Returns:
        The energy [J], shape (...), and the unit normals towards the person, shape (..., 3).
    """
    scale = np.trace(mobility, axis1=-2, axis2=-1)[..., None, None] / 3
    # A point that cannot move along a direction has no velocity along it: the limit is the
    # pseudo-inverse, which a small share of the mean mobility gives to 1e-9.
    share = 1e-9 * np.where(scale > 0, scale, 1.0) + 1 / person_mass
    pull = np.linalg.solve(mobility + share * np.eye(3), velocity[..., None])[..., 0]
    energy = np.einsum("...i,...i->...", velocity, pull) / 2
    length = np.linalg.norm(pull, axis=-1, keepdims=True)
    return energy, np.divide(pull, length, out=np.zeros_like(pull), where=length > 0)


def effective_mass(mobility: Array, normal: Array) -> Array:
    """Reflected mass 1 / (n^T W n) [kg] of points along unit normals, shape (...)."""
    along = np.einsum("...i,...ij,...j->...", normal, mobility, normal)
    mass: Array = np.divide(1.0, along, out=np.full_like(along, np.inf), where=along > 0)
    return mass
