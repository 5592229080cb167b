"""A twin of a real arm from its logs, with intervals, and compared with the arm in other motion."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tauguard.arrays import Array
from tauguard.detectors import ArmModel
from tauguard.detectors.arm_calibration import Beginning, accepted_words, beginning, explained
from tauguard.detectors.calibration.assessment import left_out
from tauguard.detectors.calibration.checks import sign_findings
from tauguard.detectors.calibration.column_order import order_findings
from tauguard.detectors.calibration.identification import identify
from tauguard.detectors.calibration.recording import each_can_be_left_out, pieces
from tauguard.findings import (
    ArgumentError,
    Finding,
    Findings,
    RefusedError,
    TauguardError,
    note,
    preceded_by,
    raise_errors,
)
from tauguard.models import load_arm
from tauguard.report import table
from tauguard.results import Result, Row, finding_rows, save_figure
from tauguard.traces.logs import Logs, Recording
from tauguard.traces.trace import Trace
from tauguard.twin.description import write_twin
from tauguard.twin.figure import figure_of
from tauguard.twin.identify import Twin, fit_twin, with_intervals
from tauguard.twin.judge import Likeness, compare, with_alarms
from tauguard.twin.sorting import odd_logs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Half width of a 95 % interval in standard deviations.
HALF_WIDTH = 1.96
#: Number of parts into which the logs are divided for the jackknife that gives the intervals.
JACKKNIFE_PARTS = 5


@dataclass(frozen=True, eq=False, repr=False)
class TwinOfLogs(Result):
    """A twin, and how similar it is to the arm."""

    twin: Twin
    likeness: Likeness | None  #: None: no log was left for the comparison
    compared: tuple[str, ...]  #: names of the logs of the comparison
    reasons: tuple[str, ...]  #: why there is no likeness
    scale: str  #: what fixes the scale of the torques, as ``Calibration.scale``
    logs: tuple[str, ...]  #: names of the logs from which the twin was identified
    robot: Path
    findings: Findings = field(default_factory=Findings)

    def rows(self) -> list[Row]:
        """Simulated over real residuals by joint, alarms, and areas under curves."""
        if self.likeness is None:
            return []
        one = self.likeness
        areas = {kind: f"{_two(a)}, {_two(b)}" for kind, (a, b) in _areas(one).items()}
        alarms = dict(zip(("arm", "twin"), one.alarms, strict=True))
        return [
            *self._joint_rows(one),
            {"residual": "alarms", "seconds": one.seconds} | alarms,
            {"residual": "area under the curve"} | areas,
        ]

    def _joint_rows(self, one: Likeness) -> list[Row]:
        kinds = {
            "rms, moving": one.rms,
            "peaks, moving": one.peaks,
            "rms, standing": one.standing_rms,
            "peaks, standing": one.standing_peaks,
            "real: power above": one.high[0],
            "twin: power above": one.high[1],
            "real: 0.1 s later": one.correlation[0],
            "twin: 0.1 s later": one.correlation[1],
        }
        joints = self.twin.arm.robot.joint_names
        return [
            {"residual": kind} | {j: _two(v) for j, v in zip(joints, values, strict=True)}
            for kind, values in kinds.items()
        ]

    def to_dict(self) -> dict[str, Any]:
        """The comparison and the findings as JSON values."""
        return {
            "name": "twin",
            "scale": self.scale,
            "judged_on": list(self.compared),
            "rows": self.rows(),
            "findings": finding_rows(self.findings),
        }

    def text(self) -> str:
        """How similar twin and arm are, or why this is not known."""
        if self.likeness is None:
            why = (
                f"without {', '.join(self.compared)}, the other logs make no twin "
                f"({'; '.join(self.reasons)})"
            )
            few = "no log is left for the comparison, which uses every third log that has no load"
            why = why if self.compared else few
            return f"not judged: {why}; give more logs, or others to judge"
        one = self.likeness
        text = "; ".join(f"{kind} {_two(a)}, {_two(b)}" for kind, (a, b) in _areas(one).items())
        return (
            f"judged on {', '.join(self.compared)}; rms and 99 % of peaks: simulated over real\n"
            f"{table(self._joint_rows(one))}\n"
            "area under the curve of a classifier that tells simulated from real (boosted trees, "
            f"logistic regression; .5: it cannot): {text}\n"
            f"alarms of free-motion, trained on the twin's logs, in {one.seconds:.0f} s: "
            f"{one.alarms[0]} on the arm, {one.alarms[1]} on the twin along the same motion"
        )

    def __repr__(self) -> str:
        """One line."""
        judged = "not judged" if self.likeness is None else f"judged on {len(self.compared)} logs"
        return (
            f"TwinOfLogs({self.robot.name}, {len(self.logs)} logs, {judged}, "
            f"{len(self.findings)} findings)"
        )

    def save(self, path: str | Path) -> list[Path]:
        """Write the twin's TOML file, and its bodies into the same folder; return all files.

        Raises:
            ArgumentError: the name does not end in .toml.
            OSError: cannot be written.
        """
        path = Path(path)
        if path.suffix != ".toml":
            raise ArgumentError(f"{path}: expected a name that ends in .toml")
        notes = tuple(finding.text for finding in self.findings.of(*_WRITTEN))
        twin = replace(self.twin, notes=notes)
        return [path, *write_twin(twin, self.robot, path, list(self.logs), self.scale)]

    def draw(self, path: str | Path) -> None:
        """Draw :meth:`figure` (PNG).

        Raises:
            ArgumentError: there is no likeness.
        """
        save_figure(self.figure(), path, 90)

    def figure(self) -> Figure:
        """Real and simulated residuals with the results.

        Raises:
            ArgumentError: there is no likeness.
        """
        if self.likeness is None:
            raise ArgumentError("the twin was not judged: there is nothing to draw")
        return figure_of(self.twin.arm.robot.joint_names, self.likeness)


#: Findings that a twin's file repeats.
_WRITTEN = ("log-left-out", "unexplained", "load?", "twin")


def _areas(one: Likeness) -> dict[str, tuple[float, float]]:
    return {
        "moving": one.moving_auc,
        "standing": one.standing_auc,
        "the arm in its own logs against the arm in these, moving": one.programs_auc,
    }


def _two(value: float) -> str:
    return "-" if value != value else f"{value:.2f}"


def identify_twin(
    logs: Logs,
    *,
    gains: Sequence[float] = (),
    accept: str | Collection[str] = (),
    judge: Logs | None = None,
) -> TwinOfLogs:
    """Identify a twin from logs in which nothing touched the arm, and compare it with the arm.

    Args:
        logs: of :func:`tauguard.read_logs`, with a robot file. Logs that the others do not predict
            are left out.
        gains: drive gains [N m/A], one per joint.
        accept: ``"alarms"`` (bursts of torque like those of contacts), ``"order"``.
        judge: logs of other motion, without a load, for the comparison. By default every third log
            is compared with a twin from the other logs, and the twin is identified from all logs.

    Raises:
        RefusedError: as for :func:`tauguard.calibrate`, or logs of two arms.
        ArgumentError: no robot file, or all logs carry a load.
    """
    if logs.robot is None:
        raise ArgumentError("logs: a twin needs logs of a real arm, with a robot file")
    read = (*logs.findings, *(() if judge is None else judge.findings))
    with preceded_by(read):
        twin = _identify(logs, logs.robot, gains, accepted_words(accept), judge)
    return replace(twin, findings=Findings((*read, *twin.findings)))


def _identify(
    logs: Logs,
    robot: Path,
    gains: Sequence[float],
    words: Collection[str],
    judge: Logs | None,
) -> TwinOfLogs:
    begin = beginning(logs, gains, "auto", words)
    signs = sign_findings(begin.arm, begin.logs)
    if signs:
        signs = Findings((*signs, *order_findings(begin.arm, begin.logs)))
    findings = raise_errors(RefusedError, (*begin.findings, *signs), words)
    begin, left = _without_odd_logs(begin)
    order = order_findings(begin.arm, begin.logs)
    findings = raise_errors(RefusedError, (*findings, *left, *order), words)
    recordings = list(begin.logs.values())
    limit = load_arm(str(robot)).torque_limit
    twin = _twin_from(begin, recordings, limit)
    apart: list[Array] = []
    if each_can_be_left_out(recordings):
        apart = left_out(begin.arm, recordings, scale=begin.method)
    doubts = explained(twin.arm, begin.logs, apart, words)
    findings = raise_errors(RefusedError, (*findings, *doubts), words)
    twin, lacking = _with_jackknife(twin, begin, limit)
    likeness, compared, reasons = _judged(twin, begin, limit, judge)
    notes = [note("twin", text) for text in (*twin.notes, *lacking)]
    return TwinOfLogs(
        twin,
        likeness,
        tuple(compared),
        tuple(reasons),
        begin.source,
        tuple(begin.logs),
        robot,
        Findings((*findings, *notes)),
    )


def _without_odd_logs(begin: Beginning) -> tuple[Beginning, list[Finding]]:
    """Logs that a calibration from the other logs predicts, and a note on each log left out."""
    names, recordings, arm = list(begin.logs), list(begin.logs.values()), begin.arm
    if begin.method != "gains":
        gains = identify(arm, recordings, scale=begin.method).arm.drive_gain
        arm = ArmModel(arm.robot, gains)
    odd = [names[k] for k in odd_logs(arm, names, recordings)]
    notes = [
        note(
            "log-left-out",
            f"{name} is left out: the other logs do not predict it. Did the arm carry something "
            f'(then give `payload={{"{name}": KG}}` or `payload={{"{name}": None}}`), is it '
            "another arm, or did something touch it?",
            name,
        )
        for name in odd
    ]
    kept = {name: log for name, log in begin.logs.items() if name not in odd}
    return replace(begin, logs=kept), notes


def _twin_from(begin: Beginning, used: Sequence[Recording], limit: Array) -> Twin:
    """A twin from some of the logs; ``limit`` are the arm's largest torques [N m], shape (n,)."""
    identified = identify(begin.arm, used, scale=begin.method)
    bare = [r.trace for r in used if _unloaded(r)]
    if not bare:
        raise ArgumentError("all logs carry a load: a twin needs at least one without")
    twin = fit_twin(identified.arm, bare, limit / abs(identified.arm.drive_gain))
    return replace(twin, intervals={"inertial": HALF_WIDTH * identified.inertial_error})


