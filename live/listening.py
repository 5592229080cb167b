"""Run a detector on a running robot: checks of robot and detector, and the result of a session."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tauguard.detectors import find_alarms
from tauguard.detectors.calibration.joints import matched
from tauguard.detectors.detector import Detector
from tauguard.detectors.samples import same_rate
from tauguard.findings import ArgumentError, Findings, MismatchError, cause
from tauguard.live.played import PlayedStream
from tauguard.live.session import Report, Session
from tauguard.live.session import listen as run
from tauguard.live.stream import RobotStream
from tauguard.results import Result, Row, finding_rows
from tauguard.traces.loads import LoadLike
from tauguard.traces.logs import Log
from tauguard.traces.trace import Detection, Trace


@dataclass(frozen=True, eq=False, repr=False)
class Listening(Result):
    """What a detector answered while it listened to a robot."""

    detector: Detector
    session: Session
    connection: tuple[str, ...] = ()  #: events of the connection, one line each
    findings: Findings = field(default_factory=Findings)

    @property
    def seconds(self) -> float:
        """Time from the first to the last sample without a fault, by the robot's clock [s]."""
        length = self.session.last - self.session.first
        return 0.0 if np.isnan(length) else length

    @property
    def lost(self) -> bool:
        """Whether the session ended because the connection broke."""
        return self.session.lost

    def rows(self) -> list[Row]:
        """One row per collision and per fault of samples, by the robot's clock."""
        spans = [*self.session.spans.of("collision"), *self.session.faults()]
        return [
            {
                "state": span.state,
                "start [s]": span.start,
                "end [s]": span.end,
                "score": span.score if span.state == "collision" else None,
                "reason": span.reason,
            }
            for span in sorted(spans, key=lambda span: span.start)
        ]

    def to_dict(self) -> dict[str, Any]:
        """Collisions, faults, connection, latencies and findings, as JSON values."""
        session, collisions = self.session, self.session.spans.of("collision")
        faults = session.faults()
        return {
            "name": "listen",
            "joints": list(session.joint_names),
            "detector": self.detector.method,
            "score_threshold": self.detector.threshold,
            "samples": session.samples,
            "seconds": self.seconds,
            "alarms": len(collisions),
            "events": [{"start": s.start, "end": s.end, "score": s.score} for s in collisions],
            "faults": [{"start": s.start, "end": s.end, "reason": s.reason} for s in faults],
            "state": session.state,
            "connection": list(self.connection),
            "ended": session.ended,
            "latency_us": session.quantiles(),
            "findings": finding_rows(self.findings),
        }

    def trace(self) -> Trace:
        """The samples without a fault; they are kept with ``keep=True`` of :func:`listen`.

        Raises:
            ArgumentError: fewer than two samples were kept.
        """
        if len(self.session.rows) < 2:
            text = "fewer than 2 samples were received; nothing is written"
            raise ArgumentError(cause("samples", text))
        return self.session.trace()

    def detection(self) -> Detection:
        """The score and the alarms at the samples of :meth:`trace`."""
        trace, up = self.trace(), np.array(self.session.alarms)
        return Detection(
            detector=self.detector.method,
            t=trace.t,
            residual=np.zeros_like(trace.q),
            score=np.array(self.session.scores),
            threshold=self.detector.threshold,
            alarm=up,
            alarms=find_alarms(trace.t, up),
        )

    def __repr__(self) -> str:
        """One line: duration, collisions, faults, and the state at the end."""
        session = self.session
        return (
            f"Listening({self.seconds:.1f} s, {len(session.spans.of('collision'))} collisions, "
            f"{len(session.faults())} faults, {session.ended}; state at the end: {session.state})"
        )

    def text(self) -> str:
        """Collisions, faults, events of the connection, latencies and the state at the end."""
        result = self.to_dict()
        lines = [
            f"collision {event['start']:.3f} s to {event['end']:.3f} s: score {event['score']:.2f} "
            f"above {result['score_threshold']:.2f}"
            for event in result["events"]
        ]
        lines += [
            f"fault {fault['start']:.3f} s to {fault['end']:.3f} s: {fault['reason']}"
            for fault in result["faults"]
        ]
        lines += [f"connection: {event}" for event in self.connection]
        latency = {name: _microseconds(value) for name, value in result["latency_us"].items()}
        lines.append(
            f"{result['samples']} samples in {result['seconds']:.1f} s, {result['ended']}; packet "
            f"to answer: median {latency['median']} us, p99 {latency['p99']}, "
            f"p99.9 {latency['p99_9']}, p99.99 {latency['p99_99']}, longest {latency['max']}"
            if latency
            else f"no sample was received: {result['ended']}"
        )
        return "\n".join([*lines, f"state at the end: {result['state']}"])


def _microseconds(value: float | None) -> str:
    """Microseconds as text; None: above the range of the histogram."""
    return "100,000 or more" if value is None else f"{value:,.0f}"


def listen(
    detector: Detector,
    source: RobotStream | Log | Trace,
    *,
    payload: LoadLike = None,
    torque: bool = False,
    seconds: float = np.inf,
    report: Report | None = None,
    keep: bool = False,
) -> Listening:
    """Give every sample of a running robot to a detector; nothing is sent to the robot.

    The states are free, collision, and fault: after 20 ms without a sample (or 2.5 sample
    intervals, if longer), or if samples are wrong. It ends with the source, after ``seconds``, or
    with Ctrl-C.

    Args:
        detector: trained for this arm and sample rate.
        source: a stream of ``tauguard.live``, whose joints come in the detector's order, or one of
            your own; or a log, which is played in real time.
        payload: the load that the arm carries, see :meth:`Detector.detect`.
        torque: the source gives joint torques [N m] instead of currents.
        seconds: duration by this machine's clock.
        report: called after every answer with the sample and the answer, and repeatedly during
            silence with a sample of NaN. It must return at once.
        keep: keep the samples, for :meth:`Listening.trace`.

    Raises:
        MismatchError: other joints, another rate, or currents in place of torques.
        ArgumentError: a load for a detector that cannot be given one.
    """
    if torque and not (detector.arm.drive_gain == 1).all():
        text = f"`torque=True`: {detector.file} was trained on currents"
        raise MismatchError(cause("torques", text))
    detector = detector if payload is None else detector.carrying(payload)
    findings = Findings()
    if isinstance(source, Log):
        findings, source = source.findings, source.trace
    stream = PlayedStream(matched(source, detector.joints)) if isinstance(source, Trace) else source
    check_stream(stream, detector)
    session = run(stream, detector.stream(), seconds, report, keep)
    return Listening(detector, session, tuple(stream.events), findings)


def check_stream(stream: RobotStream, detector: Detector) -> None:
    """Raise ``MismatchError`` if joints or sample rate differ from those of training."""
    joints: Sequence[str] = detector.joints
    if len(stream.joint_names) != len(joints):
        text = f"the source has {len(stream.joint_names)} joints, {detector.file} has {len(joints)}"
        raise MismatchError(cause("joints", text))
    if not same_rate(1 / stream.rate, detector.dt):
        text = (
            f"the source gives {stream.rate:.0f} samples a second, {detector.file} was trained at "
            f"{1 / detector.dt:.0f}: train a detector on logs of that rate"
        )
        raise MismatchError(cause("rate", text))
