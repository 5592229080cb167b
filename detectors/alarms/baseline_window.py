"""Collisions in a real arm's log: momentum observer, thresholds from its quiet seconds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tauguard.arrays import Array, Bools
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.alarms.monitor import Span, detect_with_faults
from tauguard.detectors.calibration.checks import check_torques, drive_torque
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.detectors.estimation.observer import LOG_GAIN, observe
from tauguard.detectors.events import SERIES, confirmation_samples, confirmed, find_alarms
from tauguard.detectors.scores.free_motion import FittedFreeMotion
from tauguard.traces.trace import Detection, Trace

CONFIRMATION = 0.05  # [s]

FACTOR = 1.5  # threshold over the largest residual of the quiet seconds

STRANGE = 0.2  # fraction of a log in alarm above which the log is taken for another arm's

BEFORE = 0.2  # [s] before an alarm from which residuals count as changed

AROUND = 1.0  # [s] around an alarm in which a contact may change the torques

SETTLING = 3.0  # time constants of the observer that are left out


@dataclass(frozen=True)
class LogDetection:
    """Alarms and faults of a log, and the thresholds that were used."""

    detection: Detection
    thresholds: Array
    """Residual that counts 1 [N m], inf where not used, shape (n,); of a trained detector, whose
    bounds change with the motion, only what each joint is measured by to name the loudest."""
    quiet_until: float  #: [s]; alarms are counted from here on
    notes: tuple[str, ...]
    faults: tuple[Span, ...] = ()  #: of the samples themselves; no alarm is looked for in them
    fault_seconds: float = 0.0  #: in which collisions may be missed


def detect_after_baseline(
    trace: Trace,
    robot: RobotNumbers,
    tau: Array,
    quiet: float,
    *,
    gain: float = LOG_GAIN,
    confirmation: float = CONFIRMATION,
    factor: float = FACTOR,
    joints: Sequence[int] | None = None,
) -> LogDetection:
    """Find collisions with thresholds that are learned from the beginning of the log.

    The score is the largest ratio of |residual| to its joint's threshold; above 1 for
    ``confirmation`` seconds is an alarm.

    Args:
        trace: the log.
        robot: its numbers, joints in the trace's order.
        tau: torques at the joints less friction [N m], shape (T, n).
        quiet: seconds from the beginning of the log in which the user vouches for no collision.
        gain: rate of the observer [1/s].
        confirmation: [s]; counted in whole samples.
        factor: threshold over the largest |residual| of the quiet seconds.
        joints: whose residuals are used, 1-based (default: all).

    Raises:
        ValueError: joints that the robot does not have; too few quiet seconds, or more than the
            log has; torques that the motion of those seconds does not explain.
    """
    learning = _learning(trace, gain, quiet)
    until = trace.t[0] + quiet
    if not (np.isfinite(factor) and factor > 0):
        raise ValueError(f"factor: {factor}, expected above 0")
    residual = observe(robot, trace.t, trace.q, trace.qd, tau, gain)
    doubts = check_torques(robot, trace, tau, residual, learning, gain)
    thresholds = factor * np.abs(residual[learning]).max(axis=0)
    thresholds[~used(joints, robot.joints)] = np.inf
    score = (np.abs(residual) / thresholds).max(axis=1)
    samples = confirmation_samples(confirmation, trace.dt)
    alarm = confirmed((score > 1) & (trace.t >= until), samples)
    note = (
        f"{1 / trace.dt:.0f} Hz: a confirmation of {1e3 * confirmation:.0f} ms is counted as "
        f"{samples} samples ({1e3 * samples * trace.dt:.0f} ms)"
    )
    detection = Detection(
        detector="threshold",
        t=trace.t,
        residual=residual,
        score=score,
        threshold=1.0,
        alarm=alarm,
        alarms=find_alarms(trace.t, alarm),
    )
    return LogDetection(detection, thresholds, float(until), (note, *doubts))


def _learning(trace: Trace, gain: float, quiet: float) -> Bools:
    """The quiet rows after the observer has settled, shape (T,)."""
    settled = trace.t[0] + SETTLING / gain
    learning: Bools = (trace.t >= settled) & (trace.t < trace.t[0] + quiet)
    if not quiet < trace.t[-1] - trace.t[0]:
        length = trace.t[-1] - trace.t[0]
        raise ValueError(f"quiet: {quiet} s, but the log is {length:.1f} s long; nothing to watch")
    if learning.sum() < 10:
        raise ValueError(
            f"quiet: {quiet} s leave {learning.sum()} samples after the observer has settled "
            f"({SETTLING / gain:.2f} s); expected at least 10"
        )
    return learning


def used(joints: Sequence[int] | None, count: int) -> np.ndarray:
    """Which of ``count`` joints are used, shape (count,).

    Raises:
        ValueError: a joint that there is not.
    """
    chosen = range(1, count + 1) if joints is None else joints
    if not chosen or min(chosen) < 1 or max(chosen) > count:
        raise ValueError(f"joints: {tuple(chosen)}, expected some of 1 to {count}")
    return np.isin(np.arange(1, count + 1), list(chosen))


def detect_with(alarm: CollisionAlarm, trace: Trace) -> LogDetection:
    """Find collisions with a trained detector.

    Raises:
        ValueError: another number of joints or another sample rate than it was trained at, a log
            that ends before the detector has settled, or torques that its motion does not explain.
    """
    settled = float(trace.t[0] + alarm.settle)
    if not trace.t[-1] > settled:
        raise ValueError(
            f"the log lasts {trace.t[-1] - trace.t[0]:.2f} s: this detector watches from "
            f"{alarm.settle:g} s on"
        )
    arm, rows = alarm.detector.arm, trace.t >= settled
    tau = drive_torque(arm, trace)
    residual = observe(arm.robot, trace.t, trace.q, trace.qd, tau, LOG_GAIN)
    monitored = detect_with_faults(alarm, trace)
    detection = replace(monitored.detection, residual=residual)
    detection = replace(detection, alarms=find_alarms(trace.t, detection.alarm, SERIES))
    strange = bool(detection.alarm[rows].mean() > STRANGE)
    judged = rows if strange else rows & ~_near(detection)
    doubts = check_torques(arm.robot, trace, tau, residual, judged, LOG_GAIN, touched=strange)
    notes = [] if strange else list(doubts)
    if strange:
        notes.append(
            "alarms fill much of this log; if it was not touched as often as that, tell what the "
            "arm carried (--payload), and check that model, robot file and log are of one arm"
        )
    if isinstance(alarm.detector, FittedFreeMotion):
        seconds, names = alarm.detector.unwatched(trace)
        if names:
            notes.append(
                f"{', '.join(names)}: moves here, but in none of the training logs: nothing is "
                f"watched in {seconds:.1f} s of this log"
            )
    return LogDetection(
        detection,
        np.asarray(arm.noise),
        settled,
        tuple(notes),
        monitored.faults,
        monitored.fault_seconds,
    )


def _near(detection: Detection) -> Bools:
    """Rows within :data:`AROUND` of an alarm, shape (T,)."""
    near = np.zeros(len(detection.t), dtype=np.bool_)
    for alarm in detection.alarms:
        near |= (detection.t > alarm.start - AROUND) & (detection.t < alarm.end + AROUND)
    return near


def loudest_joint(found: LogDetection, start: float, end: float) -> int:
    """Index of the joint whose residual changes most in an alarm, over its threshold."""
    detection = found.detection
    rows = (detection.t >= start - BEFORE) & (detection.t <= end)
    change = detection.residual[rows] - detection.residual[rows][0]
    return int(np.argmax((np.abs(change) / found.thresholds).max(axis=0)))
