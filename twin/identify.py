"""A twin from free logs: the calibrated bodies, and the drives that explain the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from tauguard.arrays import Array
from tauguard.detectors import ArmModel
from tauguard.models import Drive, Friction, Ripple, Sensors
from tauguard.traces import Trace
from tauguard.twin.drive_fit import LINES, DriveFit, columns, fit_joint
from tauguard.twin.play import played, residual_of
from tauguard.twin.signals import SLOW, Motion, motion_of, quantum, white_noise
from tauguard.twin.wander import CYCLES, line_heights

#: Prior of what logs of a moving arm do not show: bristle length [rad].
PRESLIDING = 1.5e-3
#: Prior of the gear ratio, which the lines of ripple count in.
GEAR = 101.0
#: Of the phases of lines that stand for what is left.
SEED = 0


@dataclass(frozen=True, eq=False)
class Twin:
    """An arm as its logs show it."""

    arm: ArmModel  #: calibrated
    drive: Drive  #: what is simulated
    fits: tuple[DriveFit | None, ...]  #: of each joint; None: it did not move enough
    rate: float  #: samples a second
    jitter: float  #: standard deviation of the sample interval [s]
    notes: tuple[str, ...]  #: what the logs do not show, one line each


def identify_twin(arm: ArmModel, traces: Sequence[Trace], current_limit: Array) -> Twin:
    """The drives behind a calibrated arm's free logs.

    Args:
        arm: calibrated from the same logs; its gains hold.
        traces: free logs.
        current_limit: [A], shape (n,).

    Raises:
        ValueError: no joint moves for long enough.
    """
    n = arm.robot.joints
    motions = [motion_of(arm, trace) for trace in traces]
    torques = [trace.current * arm.drive_gain for trace in traces]
    with threadpool_limits(1, "blas"):  # small products: threads cost more than they save
        fits = tuple(fit_joint(j, motions, torques, GEAR) for j in range(n))
    known = [j for j in range(n) if fits[j] is not None]
    if not known:
        raise ValueError("no joint moves for two stretches of half a second: give longer logs")
    notes = tuple(
        f"{arm.robot.joint_names[j]}: hardly moves; its friction is a prior, like the other joints'"
        for j in range(n)
        if fits[j] is None
    )
    heights = [_heights(j, fits[j], motions, torques, arm) for j in range(n)]
    drive = Drive(
        gain=arm.drive_gain,
        gear=np.full(n, GEAR),
        current_limit=current_limit,
        electrical_time_constant=None,
        friction=_friction(fits, arm.drive_gain),
        ripple=_ripple(fits, heights, arm.drive_gain),
        sensors=_sensors(fits, traces, arm.drive_gain),
    )
    drive = _levelled(arm, drive, traces)
    steps = np.concatenate([np.diff(trace.t) for trace in traces])
    rate, jitter = 1 / float(np.median(steps)), float(np.std(steps))
    return Twin(arm, drive, fits, rate, jitter, notes)


def _levelled(arm: ArmModel, drive: Drive, traces: Sequence[Trace]) -> Drive:
    """Random lines as high as the detector's residual asks, as far as more is needed at all."""
    ripple = drive.ripple
    assert ripple is not None
    lines = len(CYCLES)
    bare = replace(ripple, amplitude=ripple.amplitude.copy())
    bare.amplitude[:, -lines:] = 0.0
    real, none, full = (
        _power(arm, [with_current(arm, d, trace) for trace in traces])
        for d in (None, replace(drive, ripple=bare), drive)
    )
    share = np.clip((real - none) / np.maximum(full - none, 1e-12), 0.0, 1.0)
    bare.amplitude[:, -lines:] = ripple.amplitude[:, -lines:] * np.sqrt(share)[:, None]
    return replace(drive, ripple=bare)


def with_current(arm: ArmModel, drive: Drive | None, trace: Trace) -> Trace:
    """A log with the currents of a drive; as it is for None."""
    return trace if drive is None else replace(trace, current=played(arm, drive, trace))


def _power(arm: ArmModel, traces: Sequence[Trace]) -> Array:
    """Mean square of the residual of each joint while it moves [(N m)^2], shape (n,)."""
    total, count = np.zeros(arm.robot.joints), np.zeros(arm.robot.joints)
    for trace in traces:
        moving = np.abs(trace.qd) > SLOW
        total += (moving * residual_of(arm, trace) ** 2).sum(axis=0)
        count += moving.sum(axis=0)
    return np.asarray(total / np.maximum(count, 1))


