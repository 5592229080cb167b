"""Public observers of the external torque after their papers, with one rule for thresholds.

The momentum p of the arm obeys ``dp/dt = u + d``, ``u = tau + C^T qd - g``; tau is the drive torque
minus friction, as tauguard's calibration gives it, and d the external torque. Every observer has
the bandwidth :data:`RATE`. The papers give no thresholds: here a joint's is :data:`FACTOR` times
its largest value in the training logs, and an alarm must exceed it for :data:`LASTS`.
"""

from collections.abc import Callable, Sequence

import numpy as np

from tauguard.arrays import Array, Bools
from tauguard.detectors import ArmModel
from tauguard.detectors.calibration.log_torques import drive_torque
from tauguard.detectors.dynamics.robot import inverse_dynamics, mass_matrix, momentum_terms
from tauguard.detectors.estimation.observer import intervals, low_pass
from tauguard.detectors.events import confirmation_samples, confirmed
from tauguard.traces import Trace

RATE = 30.0  #: bandwidth [1/s]
FACTOR = 1.5  #: threshold / largest value in training
LASTS, SETTLE = 0.04, 0.5  #: time to confirm an alarm, and to settle after the start [s]
SUBSTEPS = 8  #: sub-steps per sample of the sliding mode, whose torque switches
SLOPE = 30.0  #: largest slope of the torque that the sliding mode follows [N m/s]


def momentum(arm: ArmModel, trace: Trace, tau: Array) -> Array:
    """First order (De Luca et al., IROS 2006)."""
    rates = np.full(arm.robot.joints, RATE)
    p, beta = momentum_terms(arm.robot, trace.q, trace.qd)
    return low_pass(rates, intervals(trace.t, len(tau)), p, beta, tau)


def disturbance(arm: ArmModel, trace: Trace, tau: Array) -> Array:
    """Nonlinear disturbance observer (Chen et al. 2000, Mohammadi et al. 2013).

    ``d = z + Y qd``, ``dz/dt = -Y M^-1 (z + Y qd - h + tau)``, Y the bandwidth times the mean M.
    """
    inertia = mass_matrix(arm.robot, trace.q)
    weight = RATE * inertia.mean(axis=0)
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


def sliding_mode(arm: ArmModel, trace: Trace, tau: Array) -> Array:
    """Super-twisting momentum observer with linear terms (Garofalo et al., RA-L 2019)."""
    p, beta = momentum_terms(arm.robot, trace.q, trace.qd)
    out, found, sigma = np.zeros_like(tau), p[0].copy(), np.zeros(p.shape[1])
    for k in range(1, len(out)):
        step = (trace.t[k] - trace.t[k - 1]) / SUBSTEPS
        for part in range(1, SUBSTEPS + 1):
            error = found - (p[k - 1] + (p[k] - p[k - 1]) * part / SUBSTEPS)
            sign, size = np.sign(error), np.abs(error)
            pull = 2 * np.sqrt(SLOPE * size) * sign + 2 * RATE * error
            found = found + step * (tau[k - 1] + beta[k - 1] + sigma - pull)
            sigma = sigma - step * (RATE**2 * error + SLOPE * sign)
        out[k] = sigma
    return out


def kalman(arm: ArmModel, trace: Trace, tau: Array) -> Array:
    """Kalman filter of momentum and a random walk of d (Wahrburg et al., T-ASE 2018).

    Its steady gains for a joint are those of an alpha-beta filter (Kalata 1984).
    """
    p, beta = momentum_terms(arm.robot, trace.q, trace.qd)
    dt, index = trace.dt, (RATE * trace.dt) ** 2  # a median: once, not for every sample
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


#: The public observers: the external torque [N m], shape (T, n), from arm, log and drive torque.
PEERS: dict[str, Callable[[ArmModel, Trace, Array], Array]] = {
    "momentum observer": momentum,
    "disturbance observer": disturbance,
    "sliding mode": sliding_mode,
    "Kalman filter": kalman,
}


def alarms(value: Array, limit: Array, trace: Trace) -> Bools:
    """Whether a joint has been above its threshold for the confirmation time, shape (T,)."""
    above = (np.abs(value) > limit).any(axis=1) & (trace.t - trace.t[0] > SETTLE)
    return confirmed(above, confirmation_samples(LASTS, trace.dt))


def with_thresholds(
    arm: ArmModel, training: Sequence[Trace], baseline: bool = False
) -> dict[str, Callable[[ArmModel, Trace], Bools]]:
    """The alarms of each of :data:`PEERS`, with thresholds from the training logs.

    The returned functions take the model of a log's arm, which may include a load, and the log.
    ``baseline`` subtracts each joint's mean from SETTLE to 2 SETTLE, due to an unknown load.
    """
    traces = [trace for trace in training if trace.t[-1] - trace.t[0] > 2 * SETTLE]
    torques = [drive_torque(arm, trace) for trace in traces]

    def judged(name: str) -> Callable[[ArmModel, Trace], Bools]:
        peer = PEERS[name]

        def value(own: ArmModel, log: Trace, tau: Array) -> Array:
            found, time = peer(own, log, tau), log.t - log.t[0]
            first = (time > SETTLE) & (time < 2 * SETTLE)
            return found - found[first].mean(axis=0) if baseline else found

        pairs = zip(traces, torques, strict=True)
        peaks = [np.abs(value(arm, t, tau)[t.t - t.t[0] > SETTLE]).max(axis=0) for t, tau in pairs]
        limit = FACTOR * np.max(peaks, axis=0)
        return lambda own, log: alarms(value(own, log, drive_torque(own, log)), limit, log)

    return {name: judged(name) for name in PEERS}
