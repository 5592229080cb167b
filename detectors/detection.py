"""The alarms of a detector in a log, their causes, and what is doubtful."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from tauguard.arrays import Array
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.alarms.log_detection import LogAlarms
from tauguard.detectors.alarms.monitor import Span
from tauguard.detectors.diagnosis.diagnosis import Diagnoser, Diagnosis
from tauguard.detectors.diagnosis.post_alarm import AFTER, PostAlarmWindows
from tauguard.detectors.diagnosis.severity import ContactTorque
from tauguard.detectors.evaluation.card_page import printed_from, rate_text
from tauguard.detectors.evaluation.labelled_log import compare_with_labels, labels_text
from tauguard.findings import Findings, note
from tauguard.models.stored_robot import StoredRobot, robot_file
from tauguard.report import poisson_rate
from tauguard.results import Result, Row, finding_rows
from tauguard.traces.logs import Log
from tauguard.traces.trace import Detection, Trace

#: Meaning of each kind of contact.
KIND_TEXTS = {
    "transient": "the contact is over",
    "clamp": "it lasts, and the force was against the motion or rose fast",
    "push": "it lasts, and the force was along the motion or rose slowly",
}
#: Below this time, the text says that almost nothing of the log was watched [s].
LITTLE_TIME = 1.0


class AlarmInLog(NamedTuple):
    """An alarm, and the joint whose residual changes most in it."""

    start: float  #: [s]
    end: float  #: [s]
    joint: str


class Signals(NamedTuple):
    """What a detector computes from a log."""

    t: Array  #: time stamps [s], shape (T,)
    residual: Array  #: of an observer with the gain for logs [N m], shape (T, n)
    score: Array  #: shape (T,)


class _Causes(NamedTuple):
    diagnoses: tuple[Diagnosis, ...]
    torques: tuple[ContactTorque, ...]
    findings: Findings


@dataclass(frozen=True, eq=False, repr=False)
class LogDetection(Result):
    """Alarms and faults of one log.

    Link, point and force are estimated at the first use of ``diagnose``, ``findings``, ``to_dict``,
    ``to_frame`` or ``str``, if the robot file, the model file or the attached arm has the shapes of
    the links.
    """

    log: Log
    trace: Trace  #: the log with joints in the detector's order
    alarm: CollisionAlarm  #: the detector's score, threshold and confirmation
    found: LogAlarms
    checks: Findings = field(default_factory=Findings)  #: findings on the log, before the detection
    robot: Path | None = None
    at_tool: bool = False  #: all contacts are at the tool
    load_known: bool = False

    @property
    def detection(self) -> Detection:
        """Signals, threshold and alarms, as in MCAP files."""
        return self.found.detection

    @cached_property
    def alarms(self) -> tuple[AlarmInLog, ...]:
        """The alarms, in order."""
        names = self.trace.joint_names
        return tuple(
            AlarmInLog(one.start, one.end, names[self.found.joint_of(one)])
            for one in self.detection.alarms
        )

    @property
    def faults(self) -> tuple[Span, ...]:
        """Faults of the samples, with reasons; no alarm starts during a fault."""
        return self.found.faults

    @property
    def signals(self) -> Signals:
        """Time, residual and score of every sample."""
        return Signals(self.detection.t, self.detection.residual, self.detection.score)

    @cached_property
    def labels(self) -> dict[str, Any] | None:
        """Comparison with the log's labelled contacts; None without labels.

        The fields are those of :func:`.compare_with_labels`.
        """
        if self.log.labels is None:
            return None
        end = float(self.trace.t[-1])
        return compare_with_labels(self.detection.alarms, self.log.labels, self.found.begin, end)

    @property
    def judged_seconds(self) -> float:
        """Time in which every joint was judged [s]."""
        whole = float(self.trace.t[-1] - self.found.begin)
        return max(whole - self.found.fault_seconds - self.found.unwatched_seconds, 0.0)

    @property
    def findings(self) -> Findings:  # type: ignore[override]
        """Findings on the log, on the detection in it, and on the diagnoses."""
        return Findings((*self.checks, *self.found.findings, *self._causes.findings))

    def diagnose(self) -> tuple[Diagnosis, ...]:
        """A diagnosis of each alarm; empty if no shapes of the links are known."""
        return self._causes.diagnoses

    @cached_property
    def _causes(self) -> _Causes:
        alarms, arm = self.detection.alarms, self.alarm.detector.arm
        robot = self._stored_robot() if alarms else None
        if robot is None:
            return _Causes((), (), Findings())
        surface, findings = robot.surface, Findings()
        if surface is None:
            looked = PostAlarmWindows(arm, arm.noise_model, self.trace)
            torques = tuple(ContactTorque.of(looked.at(alarm.start)) for alarm in alarms)
            text = f"{robot.doubt}: links and forces are not estimated"
            return _Causes((), torques, Findings([note("shapes", text)]))
        if robot.sticks:
            text = (
                f"{robot.name}: no shape found of {', '.join(robot.sticks)}: thin capsules replace "
                "them when link and force are estimated. Put the meshes into the file's folder or "
                "a folder above it for better results"
            )
            findings = Findings([note("shapes", text, *robot.sticks)])
        diagnoser = Diagnoser.of(arm, surface, self.at_tool, self.load_known)
        return _Causes(tuple(diagnoser.diagnose(self.trace, alarms)), (), findings)

    def _stored_robot(self) -> StoredRobot | None:
        """The robot file, else the robot in the model file, else the attached arm."""
        if self.robot is not None:
            return StoredRobot.of(self.robot, self.alarm.detector.arm.robot.joint_names)
        text = self.trace.attachments.get("arm.xml")
        if self.alarm.robot is not None or text is None:
            return self.alarm.robot
        return StoredRobot.of_text("arm.xml", text)

    def robot_file(self) -> AbstractContextManager[Path | None]:
        """The robot's file while the context lasts: the given one, else that of the model file."""
        return robot_file(self.robot, self.alarm.robot)

    def rows(self) -> list[Row]:
        """One row per alarm: start, end [s], joint, and its diagnosis.

        ``link`` is missing where it is not identifiable.
        """
        rows: list[Row] = [alarm._asdict() for alarm in self.alarms]
        names = ("force x [N]", "force y [N]", "force z [N]")
        for row, one in zip(rows, self.diagnose(), strict=False):
            row["kind"] = one.kind
            row["link"] = one.link if one.link_identifiable else None
            row |= dict(zip(names, one.force.tolist(), strict=True))
            row["impulse [N s]"] = one.severity.impulse.value
            row["peak force [N]"] = one.severity.peak.value
        return rows

    def to_dict(self) -> dict[str, Any]:
        """The results as JSON values: alarms as ``events``, faults, labels, findings."""
        hours = max(self.judged_seconds, self.trace.dt) / 3600
        faults, t = self.faults, self.trace.t
        result = {
            "name": "detect",
            "log": self.log.name,
            "joints": list(self.trace.joint_names),
            "begin": float(t[0]),
            "seconds": float(t[-1] - t[0]),
            "watched_seconds": self.judged_seconds,
            "detector": self.detection.detector,
            "score_threshold": self.detection.threshold,
            "faults": [{"start": f.start, "end": f.end, "reason": f.reason} for f in faults],
            "fault_seconds": self.found.fault_seconds,
            "unwatched_seconds": self.found.unwatched_seconds,
            "alarms": len(self.alarms),
            "alarms_per_hour": len(self.alarms) / hours,
            "alarms_per_hour_high": poisson_rate(len(self.alarms), hours)["high"],
            "events": self._events(),
            "findings": finding_rows(self.findings),
        }
        return result if self.labels is None else result | {"labels": self.labels}

    def _events(self) -> list[dict[str, Any]]:
        diagnoses, torques, _ = self._causes
        names = self.trace.joint_names
        causes = [one.to_dict() for one in diagnoses] or [
            {"summary": one.text(names), **one.to_dict()} for one in torques
        ]
        causes = causes or [{}] * len(self.alarms)
        return [a._asdict() | cause for a, cause in zip(self.alarms, causes, strict=True)]

    def text(self) -> str:
        """Alarms, faults, and the number of alarms per hour or the comparison with the labels."""
        return "\n".join(_lines(self.to_dict()))

    def __repr__(self) -> str:
        """One line."""
        return (
            f"LogDetection({self.log.name}: {len(self.alarms)} alarms, {len(self.faults)} faults, "
            f"{self.judged_seconds:.1f} s watched)"
        )


