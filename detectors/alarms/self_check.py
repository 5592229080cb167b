"""Test of a trained detector: no alarm while an arm stands, an alarm when it is hit.

A detector whose numbers are all in range can still raise no alarm at all, or one all the time. The
test refuses both. It does not measure the quality of a detector.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tauguard.detectors.alarms.alarm import CollisionAlarm, floor_of
from tauguard.detectors.dynamics.robot import gravity_torque
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace

#: Sample intervals [s] and settling times [s] that a recording of an arm can have.
INTERVALS, LONGEST_SETTLE = (1e-5, 1.0), 600.0
#: Largest number of samples within the settling time, because the check evaluates all of them.
MOST_SAMPLES = 100_000
#: Range of the torque per ampere [N m/A], largest mass of a link [kg] and gravity [m/s^2].
GAINS, HEAVIEST, GRAVITY = (1e-4, 1e4), 1e4, 100.0
#: Impacts, at least one of which has to raise an alarm: torques of all joints [N m], duration, and
#: pause between impacts [s].
IMPACTS, IMPACT, PAUSE = (5.0, 20.0, 80.0, 320.0), 0.3, 0.5


def check_ranges(alarm: CollisionAlarm) -> None:
    """Refuse numbers that no arm and no recording can have.

    Raises:
        ArgumentError: says which.
    """
    detector, arm = alarm.detector, alarm.detector.arm
    if not INTERVALS[0] <= detector.dt <= INTERVALS[1]:
        raise ArgumentError(f"dt {detector.dt:g} s: expected {INTERVALS[0]:g} to {INTERVALS[1]:g}")
    if not 0 <= detector.settle <= LONGEST_SETTLE:
        raise ArgumentError(f"settle {detector.settle:g} s: expected 0 to {LONGEST_SETTLE:g}")
    if detector.settle / detector.dt > MOST_SAMPLES:
        raise ArgumentError(
            f"settle {detector.settle:g} s of dt {detector.dt:g} s: expected {MOST_SAMPLES:g} "
            "samples at most"
        )
    size = np.abs(arm.drive_gain)
    if not ((size >= GAINS[0]) & (size <= GAINS[1])).all():
        raise ArgumentError(f"drive_gain {arm.drive_gain}: expected {GAINS[0]:g} to {GAINS[1]:g}")
    mass = arm.robot.inertial[:, 0]
    if not ((mass >= -1e-9) & (mass <= HEAVIEST)).all():
        raise ArgumentError(f"masses {mass} kg: expected 0 to {HEAVIEST:g}")
    if np.abs(arm.robot.gravity).max() > GRAVITY:
        raise ArgumentError(f"gravity {arm.robot.gravity} m/s^2: expected {GRAVITY:g} at most")


def check_alarms(alarm: CollisionAlarm) -> None:
    """Refuse a detector that alarms at no impact, or all the time while the arm is at rest.

    A learned score and the thresholds on the residual are checked separately.

    Raises:
        ArgumentError: says which of the two, or that a score is not a number.
    """
    plain = floor_of(alarm)
    if alarm.floor is not None and plain is not None:
        check_alarms(CollisionAlarm(plain, alarm.threshold, alarm.confirmation, alarm.floor))
        alarm = replace(alarm, floor=None)
    trace, first = standing_then_hit(alarm.detector.arm, alarm.detector.dt, alarm.settle)
    up = alarm.detect(trace).alarm
    if not up[first:].any():
        raise ArgumentError(f"it raises no alarm at any impact up to {IMPACTS[-1]:g} N m")
    standing = up[(trace.t > alarm.settle + PAUSE / 2) & (np.arange(len(up)) < first)]
    if len(standing) and standing.all() and up[first:].all():
        raise ArgumentError("it raises an alarm all the time while the arm stands still")


def standing_then_hit(arm: ArmModel, dt: float, settle: float) -> tuple[Trace, int]:
    """A trace of an arm at rest at zero, with currents by its model, then with growing impacts.

    Returns:
        The trace, and the row of the first impact.
    """
    seconds = settle + PAUSE + len(IMPACTS) * (IMPACT + PAUSE)
    # At low sample rates, impacts are longer, because windows and confirmation need some samples.
    slow = max(1.0, dt / 0.01)
    t = np.arange(round(seconds * slow / dt), dtype=np.float64) * dt
    begin, period = settle + PAUSE * slow, (IMPACT + PAUSE) * slow
    number = np.floor((t - begin) / period).astype(int)
    hit = (t >= begin) & ((t - begin) % period < IMPACT * slow) & (number < len(IMPACTS))
    torque = np.where(hit, np.array(IMPACTS)[np.clip(number, 0, len(IMPACTS) - 1)], 0.0)
    n = arm.robot.joints
    rest = np.zeros((len(t), n))
    held = gravity_torque(arm.robot, np.zeros((1, n)))
    current = (held - torque[:, None]) / arm.drive_gain
    return Trace(arm.robot.joint_names, t, rest, rest.copy(), current), int(hit.argmax())
