"""A trained detector: alarms in logs and in streams, its threshold card, its file."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from tauguard.detectors import model_file
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.alarms.beside_free_motion import BesideFreeMotion
from tauguard.detectors.alarms.log_detection import detect_in_log
from tauguard.detectors.alarms.monitor import Monitor
from tauguard.detectors.alarms.training import carrying
from tauguard.detectors.arm_calibration import column_findings
from tauguard.detectors.calibration.joints import is_torque, linear_axes, matched, robot_numbers
from tauguard.detectors.calibration.recording import Recording
from tauguard.detectors.calibration.robot_names import other_arm_finding
from tauguard.detectors.detection import LogDetection
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.evaluation.card_page import ThresholdCard
from tauguard.detectors.evaluation.cross_validation import CrossValidation
from tauguard.detectors.evaluation.threshold_card import threshold_card
from tauguard.detectors.scores.free_motion import FittedFreeMotion
from tauguard.detectors.thresholds.expected_rate import ExpectedRate
from tauguard.detectors.thresholds.free_scores import FreeScores
from tauguard.detectors.thresholds.guarantee import Guarantee
from tauguard.findings import ArgumentError, Finding, Findings, MismatchError, cause, preceded_by
from tauguard.models.robot import bodies_file
from tauguard.models.stored_robot import robot_file
from tauguard.report import two_digits
from tauguard.results import Result, Row, finding_rows
from tauguard.traces.loads import Load, LoadLike, load_of
from tauguard.traces.logs import Log, Logs
from tauguard.traces.trace import Trace


@dataclass(frozen=True, eq=False, repr=False)
class Detector(Result):
    """A trained method with its threshold. It is immutable.

    What belongs to the training (``logs``, ``validation``, ``scores``, ``guarantee`` and the
    findings) is not in model files.
    """

    alarm: CollisionAlarm
    robot: Path | None = None  #: robot file, for the shapes of the links and a check of logs
    findings: Findings = field(default_factory=Findings)
    logs: Logs | None = None  #: the logs it was trained on
    validation: CrossValidation | None = None  #: free-motion: each log, judged by the others
    scores: Sequence[FreeScores] = ()  #: other methods: scores that the threshold comes from
    guarantee: Guarantee | None = None  #: of the threshold, with calibration logs
    false_alarms_per_hour: float | None = None  #: accepted in training [1/h]
    contacts: int = 0  #: number of simulated contacts it was trained on, beside free logs
    file: str = "the detector"  #: its file, as texts name it

    @property
    def method(self) -> str:
        """Name of the method."""
        return self.alarm.detector.name

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in the order of all arrays."""
        return self.alarm.detector.arm.robot.joint_names

    @property
    def arm(self) -> ArmModel:
        """The calibrated arm model."""
        return self.alarm.detector.arm

    @property
    def threshold(self) -> float:
        """A score above this for the confirmation time is an alarm."""
        return self.alarm.threshold

    @property
    def dt(self) -> float:
        """Sample interval of the training logs [s]."""
        return self.alarm.detector.dt

    def detect(
        self, log: Log | Trace, *, payload: LoadLike = None, at_tool: bool = False
    ) -> LogDetection:
        """Alarms, faults and findings of a log.

        The states are those of :meth:`stream`: free, collision, or fault if samples are wrong.

        Args:
            log: with the joints of this detector in any order.
            payload: the load that the arm carries: kg, (kg, (x, y, z)) with its centre in the last
                link's frame [m], or a :class:`Load`; 0 for none. Default: unknown, so it is
                estimated from the motion; before, only hard contacts are detected.
            at_tool: all contacts are at the tool, which narrows the intervals of the forces.

        Raises:
            MismatchError: the log is of another arm, sample rate or kind of effort.
            RefusedError: the log is too short, or its motion does not explain its torques.
            ArgumentError: a load for a detector that cannot be given one.
        """
        log = log if isinstance(log, Log) else Log(log, name=str(log.meta.get("log", "trace")))
        with preceded_by(log.findings):
            found = self._detect(log, payload, at_tool)
        return replace(found, checks=Findings((*log.findings, *found.checks)))

    def _detect(self, log: Log, payload: LoadLike, at_tool: bool) -> LogDetection:
        detector = self if payload is None else self.carrying(payload)
        arm, robot = detector.alarm.detector.arm, log.robot or self.robot
        if robot is not None:
            numbers = log.numbers if log.numbers is not None else robot_numbers(robot)
            if other := other_arm_finding(numbers, robot, arm.robot, self.file):
                raise MismatchError(other)
        trace = matched(log.trace, arm.robot.joint_names)
        checks = list[Finding]()
        if trace.truth is None:
            checks += linear_axes(arm.robot, {log.name: log})
            if is_torque(trace) and not (arm.drive_gain == 1).all():
                text = f"the log holds torques, {self.file} was trained on currents"
                raise MismatchError(*checks, cause("torques", text))
            doubts = column_findings(arm, {log.name: Recording(trace)})
            checks += [replace(doubt, severity="note", accept="") for doubt in doubts]
        return detected(detector.alarm, log, trace, checks, robot, at_tool, payload is not None)

    def stream(self) -> Monitor:
        """A stream of states: ``step(t, q, qd, current)`` gives (state, alarm, score, reason).

        Its alarms are those of :meth:`detect`, sample by sample.

        Raises:
            MismatchError: a detector of an old file, without limits of usual samples.
        """
        if self.alarm.inputs is None:
            text = f"{self.file}: has no limits of usual samples; train the detector anew"
            raise MismatchError(cause("no-limits", text))
        return Monitor(self.alarm, self.alarm.inputs)

    def carrying(self, payload: LoadLike) -> Detector:
        """The detector for an arm that carries this load, see :meth:`detect`.

        Raises:
            ArgumentError: not a free-motion detector: others cannot be given a load.
        """
        return replace(self, alarm=carrying(self.alarm, load_of(payload) or Load()))

    def card(self) -> ThresholdCard:
        """The least torques and forces that a free-motion detector finds.

        Raises:
            ArgumentError: another method, or a detector without its logs, as from a file.
        """
        fitted = self.alarm.detector
        if not isinstance(fitted, FittedFreeMotion):
            raise ArgumentError(f"{self.method}: only the method free-motion has a card")
        if self.logs is None or self.validation is None:
            raise ArgumentError(
                "the card needs the logs of the training: take it from the detector that "
                "`tauguard.train` returns, with `validate=True`"
            )
        return threshold_card(fitted, self.logs.traces, self.validation)

    def save(self, path: str | Path) -> Path:
        """Write the model file.

        Raises:
            ModelFileError: a field of the detector cannot be stored.
            OSError: cannot be written.
        """
        model_file.save_model(self.alarm, path, self.robot)
        return Path(path)

    def robot_file(self) -> AbstractContextManager[Path | None]:
        """The robot's file while the context lasts: the given one, else that of the model file."""
        return robot_file(self.robot, self.alarm.robot)

    def rows(self) -> list[Row]:
        """One row: method, joints, rate, threshold, confirmation and settling time."""
        return [
            {
                "method": self.method,
                "joints": len(self.joints),
                "rate [Hz]": round(1 / self.dt, 3),
                "threshold": self.threshold,
                "confirmation [s]": self.alarm.confirmation,
                "settling [s]": self.alarm.settle,
            }
        ]

    def to_dict(self) -> dict[str, Any]:
        """The detector, how it was trained, and the findings, as JSON values."""
        result: dict[str, Any] = {
            "name": "train",
            "method": self.method,
            "joints": list(self.joints),
            "rate_hz": 1 / self.dt,
            "threshold": self.threshold,
            "confirmation_s": self.alarm.confirmation,
            "settling_s": self.alarm.settle,
            "logs": [] if self.logs is None else list(self.logs),
            "findings": finding_rows(self.findings),
        }
        if self.validation is not None and isinstance(self.alarm.detector, FittedFreeMotion):
            result["card"] = self.card().to_dict()
        if self.guarantee is not None:
            result["guarantee"] = vars(self.guarantee)
        elif self.scores and self.false_alarms_per_hour is not None:
            low, high = ExpectedRate.of(self.scores).interval(self._learned_threshold)
            rate = {"requested": self.false_alarms_per_hour, "low": low, "high": high}
            result["false_alarms_per_hour"] = rate
        return result

    def text(self) -> str:
        """What it was trained on, and its card, guarantee or expected rate of false alarms."""
        lines = [self._trained_on()]
        if self.validation is not None and isinstance(self.alarm.detector, FittedFreeMotion):
            lines.append(str(self.card()))
        if self.guarantee is not None:
            lines.append(
                f"guaranteed: at most {self.guarantee.per_hour:g} false alarms per hour on motion "
                f"like that of the calibration ({self.guarantee.episodes} episodes, "
                f"{two_digits(self.guarantee.hours)} h), with a confidence of "
                f"{self.guarantee.confidence:.0%}"
            )
        elif self.scores and self.false_alarms_per_hour is not None:
            rate = ExpectedRate.of(self.scores)
            lines.append(rate.at(self._learned_threshold, self.false_alarms_per_hour))
        return "\n".join(lines)

    @property
    def _learned_threshold(self) -> float:
        """The threshold of the learned score, which may run beside free-motion."""
        fitted = self.alarm.detector
        return fitted.learned.threshold if isinstance(fitted, BesideFreeMotion) else self.threshold

    def _trained_on(self) -> str:
        if self.logs is None:
            return repr(self)
        count, fitted = len(self.logs), self.alarm.detector
        if isinstance(fitted, BesideFreeMotion):
            return (
                f"{self.method}, trained on {count} logs and {self.contacts} contacts of the twin; "
                f"the learned score's threshold is {self._learned_threshold:.3g}"
            )
        if isinstance(fitted, FittedFreeMotion):
            logs = "1 log" if count == 1 else f"{count} logs"
            return f"trained on {logs}, {fitted.seconds:.0f} s"
        collisions = sum(len(t.truth.collisions) for t in self.logs.traces if t.truth)
        return (
            f"{self.method} trained on {count} recordings with {collisions} collisions, "
            f"threshold {self.threshold:.3g}"
        )

    def __repr__(self) -> str:
        """One line."""
        return (
            f"Detector({self.method}, {len(self.joints)} joints, {1 / self.dt:.4g} Hz, "
            f"threshold {self.threshold:.3g})"
        )


def detected(
    alarm: CollisionAlarm,
    log: Log,
    trace: Trace,
    checks: Collection[Finding],
    robot: Path | None,
    at_tool: bool,
    load_known: bool,
) -> LogDetection:
    """The alarms of a log whose joints match; ``checks`` come before the findings of an error."""
    with preceded_by(checks):
        found = detect_in_log(alarm, trace, load_known)
    return LogDetection(log, trace, alarm, found, Findings(checks), robot, at_tool, load_known)


def load_detector(path: str | Path, robot: str | Path | None = None) -> Detector:
    """Read a model file.

    Args:
        path: written by :meth:`Detector.save`.
        robot: robot file of the arm, for the shapes of the links (default: that of each log).

    Raises:
        ModelFileError: damaged, of another version, or with types that are not allowed.
        MismatchError: ``robot`` is another arm than the detector's.
        OSError: cannot be read.
    """
    alarm = model_file.load_model(path)
    detector = Detector(alarm, file=str(path))
    if robot is None:
        return detector
    file = bodies_file(Path(robot))
    if other := other_arm_finding(robot_numbers(file), file, detector.arm.robot, detector.file):
        raise MismatchError(other)
    return replace(detector, robot=file)
