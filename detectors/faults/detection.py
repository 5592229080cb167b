"""A whole log through the monitor: free, collision or fault at every sample."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tauguard.detectors.detector import check_interval
from tauguard.detectors.evaluation.events import find_alarms
from tauguard.detectors.faults.inputs import FaultCheck
from tauguard.detectors.faults.monitor import FAULT, Answer, Monitor
from tauguard.detectors.faults.spans import Span, Spans
from tauguard.detectors.faults.torques import TorqueCheck
from tauguard.detectors.thresholds.alarm import CollisionAlarm
from tauguard.traces.trace import Detection, Trace


@dataclass(frozen=True)
class Monitored:
    """What a detector and its fault checks say of a log."""

    detection: Detection
    faults: tuple[Span, ...]  #: in order; while one lasts, no alarm is looked for
    fault_seconds: float  #: in which the state is "fault": collisions may be missed there


def detect_with_faults(alarm: CollisionAlarm, trace: Trace) -> Monitored:
    """Alarms and faults of a log, as :class:`Monitor` gives them sample by sample.

    Where no sample is at fault this is ``alarm.detect`` to the bit. A detector that does not know
    what its samples look like names no faults.

    Raises:
        ValueError: another number of joints or another sample rate.
    """
    if alarm.inputs is None:
        return Monitored(alarm.detect(trace), (), 0.0)
    if np.isfinite(trace.dt):
        check_interval("the log", trace, alarm.detector.dt)
    if not np.isfinite(trace.dt) or _broken(alarm, trace):
        return _by_sample(alarm, trace)
    usual = alarm.inputs
    detection = alarm.detect(trace)
    torques = TorqueCheck(alarm.detector.arm, usual.dt, usual.ratios)
    spans, seconds, dt = Spans(), 0.0, trace.dt  # a median: asked once
    for k, t in enumerate(trace.t):
        interval = None if k == 0 else float(t - trace.t[k - 1])
        reason = torques.step(trace.q[k], trace.qd[k], trace.current[k], interval)
        if t - trace.t[0] < alarm.settle:
            continue
        spans.mark(FAULT, bool(reason), float(t), reason)
        seconds += dt * (bool(reason) and not detection.alarm[k])
    return Monitored(detection, tuple(spans.of(FAULT)), seconds)


def _broken(alarm: CollisionAlarm, trace: Trace) -> bool:
    """Whether any sample is at fault, missing, or late enough to be interpolated."""
    assert alarm.inputs is not None
    check, steps = FaultCheck(alarm.inputs), np.diff(trace.t) / alarm.inputs.dt
    if (np.abs(steps - 1) > 0.2).any():
        return True
    rows = zip(trace.t.tolist(), trace.q, trace.qd, trace.current, strict=True)
    return any(check.step(*row) is not None for row in rows)


def _by_sample(alarm: CollisionAlarm, trace: Trace) -> Monitored:
    assert alarm.inputs is not None
    monitor, spans, answers = Monitor(alarm, alarm.inputs), Spans(), []
    for t, q, qd, current in zip(trace.t.tolist(), trace.q, trace.qd, trace.current, strict=True):
        answers.append(monitor.step(t, q, qd, current))
        spans.add(t, answers[-1])
    up = _kept(trace, answers, spans)
    shape = np.zeros_like(trace.q)
    detection = Detection(
        detector=alarm.detector.name,
        t=trace.t,
        residual=shape,
        score=np.array([a.score for a in answers]),
        threshold=alarm.threshold,
        alarm=up,
        alarms=find_alarms(trace.t, up),
    )
    blind = np.array([a.state == FAULT for a in answers])
    seconds = float(np.diff(trace.t, append=trace.t[-1])[blind].sum())
    return Monitored(detection, tuple(replace(s) for s in spans.of(FAULT)), seconds)


def _kept(trace: Trace, answers: list[Answer], spans: Spans) -> np.ndarray:
    """The alarms, less those that were taken back."""
    kept = np.zeros(len(trace.t), dtype=np.bool_)
    for span in spans.of("collision"):
        kept |= (trace.t >= span.start) & (trace.t <= span.end)
    return np.asarray(kept & np.array([a.alarm for a in answers]))
