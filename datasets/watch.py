"""Collisions in a real arm's log: momentum observer, and a threshold a joint from quiet seconds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tauguard.detectors import RobotNumbers, confirmed, find_alarms, observe
from tauguard.detectors.filter import confirmation_samples
from tauguard.traces.trace import Array, Detection, Trace

GAIN = 20.0  # [1/s] of the observer: what 100 Hz and a real arm's friction allow
CONFIRMATION = 0.05  # [s]
FACTOR = 1.5  # threshold over the largest residual of the quiet seconds
SETTLING = 3.0  # time constants of the observer that are not looked at


@dataclass(frozen=True)
class Watch:
    """What was found in a log, and by which thresholds."""

    detection: Detection
    thresholds: Array  #: [N m], one a joint, shape (n,)
    quiet_until: float  #: [s]; alarms are counted from here on
    notes: tuple[str, ...]


def watch(
    trace: Trace,
    robot: RobotNumbers,
    tau: Array,
    quiet: float,
    *,
    gain: float = GAIN,
    confirmation: float = CONFIRMATION,
    factor: float = FACTOR,
) -> Watch:
    """Look for collisions with thresholds that are learned from the log's own beginning.

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

    Raises:
        ValueError: too few quiet seconds, or more than the log has.
    """
    settled = trace.t[0] + SETTLING / gain
    until = trace.t[0] + quiet
    learning = (trace.t >= settled) & (trace.t < until)
    if not quiet < trace.t[-1] - trace.t[0]:
        length = trace.t[-1] - trace.t[0]
        raise ValueError(f"quiet: {quiet} s, but the log is {length:.1f} s long; nothing to watch")
    if learning.sum() < 10:
        raise ValueError(
            f"quiet: {quiet} s leave {learning.sum()} samples after the observer has settled "
            f"({SETTLING / gain:.2f} s); expected at least 10"
        )
    if not (np.isfinite(factor) and factor > 0):
        raise ValueError(f"factor: {factor}, expected above 0")
    residual = observe(robot, trace.t, trace.q, trace.qd, tau, gain)
    thresholds = factor * np.abs(residual[learning]).max(axis=0)
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
    return Watch(detection, thresholds, float(until), (note,))


def loudest_joint(found: Watch, start: float, end: float) -> int:
    """Index of the joint whose residual is highest over its threshold in an alarm."""
    detection = found.detection
    rows = (detection.t >= start) & (detection.t <= end)
    ratio = np.abs(detection.residual[rows]) / found.thresholds
    return int(np.argmax(ratio.max(axis=0)))
