"""Inertial numbers that a body can have, in coordinates without constraints.

A body of positive density has ten given inertial numbers if and only if the pseudo-inertia, the
4 x 4 matrix of second moments, is positive definite (Wensing, Kim & Slotine 2018). The entries of
the Cholesky factor of this matrix, with logarithms of the diagonal ones, are ten unconstrained
coordinates (Rucker & Wensing 2022), so that least squares needs no inequality.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array

_LOWER = np.tril_indices(4)

_DIAGONAL = np.flatnonzero(_LOWER[0] == _LOWER[1])


def pseudo_inertia(inertial: Array) -> Array:
    """Second moments of a body about its link's origin, homogeneous.

    Args:
        inertial: mass, first moment (3), Ixx Ixy Iyy Ixz Iyz Izz, shape (10,).

    Returns:
        Blocks: integral of x x^T [kg m^2], integral of x [kg m], mass [kg]; shape (4, 4).
    """
    m, h, (xx, xy, yy, xz, yz, zz) = inertial[0], inertial[1:4], inertial[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    out = np.empty((4, 4))
    out[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    out[:3, 3] = out[3, :3] = h
    out[3, 3] = m
    return out


def inertial_numbers(pseudo: Array) -> Array:
    """The ten numbers of a pseudo-inertia, the inverse of :func:`pseudo_inertia`; it is linear."""
    moments = pseudo[:3, :3]
    inertia = np.trace(moments) * np.eye(3) - moments
    rows, columns = (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)
    return np.concatenate([[pseudo[3, 3]], pseudo[:3, 3], inertia[rows, columns]])


def _linear() -> Array:
    """:func:`inertial_numbers` of symmetric matrices as a tensor, shape (10, 4, 4)."""
    out = np.zeros((10, 4, 4))
    for row in range(4):
        for column in range(4):
            unit = np.zeros((4, 4))
            unit[row, column] += 0.5
            unit[column, row] += 0.5
            out[:, row, column] = inertial_numbers(unit)
    return out


_LINEAR = _linear()
#: The entry of the Cholesky factor that each coordinate determines, shape (10, 4, 4).
_UNIT = np.zeros((10, 4, 4))
_UNIT[np.arange(10), _LOWER[0], _LOWER[1]] = 1.0


#: Largest number of Levenberg-Marquardt steps.
ROUNDS = 60


def coordinates(inertial: Array, floor: float = 1e-4) -> Array:
    """Log-Cholesky coordinates of ten numbers, shape (10,).

    If no body has these numbers, they are changed: eigenvalues of the pseudo-inertia below
    ``floor`` times the scale of their block are set to that value.
    """
    pseudo = pseudo_inertia(inertial)
    mass = max(float(pseudo[3, 3]), 1e-3)
    length = np.sqrt(max(float(np.trace(pseudo[:3, :3])) / mass, 1e-4))
    scale = np.array([length, length, length, 1.0]) * np.sqrt(mass)
    values, vectors = np.linalg.eigh(pseudo / np.outer(scale, scale))
    raised = (vectors * np.maximum(values, floor)) @ vectors.T * np.outer(scale, scale)
    factor: Array = np.linalg.cholesky(raised)[_LOWER]
    factor[_DIAGONAL] = np.log(factor[_DIAGONAL])
    return factor


def from_coordinates(theta: Array) -> tuple[Array, Array]:
    """Inertial numbers of log-Cholesky coordinates, and their derivative.

    Args:
        theta: coordinates of one body or of several, shape (..., 10).

    Returns:
        Ten numbers per body, shape (..., 10), and their derivatives, shape (..., 10, 10). Column k
        is the derivative by coordinate k.
    """
    entries = theta.copy()
    entries[..., _DIAGONAL] = np.exp(entries[..., _DIAGONAL])
    factor = np.zeros((*theta.shape[:-1], 4, 4))
    factor[..., _LOWER[0], _LOWER[1]] = entries
    numbers = np.einsum("irc,...rk,...ck->...i", _LINEAR, factor, factor)
    # d(L L^T) = dL L^T + L dL^T. The numbers depend only on the symmetric part of a matrix, so
    # both terms contribute equally.
    derivative = 2 * np.einsum("krc,...lc->...krl", _UNIT, factor)
    derivative = np.einsum("irl,...krl->...ik", _LINEAR, derivative)
    scale = np.ones_like(entries)
    scale[..., _DIAGONAL] = entries[..., _DIAGONAL]
    return numbers, derivative * scale[..., None, :]


def solve_physically_consistent(
    matrix: Array, vector: Array, inertial: Array, armature: Array
) -> Array:
    """Minimise ``x @ matrix @ x / 2 - vector @ x - sum(log det)`` over bodies that can exist.

    The log det is that of each body's pseudo-inertia; it is linear in the log-Cholesky coordinates.
    It keeps bodies from becoming flat if the data allow other shapes. The unknowns x are errors
    (assumed value minus true value) of all inertial numbers, then of the armatures, then of
    quantities without constraints.

    Args:
        matrix: positive definite, priors included, shape (N, N), N >= 11 n.
        vector: shape (N,).
        inertial: assumed inertial numbers, shape (n, 10).
        armature: assumed armatures [kg m^2], shape (n,).

    Returns:
        x, shape (N,): every ``inertial - x`` is consistent and every ``armature - x`` above 0.
    """
    n = len(inertial)
    body = 11 * n
    # Eliminate the unconstrained unknowns: at the minimum they are linear in all other unknowns.
    own = matrix[body:, body:]
    coupled = matrix[body:, :body]
    follows: NDArray[Any] = np.linalg.solve(own, np.column_stack([coupled, vector[body:]]))
    reduced = matrix[:body, :body] - coupled.T @ follows[:, :body]
    target = vector[:body] - coupled.T @ follows[:, body]
    x = _descend(0.5 * (reduced + reduced.T), target, inertial, armature)
    return np.concatenate([x, follows[:, body] - follows[:, :body] @ x])


def _descend(matrix: Array, vector: Array, inertial: Array, armature: Array) -> Array:
    """Levenberg-Marquardt over log-Cholesky coordinates; returns x of bodies and armatures."""
    n = len(inertial)
    start: NDArray[Any] = np.linalg.solve(matrix, vector)
    wanted = armature - start[10 * n :]
    least = 1e-3 * max(float(np.abs(wanted).max()), 1e-9)
    bodies = [coordinates(body) for body in inertial - start[: 10 * n].reshape(n, 10)]
    state = np.concatenate([*bodies, np.log(np.maximum(wanted, least))])
    inside = np.zeros(len(state))
    inside[(10 * np.arange(n)[:, None] + _DIAGONAL).ravel()] = -2.0
    x, slope = _unknowns(state, inertial, armature)
    cost, damping = 0.5 * x @ matrix @ x - vector @ x + inside @ state, 1e-3
    for _ in range(ROUNDS):
        gradient = slope.T @ (matrix @ x - vector) + inside
        hessian = slope.T @ matrix @ slope
        scaled = hessian + damping * np.diag(np.diag(hessian) + 1e-12)
        trial = state - np.clip(np.linalg.solve(scaled, gradient), -2.0, 2.0)
        x_new, slope_new = _unknowns(trial, inertial, armature)
        cost_new = 0.5 * x_new @ matrix @ x_new - vector @ x_new + inside @ trial
        if cost_new < cost:
            done = cost - cost_new < 1e-7 * max(abs(cost), 1.0)
            state, x, slope, cost, damping = trial, x_new, slope_new, cost_new, damping / 3
            if done:
                break
        else:
            damping *= 4
            if damping > 1e9:
                break
    return x


def _unknowns(state: Array, inertial: Array, armature: Array) -> tuple[Array, Array]:
    """x for given log-Cholesky coordinates, and the derivative of x by them."""
    n = len(inertial)
    x, slope = state.copy(), np.zeros((len(state), len(state)))
    bodies, derivatives = from_coordinates(state[: 10 * n].reshape(n, 10))
    x[: 10 * n] = (inertial - bodies).ravel()
    for link in range(n):
        at = slice(10 * link, 10 * link + 10)
        slope[at, at] = -derivatives[link]
    at = slice(10 * n, None)
    reflected = np.exp(state[at])
    x[at] = armature - reflected
    slope[at, at] = -np.diag(reflected)
    return x, slope
