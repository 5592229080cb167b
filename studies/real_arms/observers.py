"""Public observers of the external torque after their papers.

The momentum p of the arm obeys ``dp/dt = u + d``, ``u = tau + C^T qd - g``; tau is the drive torque
minus friction, as tauguard's calibration gives it, and d the external torque. Every observer has
one bandwidth, ``rate`` [1/s]. The papers give no thresholds.
"""

from collections.abc import Callable

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors import ArmModel
from tauguard.detectors.dynamics.robot import inverse_dynamics, mass_matrix, momentum_terms
from tauguard.detectors.estimation.observer import intervals, low_pass
from tauguard.traces import Trace

SUBSTEPS = 8  #: sub-steps per sample of the sliding mode, whose torque switches
SLOPE = 30.0  #: largest slope of the torque that the sliding mode follows [N m/s]


def momentum(arm: ArmModel, trace: Trace, tau: Array, rate: float) -> Array:
    """First order (De Luca et al., IROS 2006)."""
    rates = np.full(arm.robot.joints, rate)
    p, beta = momentum_terms(arm.robot, trace.q, trace.qd)
    return low_pass(rates, intervals(trace.t, len(tau)), p, beta, tau)


def disturbance(arm: ArmModel, trace: Trace, tau: Array, rate: float) -> Array:
    """Nonlinear disturbance observer (Chen et al. 2000, Mohammadi et al. 2013).

    ``d = z + Y qd``, ``dz/dt = -Y M^-1 (z + Y qd - h + tau)``, Y the bandwidth times the mean M.
    """
    inertia = mass_matrix(arm.robot, trace.q)
    weight = rate * inertia.mean(axis=0)
    gain = weight @ np.linalg.inv(inertia)
    needed = inverse_dynamics(arm.robot, trace.q, trace.qd, np.zeros_like(trace.q))
    driven = np.einsum("tij,tj->ti", gain, needed - tau - trace.qd @ weight.T)
    step = np.diff(trace.t, prepend=trace.t[0])
    inverse = np.linalg.inv(np.eye(len(weight)) + step[:, None, None] * gain)
    out, z = np.zeros_like(tau), -trace.qd[0] @ weight.T
    for k in range(1, len(out)):
        z = inverse[k] @ (z + step[k] * driven[k])
        out[k] = z + weight @ trace.qd[k]
    return out


def sliding_mode(arm: ArmModel, trace: Trace, tau: Array, rate: float | Array) -> Array:
    """Super-twisting momentum observer with linear terms (Garofalo et al., RA-L 2019).

    Several rates, shape (R, 1), are computed at once: the result has the shape (T, R, n).
    """
    p, beta = momentum_terms(arm.robot, trace.q, trace.qd)
    found = np.broadcast_to(p[0], np.broadcast_shapes(np.shape(rate), p[0].shape)).copy()
    out, sigma = np.zeros((len(p), *found.shape)), np.zeros_like(found)
    for k in range(1, len(out)):
        step = (trace.t[k] - trace.t[k - 1]) / SUBSTEPS
        change, drive = (p[k] - p[k - 1]) / SUBSTEPS, tau[k - 1] + beta[k - 1]
        for part in range(1, SUBSTEPS + 1):
            error = found - (p[k - 1] + change * part)
            sign = np.sign(error)
            pull = 2 * np.sqrt(SLOPE * np.abs(error)) * sign + 2 * rate * error
            found = found + step * (drive + sigma - pull)
            sigma = sigma - step * (rate**2 * error + SLOPE * sign)
        out[k] = sigma
    return out


def kalman(arm: ArmModel, trace: Trace, tau: Array, rate: float) -> Array:
    """Kalman filter of momentum and a random walk of d (Wahrburg et al., T-ASE 2018).

    Its steady gains for a joint are those of an alpha-beta filter (Kalata 1984).
    """
    p, beta = momentum_terms(arm.robot, trace.q, trace.qd)
    dt, index = trace.dt, (rate * trace.dt) ** 2  # a median: once, not for every sample
    root = (4 + index - np.sqrt(8 * index + index**2)) / 4
    alpha = 1 - root**2
    slope = 2 * (2 - alpha) - 4 * np.sqrt(1 - alpha)
    out, found, d = np.zeros_like(tau), p[0].copy(), np.zeros(p.shape[1])
    for k in range(1, len(out)):
        step = trace.t[k] - trace.t[k - 1]
        found = found + step * (tau[k - 1] + beta[k - 1] + d)
        error = p[k] - found
        found, d = found + alpha * error, d + slope / dt * error
        out[k] = d
    return out


#: The public observers: the external torque [N m], shape (T, n), from arm, log, drive torque and
#: bandwidth [1/s].
Observer = Callable[[ArmModel, Trace, Array, float], Array]
OBSERVERS: dict[str, Observer] = {
    "momentum observer": momentum,
    "disturbance observer": disturbance,
    "sliding-mode observer": sliding_mode,
    "Kalman filter": kalman,
}