def _lines(result: Mapping[str, Any]) -> list[str]:
    """The text of a result's JSON values."""
    since = printed_from(result["begin"])
    lines = [f"{result['detector']}: score above {result['score_threshold']:.3f} is an alarm"]
    if since and (result["events"] or result["faults"]):
        lines.append(f"times count from the log's first sample, at {since:.3f} s")
    for event in result["events"]:
        start, end = event["start"] - since, event["end"] - since
        line = f"alarm {start:.3f} s to {end:.3f} s, most on {event['joint']}"
        lines.append(f"{line}: {event['summary']}" if event.get("summary") else line)
    kinds = {event.get("kind") for event in result["events"]}
    if meanings := [f"{kind}: {text}" for kind, text in KIND_TEXTS.items() if kind in kinds]:
        lines.append(
            f"kinds of contact, {AFTER:g} s or more after an alarm begins: {'; '.join(meanings)}"
        )
    for fault in result["faults"]:
        start, end = fault["start"] - since, fault["end"] - since
        lines.append(f"fault {start:.3f} s to {end:.3f} s: {fault['reason']}")
    if result["fault_seconds"]:
        lines.append(f"faults hide collisions in {result['fault_seconds']:.2f} s of this log")
    count, seconds = result["alarms"], result["watched_seconds"]
    text = f"{count} alarm{'' if count == 1 else 's'} in {seconds:.1f} s watched"
    if labels := result.get("labels"):
        return [*lines, text, labels_text(labels, since)]
    if seconds < LITTLE_TIME:
        return [*lines, f"{text}: almost nothing of this log was watched"]
    most = rate_text(result["alarms_per_hour_high"], seconds, ": at most {} per hour (95 %)")
    false = "; if nothing touched the arm, each is a false alarm" if count else ""
    return [*lines, f"{text}{false}{most}"]