def _with_jackknife(twin: Twin, begin: Beginning, limit: Array) -> tuple[Twin, list[str]]:
    """The twin with intervals from twins identified without a part of the logs, and notes."""
    parts = pieces(list(begin.logs.values()), JACKKNIFE_PARTS)
    rest = [[r for i, r in enumerate(parts) if i != k] for k in range(len(parts))]
    others, lacking = _twin_from_each(begin, rest, limit)
    notes = [f"a twin for the intervals is missing: {why}" for why in lacking]
    return with_intervals(twin, others), notes


def _judged(
    twin: Twin, begin: Beginning, limit: Array, judge: Logs | None
) -> tuple[Likeness | None, list[str], list[str]]:
    """Compare twin and arm in motion from which the compared twin was not identified.

    Returns:
        The likeness or None, the names of the compared logs, and why there is no likeness.
    """
    names, recordings = list(begin.logs), list(begin.logs.values())
    held = [] if judge else [k for k in range(2, len(names), 3) if _unloaded(recordings[k])]
    tried: Mapping[str, Trace] = {names[k]: recordings[k].trace for k in held}
    if judge:
        tried = {name: log.trace for name, log in judge.items()}
    used = [r for k, r in enumerate(recordings) if k not in held]
    twins, reasons = _twin_from_each(begin, [used], limit) if held else ([twin], [])
    if not twins or not tried:
        return None, list(tried), reasons
    bare, others = [r.trace for r in used if _unloaded(r)], list(tried.values())
    likeness = compare(twins[0].arm, twins[0].drive, others, own=bare)
    return with_alarms(likeness, used, begin.arm, others), list(tried), reasons


def _twin_from_each(
    begin: Beginning, groups: Sequence[Sequence[Recording]], limit: Array
) -> tuple[list[Twin], list[str]]:
    """A twin from each group of logs, and the different reasons why some groups give none."""
    twins, reasons = list[Twin](), list[str]()
    for used in groups:
        try:
            twins.append(_twin_from(begin, used, limit))
        except TauguardError as error:
            reasons += [str(error)] if str(error) not in reasons else []
    return twins, reasons


def _unloaded(recording: Recording) -> bool:
    return recording.load is not None and recording.load.mass == 0
