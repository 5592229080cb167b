"""Alarms and faults in a real arm's log, and findings on why they may be wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tauguard.arrays import Array, Bools, in_a_line
from tauguard.detectors import _observer
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.alarms.monitor import Span, detect_with_faults
from tauguard.detectors.calibration.log_torques import drive_torque, torque_finding
from tauguard.detectors.estimation.observer import LOG_GAIN, observe
from tauguard.detectors.events import find_alarms
from tauguard.detectors.features.motion_regimes import SEEN, SHORTLY, motion_regimes, unseen_text
from tauguard.detectors.scores.free_motion import FittedFreeMotion, Judged
from tauguard.findings import Finding, Findings, RefusedError, cause, note, raise_errors
from tauguard.traces.trace import Alarm, Detection, Trace


@dataclass(frozen=True)
class LogOptions:
    """Options of :func:`detect_in_log`."""

    maximum_alarm_fraction: float = 0.2
    """Fraction of a log in alarm above which it may be the log of another arm."""
    contact_margin: float = 1.0
    """Time before and after an alarm in which a contact may change the torques [s]."""
    before_alarm: float = 0.2  #: changes of residuals are measured from this time before [s]


@dataclass(frozen=True)
class LogAlarms:
    """Alarms and faults of a log."""

    detection: Detection
    noise: Array  #: standard deviation of each joint's residual without contacts [N m], shape (n,)
    begin: float  #: time from which the detector can raise alarms [s]
    findings: Findings
    faults: tuple[Span, ...] = ()  #: faults of the samples; no alarm starts during a fault
    fault_seconds: float = 0.0  #: duration of the faults [s]; collisions may be missed in them
    unwatched_seconds: float = 0.0
    """Time outside of faults in which the detector does not judge all joints [s]."""

    __repr__ = in_a_line

    def joint_of(self, alarm: Alarm) -> int:
        """Index of the joint whose residual changes most in an alarm, relative to its noise."""
        detection = self.detection
        rows = (detection.t >= alarm.start - LogOptions.before_alarm) & (detection.t <= alarm.end)
        change = detection.residual[rows] - detection.residual[rows][0]
        return int(np.argmax((np.abs(change) / self.noise).max(axis=0)))


def detect_in_log(
    alarm: CollisionAlarm,
    trace: Trace,
    load_known: bool = False,
    options: LogOptions = LogOptions(),
) -> LogAlarms:
    """Find collisions in a log.

    Args:
        alarm: trained.
        trace: of the detector's arm.
        load_known: the detector accounts for the carried load, so no note asks for the load.
        options: limits.

    Raises:
        MismatchError: number of joints or sample rate differs from the training's.
        RefusedError: the log ends before the detector has settled, or its motion does not explain
            its torques.
    """
    settled = float(trace.t[0] + alarm.settle)
    if not trace.t[-1] > settled:
        text = (
            f"the log lasts {trace.t[-1] - trace.t[0]:.2f} s: this detector raises alarms only "
            f"after {alarm.settle:g} s"
        )
        raise RefusedError(cause("too-short", text))
    arm, rows = alarm.detector.arm, trace.t >= settled
    tau = drive_torque(arm, trace)
    residual = observe(arm.robot, trace.t, trace.q, trace.qd, tau, LOG_GAIN)
    monitored = detect_with_faults(alarm, trace)
    detection = replace(monitored.detection, residual=residual)
    detection = replace(detection, alarms=find_alarms(trace.t, detection.alarm))
    strange = bool(detection.alarm[rows].mean() > options.maximum_alarm_fraction)
    margin = options.contact_margin
    quiet = rows if strange else rows & ~_within(detection.alarms, trace.t, margin)
    doubt = torque_finding(arm.robot, trace, tau, residual, quiet, touched=strange)
    findings = [] if doubt is None else raise_errors(RefusedError, [doubt])
    if strange:
        load = "check the load (`payload=`)" if load_known else "give the load (`payload=`)"
        text = (
            f"alarms fill much of this log; if the arm was not touched that often, {load}, and "
            "check that model, robot file and log are of one arm"
        )
        findings = [note("many-alarms", text)]
    unwatched = 0.0
    if isinstance(alarm.detector, FittedFreeMotion):
        judged = alarm.detector.judge(trace)
        watched = rows & ~_within(monitored.faults, trace.t)
        unwatched, unjudged = _unwatched(judged, trace.joint_names, watched)
        findings = [*findings, *unjudged, *_prior_knowledge(alarm.detector, trace)]
        findings += _beyond_training(alarm.detector, judged)
    return LogAlarms(
        detection,
        np.asarray(arm.noise),
        settled,
        Findings(findings),
        monitored.faults,
        monitored.fault_seconds,
        unwatched,
    )


def _beyond_training(detector: FittedFreeMotion, judged: Judged) -> list[Finding]:
    """A note on motion that is faster than that of the training logs."""
    seconds, levels = detector.beyond(judged)
    if not levels:
        return []
    robot = detector.arm.robot
    unit = ["N" if linear else "N m" for linear in robot.prismatic]
    names = robot.joint_names
    text = ", ".join(f"{names[j]} {level:.0f} {unit[j]}" for j, level in levels.items())
    return [
        note(
            "beyond-training",
            f"for {seconds:.1f} s joints are faster, or accelerate more, than in the training "
            f"logs: the bounds there reach {text} (90 % quantile), and lower torques may raise "
            "no alarm",
            *(names[j] for j in levels),
        )
    ]


def _unwatched(judged: Judged, names: Sequence[str], rows: Bools) -> tuple[float, list[Finding]]:
    """Time of ``rows`` in which some joint is not judged [s], and notes that say why."""
    steps, total, notes = np.diff(judged.t, append=judged.t[-1]), 0.0, list[Finding]()
    for reason, text in (
        (
            _observer.HIDES_BY_MOTION,
            "moves here, but in none of the training logs: no collision is detected in",
        ),
        (
            _observer.HIDES_BY_PLACE,
            "stands elsewhere than in the training logs, which do not show its motion: moving "
            "joints are not watched for",
        ),
    ):
        own = (judged.hides == reason) & rows[:, None]
        if seconds := float(steps[own.any(axis=1)].sum()):
            joints = [names[j] for j in np.flatnonzero(own.any(axis=0)).tolist()]
            said = f"{', '.join(joints)}: {text} {seconds:.1f} s of this log"
            notes.append(note("unjudged", said, *joints))
        total += seconds
    return total, notes


def _within(spans: Sequence[Span | Alarm], t: Array, around: float = 0.0) -> Bools:
    """Samples in spans, or at most ``around`` [s] before or after one, shape (T,)."""
    inside = np.zeros(len(t), dtype=np.bool_)
    for one in spans:
        inside |= (t >= one.start - around) & (t <= one.end + around)
    return inside


def _prior_knowledge(detector: FittedFreeMotion, trace: Trace) -> list[Finding]:
    """A note on motion regimes that are in this log, but not in the training logs."""
    if not detector.unseen:
        return []
    names, here = detector.arm.robot.joint_names, motion_regimes(trace)
    rows = np.zeros(len(trace.t), dtype=np.bool_)
    for regime, joints in detector.unseen:
        rows |= here[regime][:, [names.index(joint) for joint in joints]].any(axis=1)
    seconds = float(rows.sum() * trace.dt)
    if seconds < SHORTLY:
        return []
    lacking = unseen_text(detector.unseen, len(names))
    text = (
        f"the training logs show less than {SEEN:g} s of {lacking}; this log shows {seconds:.1f} s "
        "of it, in which bounds learned on other arms apply"
    )
    return [note("unseen-motion", text)]
