"""The state of a robot, free, collision or fault, from samples that may be faulty."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from tauguard.arrays import Array, Bools
from tauguard.detectors import _observer
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.estimation.estimator import Estimator
from tauguard.detectors.events import find_alarms
from tauguard.detectors.faults.inputs import (
    FAULTS,
    SPAN,
    FaultCheck,
    TorqueCheck,
    UsualInput,
    input_fault,
    lacks_velocities,
    torque_fault,
)
from tauguard.detectors.samples import check_interval
from tauguard.traces.trace import Detection, Trace

FREE, COLLISION, FAULT = "free", "collision", "fault"

#: States by the native monitor's number.
STATES = (FREE, COLLISION, FAULT)

#: Gaps of at most this many missing or faulty samples, or of at most the time ``SPAN``, are
#: interpolated. After a longer gap the detector is reset.
BRIDGED = 2

#: Time after an interpolated gap until its samples have left the detector's window [s]. No alarm
#: starts in this time.
WINDOW = 0.1


class Answer(NamedTuple):
    """The state of the robot at one sample."""

    state: str  #: "free", "collision" or "fault"
    alarm: bool  #: a collision's alarm is on; during a fault: it was on when the fault began
    score: float  #: last score that the detector computed
    reason: str  #: what is wrong with the input; empty without a fault


class Monitor:
    """A detector that reports a fault when its samples cannot be used.

    A faulty sample is not passed to the detector. The state is ``fault`` during faults and then
    until the detector has settled again. A collision whose alarm was on before the fault stays a
    collision. An alarm that starts within 20 ms before the fault is attributed to the fault.

    Torques that are impossible for this arm are a fault, too. A contact can cause the same
    torques. So the detector continues, and if an alarm is on, the state stays ``collision``, with
    the fault as its reason. When the alarm ends, the check of the torques starts again.

    A step is one native call that allocates only the answer, unless the detector's stream is
    written in Python.

    Attributes:
        native: the C++ monitor.
    """

    def __init__(self, alarm: CollisionAlarm, usual: UsualInput) -> None:
        """Set up the state before the first sample."""
        torques = TorqueCheck(alarm.detector.arm, usual.dt, usual.ratios)
        self._usual = usual
        self.native = _observer.Monitor(
            FaultCheck(usual).native,
            alarm.stream().native,
            torques.observer.native,
            torques.native,
            usual.dt,
            alarm.settle,
            SPAN,
            WINDOW,
            float(BRIDGED),
        )

    @property
    def settled(self) -> bool:
        """Whether the detector can raise an alarm yet."""
        return self.native.settled

    def step(self, t: float, q: Array, qd: Array, current: Array) -> Answer:
        """Judge this sample.

        Args:
            t: its time stamp [s].
            q: [rad], float64, shape (n,).
            qd: [rad/s], shape (n,).
            current: [A], shape (n,).

        Raises:
            ValueError: another number of joints.
        """
        state, up, score, number, joint, value, settling = self.native.step(t, q, qd, current)
        reason = self._reason(number, joint, value, settling) if number else ""
        return Answer(STATES[state], up, score, reason)

    def steps(
        self,
        t: Array,
        signals: tuple[Array, Array, Array],
        estimator: Estimator,
        last: Array,
        residuals: Array,
        alarms: Bools,
    ) -> str:
        """Judge a block of T samples in turn, without Python between them.

        Args:
            t: time stamps [s], shape (T,).
            signals: q [rad], qd [rad/s] and current [A], shape (T, n) each.
            estimator: computes the residuals; samples that are not finite are not passed to it.
            last: the estimator's last residual [N m], shape (n,); updated.
            residuals: output [N m], shape (T, n).
            alarms: output, shape (T,).

        Returns:
            The reason of the first fault, or "" if there is none.

        Raises:
            ValueError: wrong shapes.
        """
        number, joint, value, settling = self.native.steps(
            t, *signals, estimator.native, estimator.dt, last, residuals, alarms
        )
        return self._reason(number, joint, value, settling) if number else ""

    def _reason(self, number: int, joint: int, value: float, settling: bool) -> str:
        """The native monitor's reason as text."""
        if number not in FAULTS:
            return torque_fault(self._usual.joint_names, number, joint, value)
        fault = input_fault(self._usual, number, joint, value)
        return f"settling again after {fault}" if settling else fault


#: Two spans of the same state are joined if the time between them is shorter than this [s].
MERGED = 0.2


