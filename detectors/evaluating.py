"""Alarms of a detector compared with the true collisions of recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tauguard.detectors.detector import Detector
from tauguard.detectors.evaluation.diagnosis_metrics import diagnosis_metrics, judge_recording
from tauguard.detectors.evaluation.matching import Matching, detection_metrics
from tauguard.detectors.evaluation.metrics_page import diagnosis_text, figure, text
from tauguard.findings import Findings
from tauguard.results import Result, Row, finding_rows, save_figure
from tauguard.traces.logs import Log, Logs
from tauguard.traces.trace import Detection, Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Called with the name of a recording, its matching, and its trace and detection.
Visitor = Callable[[str, Matching, tuple[Trace, Detection]], None]


@dataclass(frozen=True, eq=False, repr=False)
class Evaluation(Result):
    """Which collisions were detected, with which delays, and the false alarms."""

    names: Sequence[str]  #: of the recordings
    matchings: Sequence[Matching]  #: of each recording
    metrics: Mapping[str, Any]
    """Rates with 95 % intervals, delays [ms], numbers; ``diagnosis`` for diagnosed alarms."""
    findings: Findings = field(default_factory=Findings)

    @classmethod
    def of(cls, names: Sequence[str], matchings: Sequence[Matching]) -> Evaluation:
        """The metrics of matched alarms, without diagnoses."""
        return cls(tuple(names), tuple(matchings), detection_metrics(matchings))

    def rows(self) -> list[Row]:
        """One row per recording: collisions, those detected, false alarms, collision-free time."""
        return [
            {
                "recording": name,
                "collisions": len(one.collisions),
                "detected": sum(delay is not None for delay in one.delays),
                "false alarms": len(one.false_alarms),
                "free [s]": round(one.free_seconds, 3),
            }
            for name, one in zip(self.names, self.matchings, strict=True)
        ]

    def to_dict(self) -> dict[str, Any]:
        """The metrics and the findings as JSON values."""
        return {**self.metrics, "findings": finding_rows(self.findings)}

    def text(self) -> str:
        """The metrics as a page of text."""
        page = text(self.metrics)
        diagnosis = self.metrics.get("diagnosis")
        return page if diagnosis is None else f"{page}\n{diagnosis_text(diagnosis)}"

    def __repr__(self) -> str:
        """One line."""
        counts = self.metrics["confusion"]
        return (
            f"Evaluation({len(self.names)} recordings, {counts['tp']} of "
            f"{counts['tp'] + counts['fn']} collisions detected, {counts['fp']} false alarms)"
        )

    def draw(self, path: str | Path) -> None:
        """Draw :meth:`figure` (PNG)."""
        save_figure(self.figure(), path, 110)

    def figure(self) -> Figure:
        """Sensitivity and delay over severity, and the confusion matrix."""
        return figure(self.metrics, self.matchings)


def evaluate(
    detector: Detector, logs: Logs | Iterable[Trace | Log], visit: Visitor | None = None
) -> Evaluation:
    """Compare the alarms of a detector with the truth of recordings.

    Args:
        detector: trained on other recordings.
        logs: with truth. An iterator is read one recording at a time.
        visit: called for each recording.

    Raises:
        ArgumentError: no truth, other joints, or another sample rate.
    """
    several = logs.values() if isinstance(logs, Logs) else logs
    names, matchings, diagnoses = list[str](), list[Matching](), []
    for number, log in enumerate(several):
        trace = log.trace if isinstance(log, Log) else log
        name = trace.meta.get("log") or trace.meta.get("episode")
        name = log.name if isinstance(log, Log) else name or str(number)
        one = judge_recording(detector.alarm, name, trace)
        names.append(name)
        matchings.append(one.matching)
        diagnoses += one.diagnoses(detector.alarm)
        if visit is not None:
            visit(name, one.matching, (trace, one.detection))
    metrics = {**detection_metrics(matchings), "diagnosis": diagnosis_metrics(diagnoses)}
    return Evaluation(tuple(names), tuple(matchings), metrics)
