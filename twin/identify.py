"""Identify a twin from collision-free logs: bodies, friction, and the remaining errors."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import median_filter
from scipy.special import stdtrit

from tauguard.arrays import Array
from tauguard.detectors import ArmModel
from tauguard.findings import ArgumentError
from tauguard.models import Drive, Friction, LeftOver, Sensors
from tauguard.traces import Trace
from tauguard.twin.drive_fit import SLOPES, FrictionFit, fit_friction
from tauguard.twin.play import friction_torque, modelled
from tauguard.twin.signals import Motion, bridged_stop, motion_of, quantum, without_gaps

#: Candidates and prior of the presliding angle, over which friction reverses its sign [rad].
PRESLIDING, USUAL = (2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2), 1e-3
#: Speeds between which this angle is identified [rad/s]; a controller holds a slower joint.
TURNING = (0.005, 0.1)
#: Prior of the gear ratio.
GEAR = 101.0
#: Least half width of an interval, relative to the largest value of any joint. It covers the error
#: of the form of the friction law.
FORM = 0.02
#: Length of the running median of the model's error, in samples.
MEDIAN = 9
#: The identified numbers that have an interval.
NUMBERS = ("gain", "rotor", "coulomb", "static", "viscous", "load")


@dataclass(frozen=True, eq=False)
class Twin:
    """An arm identified from logs."""

    arm: ArmModel  #: calibrated
    drive: Drive  #: drives for the simulation
    fits: tuple[FrictionFit | None, ...]  #: of each joint; None: it did not move enough
    notes: tuple[str, ...]  #: quantities that the logs do not identify, one line each
    intervals: dict[str, Array] = field(default_factory=dict)
    """Half the width of the 95 % interval of each of :data:`NUMBERS`, shape (n,) each, and of
    ``inertial``, shape (n, 10). NaN: the value is a prior; 0: the value was given."""

    def number(self, name: str) -> Array:
        """One of :data:`NUMBERS`, shape (n,)."""
        if name == "gain":
            return self.drive.gain
        if name == "rotor":
            return np.asarray(self.arm.robot.armature / self.drive.gear**2)
        value: Array = getattr(self.drive.friction, name)
        return value


def fit_twin(arm: ArmModel, traces: Sequence[Trace], current_limit: Array) -> Twin:
    """Identify the drives of a calibrated arm from collision-free logs.

    Args:
        arm: calibrated from the same logs; the gains are kept.
        traces: collision-free logs.
        current_limit: largest motor currents [A], shape (n,).

    Raises:
        ArgumentError: no joint moves for long enough.
    """
    n = arm.robot.joints
    parts = [(k, part) for k, trace in enumerate(traces) for part in without_gaps(trace)]
    motions = [motion_of(arm, part) for _, part in parts]
    torques = [part.current * arm.drive_gain for _, part in parts]
    fits = tuple(fit_friction(j, motions, torques) if motions else None for j in range(n))
    if all(fit is None for fit in fits):
        raise ArgumentError("no joint moves for a second: give longer logs")
    drive = Drive(
        gain=arm.drive_gain,
        gear=np.full(n, GEAR),
        current_limit=current_limit,
        electrical_time_constant=None,
        friction=turned(_friction(fits, arm.drive_gain), motions, torques),
    )
    sensors = replace(_sensors(traces, n), left_over=left_over(arm, drive, parts))
    return Twin(arm, replace(drive, sensors=sensors), fits, _notes(arm, fits, traces))


def with_intervals(twin: Twin, others: Sequence[Twin]) -> Twin:
    """The twin with intervals by the jackknife over parts of the logs.

    Samples are not left out singly, because model errors within a part are not independent.

    Args:
        twin: identified from all logs.
        others: twins, each identified without one part of the logs.
    """
    count = len(others)
    if count < 2:
        return twin
    wide, intervals = float(stdtrit(count - 1, 0.975)), {}
    for name in NUMBERS:
        values = np.array([other.number(name) for other in others])
        deviation = np.sqrt((count - 1) * values.var(axis=0))
        known = np.array([f is not None and name not in f.priors for f in twin.fits])
        known |= name == "gain"
        form = 0.0 if name == "gain" else FORM * np.abs(twin.number(name)).max()
        intervals[name] = np.where(known, np.maximum(wide * deviation, form), np.nan)
    if "inertial" in twin.intervals:
        bodies = np.array([other.arm.robot.inertial for other in others])
        deviation = np.sqrt((count - 1) * bodies.var(axis=0))
        intervals["inertial"] = np.maximum(twin.intervals["inertial"], wide * deviation)
    return replace(twin, intervals=twin.intervals | intervals)


def _notes(
    arm: ArmModel, fits: Sequence[FrictionFit | None], traces: Sequence[Trace]
) -> tuple[str, ...]:
    names = arm.robot.joint_names
    notes = [
        f"{names[j]}: hardly moves; its friction is a prior from the other joints"
        for j, fit in enumerate(fits)
        if fit is None
    ]
    notes += [
        f"{names[j]}: the logs hardly show its {' and '.join(fit.priors)} friction; it is near its "
        "prior (static: friction at low speed; viscous: none)"
        for j, fit in enumerate(fits)
        if fit is not None and fit.priors
    ]
    cuts = sum(len(without_gaps(trace, 0.0)) - 1 for trace in traces)
    if cuts:
        notes.append(f"{cuts} gaps in the logs' samples: the parts between them are used")
    return tuple(notes)


def _friction(fits: Sequence[FrictionFit | None], gain: Array) -> Friction:
    def row(name: str) -> Array:
        values = [np.nan if f is None else getattr(f, name) / abs(g) for f, g in pairs]
        usual = float(np.nanmedian(values))
        return np.array([usual if np.isnan(v) else v for v in values]) * np.abs(gain)

    pairs = list(zip(fits, gain, strict=True))
    static = np.maximum(row("static"), 1e-6)
    coulomb = np.maximum(row("coulomb"), 0.05 * static)
    return Friction(
        coulomb=coulomb,
        static=static,
        stribeck_velocity=np.array([0.1 if f is None else f.stribeck_velocity for f in fits]),
        viscous=row("viscous"),
        bristle_stiffness=np.maximum(coulomb, static) / USUAL,
        load=np.array([0.0 if f is None else f.load for f in fits]),
        slope=np.array([np.zeros(len(SLOPES)) if f is None else f.slope for f in fits]),
        slope_velocity=np.array(SLOPES),
    )


def turned(friction: Friction, motions: Sequence[Motion], torques: Sequence[Array]) -> Friction:
    """Friction with the bristle stiffness that fits best while joints reverse."""
    level = friction.bristle_stiffness * USUAL
    errors = []
    for angle in PRESLIDING:
        one, error = replace(friction, bristle_stiffness=level / angle), np.zeros(len(level))
        for motion, torque in zip(motions, torques, strict=True):
            steps = np.diff(motion.t, prepend=motion.t[0])
            lost = friction_torque(one, motion.qd, motion.load, steps)
            turns = (np.abs(motion.qd) > TURNING[0]) & (np.abs(motion.qd) < TURNING[1])
            error += (turns * (torque - motion.bodies - lost) ** 2).sum(axis=0)
        errors.append(error)
    best = np.array(PRESLIDING)[np.argmin(errors, axis=0)]
    shown = np.array(errors).max(axis=0) > 0
    return replace(friction, bristle_stiffness=level / np.where(shown, best, USUAL))


def left_over(arm: ArmModel, drive: Drive, parts: Sequence[tuple[int, Trace]]) -> LeftOver:
    """Errors of the model along the logs, resampled to constant intervals without smoothing.

    The running median of the error is interpolated, because keeping its impulse (error times
    interval) would turn jitter of the time stamps into an error. The deviation from the median is
    moved to the nearest new time with its impulse, so that jitter causes no impulse that the real
    arm did not have.

    Args:
        arm: calibrated.
        drive: gains and friction of the arm.
        parts: logs without gaps, each with the number of the original log.
    """
    dt = float(np.median(np.concatenate([np.diff(part.t) for _, part in parts])))
    log, qd, errors = [], [], []
    for k, (_, part) in enumerate(parts):
        error = part.current - modelled(arm, drive.friction, drive.gain, part)
        error = bridged_stop(part, error)
        place = np.rint((part.t - part.t[0]) / dt).astype(np.int64)
        first = np.unique(place, return_index=True)[1]
        level = median_filter(error, (MEDIAN, 1))
        impulse = np.cumsum(np.diff(part.t)[:, None] * (error - level)[:-1], axis=0)
        impulse = np.vstack([0 * error[:1], impulse])[first]
        even = np.arange(place[-1] + 1)
        slow = [np.interp(even[:-1] * dt, part.t - part.t[0], column) for column in level.T]
        sums = np.stack([np.interp(even, place[first], column) for column in impulse.T], axis=1)
        rows = first[np.searchsorted(place[first], even[:-1], side="right") - 1]
        log.append(np.full(len(rows), k))
        qd.append(part.qd[rows])
        errors.append(np.stack(slow, axis=1) + np.diff(sums, axis=0) / dt)
    return LeftOver(1 / dt, np.concatenate(log), np.concatenate(qd), np.concatenate(errors))


def _sensors(traces: Sequence[Trace], n: int) -> Sensors:
    """Quantisation and times of the samples; the remaining errors contain the noise."""
    one = max(traces, key=lambda trace: len(trace.t))
    steps = np.concatenate([np.diff(trace.t) for trace in traces])
    usual = float(np.median(steps))
    near = steps[steps < 1.9 * usual]
    return Sensors(
        current_noise=np.zeros(n),
        current_quantum=np.array([quantum(one.current[:, j]) for j in range(n)]),
        position_quantum=max(quantum(one.q[:, j]) for j in range(n)),
        velocity_noise=0.0,
        velocity_quantum=max(quantum(one.qd[:, j]) for j in range(n)),
        rate=1 / usual,
        jitter=float(np.std(near) / np.sqrt(2)),
    )