@dataclass
class Span:
    """A time interval of collision or fault, in the robot's clock."""

    state: str  #: "collision" or "fault"
    start: float  #: [s]
    end: float  #: [s]
    reason: str = ""  #: first reason of a fault
    score: float = 0.0  #: largest score of a collision


@dataclass
class Spans:
    """The collisions and faults until now.

    A collision that began within 20 ms before a fault is attributed to the fault. If the robot's
    clock is reset, current spans end, and a state that continues begins a new span.
    """

    found: list[Span] = field(default_factory=list)
    _open: dict[str, Span] = field(default_factory=dict)
    _last: float = -np.inf  #: the last finite time [s]

    def add(self, t: float, answer: Answer) -> None:
        """Add the answer of the sample at the time ``t`` [s]."""
        if t < self._last - MERGED:
            self._open.clear()
        self._last = t if np.isfinite(t) else self._last
        if answer.state == FAULT:
            self._discard_collision_before(t)
        self.mark(COLLISION, answer.alarm, t, "")
        if answer.alarm and (span := self._open.get(COLLISION)) is not None:
            span.score = max(span.score, answer.score)
        self.mark(FAULT, bool(answer.reason), t, answer.reason)

    def of(self, state: str) -> list[Span]:
        """The spans of one state, in order."""
        return [span for span in self.found if span.state == state]

    def mark(self, state: str, up: bool, t: float, reason: str) -> None:
        """Open, extend or close the span of one state."""
        span = self._open.get(state)
        if up and span is None and not np.isfinite(t):
            return  # the span begins with the next finite time
        if up and span is None:
            last = next((span for span in reversed(self.found) if span.state == state), None)
            if last is not None and abs(t - last.end) < MERGED:
                last.end = max(last.end, t)
            else:
                last = Span(state, t, t, reason)
                self.found.append(last)
            self._open[state] = last
        elif up and span is not None:
            span.end = max(span.end, t) if np.isfinite(t) else span.end
        elif span is not None:
            del self._open[state]

    def _discard_collision_before(self, t: float) -> None:
        """Forget a collision that began just before a fault."""
        span = self._open.get(COLLISION)
        if span is not None and not t - span.start > SPAN:
            self.found.remove(span)
            del self._open[COLLISION]


@dataclass(frozen=True)
class Monitored:
    """Results of a detector and its fault checks on a log."""

    detection: Detection
    faults: tuple[Span, ...]  #: in order of time; no alarm starts during a fault
    fault_seconds: float  #: time in state "fault" [s]; collisions may be missed in it


def detect_with_faults(alarm: CollisionAlarm, trace: Trace) -> Monitored:
    """Alarms and faults of a log, as :class:`Monitor` computes them sample by sample.

    Without faults the alarms equal those of ``alarm.detect`` bit for bit. If ``alarm.inputs`` is
    None, no faults are found.

    Raises:
        ValueError: another number of joints or another sample rate.
    """
    if alarm.inputs is None:
        return Monitored(alarm.detect(trace), (), 0.0)
    usual = alarm.inputs
    if lacks_velocities(trace):
        usual = usual.without_velocities()
        alarm = replace(alarm, inputs=usual)
    if np.isfinite(trace.dt):
        check_interval("the log", trace, alarm.detector.dt)
    if not np.isfinite(trace.dt) or _broken(alarm, trace):
        return _by_sample(alarm, trace)
    detection = alarm.detect(trace)
    torques = TorqueCheck(alarm.detector.arm, usual.dt, usual.ratios)
    spans, seconds, dt = Spans(), 0.0, trace.dt  # trace.dt is a median: computed once
    for k, t in enumerate(trace.t):
        interval = None if k == 0 else float(t - trace.t[k - 1])
        if k and detection.alarm[k - 1] and not detection.alarm[k]:
            torques.reset()
        reason = torques.step(trace.q[k], trace.qd[k], trace.current[k], interval)
        if t - trace.t[0] < alarm.settle:
            continue
        spans.mark(FAULT, bool(reason), float(t), reason)
        seconds += dt * (bool(reason) and not detection.alarm[k])
    return Monitored(detection, tuple(spans.of(FAULT)), seconds)


def _broken(alarm: CollisionAlarm, trace: Trace) -> bool:
    """Whether any sample is faulty, missing, or late enough to be interpolated."""
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
    """Alarms except those that were attributed to a fault afterwards, shape (T,)."""
    kept = np.zeros(len(trace.t), dtype=np.bool_)
    for span in spans.of("collision"):
        kept |= (trace.t >= span.start) & (trace.t <= span.end)
    return np.asarray(kept & np.array([a.alarm for a in answers]))