def _heights(
    j: int, fit: DriveFit | None, motions: Sequence[Motion], torques: Sequence[Array], arm: ArmModel
) -> Array:
    """Amplitudes of the lines that stand for what the fit leaves [A], shape (lines,)."""
    if fit is None:
        return np.zeros(len(CYCLES))
    angles, rests = [], []
    for motion, torque in zip(motions, torques, strict=True):
        rows = motion.moving[:, j]
        table = columns(
            motion.q[rows, j], motion.qd[rows, j], motion.bodies[rows, j], GEAR,
            fit.stribeck_velocity,
        )  # fmt: skip
        angles.append(motion.q[rows, j])
        rests.append((torque - motion.bodies)[rows, j] - table @ _coefficients(fit))
    return line_heights(np.concatenate(angles), np.concatenate(rests) / arm.drive_gain[j])


def _coefficients(fit: DriveFit) -> Array:
    """In the order of the regression's columns."""
    own = [fit.coulomb[0], fit.static[0], fit.load[0], fit.viscous[0], fit.offset]
    return np.concatenate([own, fit.even.ravel(), fit.odd.ravel(), fit.lines.ravel()])


def _friction(fits: Sequence[DriveFit | None], gain: Array) -> Friction:
    known = [(fit, g) for fit, g in zip(fits, gain, strict=True) if fit is not None]

    def row(name: str) -> Array:
        usual = float(np.median([getattr(fit, name)[0] / abs(g) for fit, g in known]))
        pairs = zip(fits, gain, strict=True)
        return np.array([usual * abs(g) if f is None else getattr(f, name)[0] for f, g in pairs])

    coulomb, loads = (
        np.maximum(row("coulomb"), 1e-6),
        [0.0 if f is None else f.load[0] for f in fits],
    )
    return Friction(
        coulomb=coulomb,
        static=np.maximum(row("static"), 1e-6),
        stribeck_velocity=np.array([0.1 if f is None else f.stribeck_velocity for f in fits]),
        viscous=row("viscous"),
        bristle_stiffness=coulomb / PRESLIDING,
        load=np.array(loads) / coulomb,
    )


def _series(pairs: Array) -> tuple[Array, Array]:
    """Amplitudes and phases of a sine from cosine and sine parts, shape (h, 2)."""
    return np.hypot(pairs[:, 0], pairs[:, 1]), np.arctan2(pairs[:, 0], pairs[:, 1])


def _ripple(fits: Sequence[DriveFit | None], heights: Sequence[Array], gain: Array) -> Ripple:
    """Offset, harmonics of the joint, lines of the motor, and the random lines of what is left."""
    orders = np.arange(1.0, 1 + next(len(f.even) for f in fits if f is not None))
    cycles = np.concatenate([[0.0], orders / GEAR, LINES, CYCLES / GEAR])
    amplitude, phase = np.zeros((len(fits), len(cycles))), np.zeros((len(fits), len(cycles)))
    drawn = np.random.default_rng(SEED).uniform(-np.pi, np.pi, size=(len(fits), len(CYCLES)))
    for j, fit in enumerate(fits):
        phase[j, -len(CYCLES) :], amplitude[j, -len(CYCLES) :] = drawn[j], heights[j]
        if fit is not None:
            pairs = np.concatenate([[[fit.offset, 0.0]], fit.even, fit.lines]) / gain[j]
            amplitude[j, : len(pairs)], phase[j, : len(pairs)] = _series(pairs)
    return Ripple(cycles, amplitude, phase)


def _sensors(fits: Sequence[DriveFit | None], traces: Sequence[Trace], gain: Array) -> Sensors:
    n = len(fits)
    one = max(traces, key=lambda trace: len(trace.t))
    steps = np.array([quantum(one.current[:, j]) for j in range(n)])
    noise = [white_noise(one.current[:, j], steps[j]) for j in range(n)]
    harmonics = next(len(f.odd) for f in fits if f is not None)
    amplitude, phase = np.zeros((n, harmonics)), np.zeros((n, harmonics))
    for j, fit in enumerate(fits):
        if fit is not None:
            amplitude[j], phase[j] = _series(fit.odd / gain[j])
    return Sensors(
        current_noise=np.array(noise),
        current_quantum=steps,
        position_quantum=max(quantum(one.q[:, j]) for j in range(n)),
        velocity_noise=float(np.median([white_noise(one.qd[:, j], 0.0) for j in range(n)])),
        velocity_quantum=max(quantum(one.qd[:, j]) for j in range(n)),
        directional=Ripple(np.arange(1.0, 1 + harmonics), amplitude, phase),
    )
