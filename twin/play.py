"""Currents that a twin's drives report along a given motion."""

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors import ArmModel, Estimator
from tauguard.detectors.estimation.estimator import Unknowns
from tauguard.models import Drive, Friction
from tauguard.traces import Trace
from tauguard.twin.signals import motion_of

#: Rate of the observer whose residuals are compared [1/s].
OBSERVER = 30.0
_TRACKED = Unknowns.for_detection()


def modelled(arm: ArmModel, friction: Friction | None, gain: Array, trace: Trace) -> Array:
    """Currents for the torques of bodies and friction along a log's motion [A], shape (T, n)."""
    motion = motion_of(arm, trace)
    torque = motion.bodies
    if friction is not None:
        steps = np.diff(trace.t, prepend=trace.t[0])
        torque = torque + friction_torque(friction, motion.qd, motion.load, steps)
    return np.asarray(torque / gain)


def played(arm: ArmModel, drive: Drive, trace: Trace, seed: int = 0) -> Array:
    """Currents of the twin along a log's motion [A], shape (T, n).

    Args:
        arm: bodies of the twin.
        drive: friction, ripple and sensors of the twin.
        trace: the motion; the currents in it are not used.
        seed: seed of the sensors' noise.
    """
    current = modelled(arm, drive.friction, drive.gain, trace)
    if drive.ripple is not None:
        current += drive.ripple.at(trace.q * drive.gear)
    if drive.sensors is None:
        return current
    rng = np.random.default_rng(seed)
    player = drive.sensors.player(trace.dt, rng)
    return drive.sensors.measure(rng, trace.q, trace.qd, current, player)[2]


def residual_of(arm: ArmModel, trace: Trace) -> Array:
    """Residual of a detector's estimator along a log [N m], shape (T, n)."""
    estimator = Estimator(arm, OBSERVER, trace.dt, _TRACKED)
    return estimator.run(trace.t, trace.q, trace.qd, trace.current).unexplained


def friction_torque(friction: Friction, qd: Array, torque: Array, steps: Array) -> Array:
    """Friction along a motion [N m], by the recursion of :class:`tauguard.models.Friction`.

    Args:
        friction: the parameters, at the reference temperature.
        qd: velocities [rad/s], shape (T, n).
        torque: torque of the bodies at the joints [N m], shape (T, n).
        steps: time before each sample [s], shape (T,).
    """
    slip = np.exp(-((qd / friction.stribeck_velocity) ** 2))
    level = friction.coulomb + (friction.static - friction.coulomb) * slip
    if friction.slope is not None and friction.slope_velocity is not None:
        rises = np.tanh(np.abs(qd)[..., None] / friction.slope_velocity)
        level += (friction.slope * rises).sum(axis=-1)
    level = np.maximum(level * (1 + friction.load * np.abs(torque)), 1e-9)
    z = np.zeros(qd.shape[1])
    out = np.empty_like(qd)
    stiffness = friction.bristle_stiffness
    limit = np.sign(qd) * level / np.maximum(stiffness, 1e-9)
    fade = np.exp(-stiffness * np.abs(qd) / level * steps[:, None])
    for k in range(len(qd)):
        z = limit[k] + (z - limit[k]) * fade[k]
        out[k] = stiffness * z
    return out + friction.viscous * qd
