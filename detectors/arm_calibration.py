"""Calibration of a real arm: its numbers, friction and drive gains from logs of free motion."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tauguard.arrays import Array, Bools
from tauguard.detectors.calibration import arm_file
from tauguard.detectors.calibration.assessment import (
    LoadCheck,
    burst_findings,
    left_out,
    load_findings,
    unexplained,
    unexplained_findings,
)
from tauguard.detectors.calibration.checks import (
    gravity_finding,
    sign_findings,
    torque_per_ampere,
    unit_finding,
)
from tauguard.detectors.calibration.column_order import order_findings
from tauguard.detectors.calibration.identification import filtered_logs, identify
from tauguard.detectors.calibration.initial_arm import initial_arm, preset_gains
from tauguard.detectors.calibration.nominal import nominal_arm
from tauguard.detectors.calibration.recording import each_can_be_left_out, length_finding, moving
from tauguard.detectors.calibration.robot_names import robot_name_finding
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.evaluation.acceptance import held_out_finding
from tauguard.detectors.features.free_bound import SHOWN_SECONDS, motion_seconds
from tauguard.detectors.features.motion_regimes import exceeded, unseen_motion
from tauguard.findings import (
    ArgumentError,
    Finding,
    Findings,
    MismatchError,
    RefusedError,
    note,
    preceded_by,
    raise_errors,
)
from tauguard.report import table
from tauguard.results import Result, Row, finding_rows
from tauguard.traces.logs import Logs, Recording

Scale = Literal["auto", "gains", "payload", "masses"]

#: Below this torque per unit of the current columns [N m/A], the columns probably hold torques.
LEAST_TORQUE_PER_AMPERE = 2.0
#: A load that fixes the scale may differ more from what published gains show: these err by 50 %.
LOAD_AS_SCALE = LoadCheck(minimum_relative_difference=0.5)
#: What fixes the scale of the torques, as text.
SOURCES = {
    "torques": "the logs' torques",
    "gains": "the gains that were given",
    "preset": "the gains of the preset",
    "payload": "the known payload",
    "masses": "the robot file's masses",
}


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Result):
    """A calibrated arm: what was identified, how well it explains the logs, what is doubtful."""

    arm: ArmModel
    scale: str  #: what fixes the scale of the torques: torques, gains, preset, payload or masses
    rms: Array  #: root mean square of the residual in the logs [N m], shape (n,)
    held_out: Mapping[str, Array]
    """By log: RMS of the residual under a calibration from the other logs [N m], shape (n,). Empty
    if there are too few logs to leave one out."""
    loads: Mapping[str, float]  #: by log: mass of the identified or given load [kg]
    gain_error: Array  #: relative standard deviation of each drive gain, 0 if it was given, (n,)
    speed: Array  #: speeds up to which the logs show each joint [rad/s], shape (n,)
    moves: Bools  #: whether a joint moves in some log, shape (n,)
    findings: Findings = field(default_factory=Findings)
    preset: str = ""  #: name of the logs' columns
    source: Path | None = None  #: robot file; None: the arm is attached to the logs

    def rows(self) -> list[Row]:
        """One row per joint: gain [N m/A] and its error, mass, rotor inertia, RMS, speed.

        A joint that moves in no log has no rotor inertia, RMS and speed.
        """
        robot, rows = self.arm.robot, []
        for k, name in enumerate(robot.joint_names):
            moves = bool(self.moves[k])
            row: Row = {
                "joint": f"{name} (linear: N, m, kg)" if robot.prismatic[k] else name,
                "gain N m/A": float(self.arm.drive_gain[k]),
                "relative error": float(self.gain_error[k]) or None,
                "mass kg": float(robot.inertial[k, 0]),
                "rotor kg m2": float(robot.armature[k]) if moves else None,
                "rms N m": float(self.rms[k]) if moves else None,
                "up to rad/s": float(self.speed[k]) if moves else None,
            }
            rows.append(row)
        return rows

    def text(self) -> str:
        """The source of the scale, a table of the joints, and one of the held-out logs."""
        source = SOURCES[self.scale] + (f" {self.preset}" if self.scale == "preset" else "")
        parts = [f"scale of the torques: from {source}", table(list(map(self._text, self.rows())))]
        if self.held_out:
            parts.append(table(self._held_out_rows()))
        return "\n".join(parts)

    def _text(self, row: Row) -> Row:
        """A row of :meth:`rows` with rounded numbers."""
        known = self.scale if self.scale in ("preset", "torques") else "given"
        spread = row["relative error"]

        def number(name: str, digits: int) -> str:
            return "-" if row[name] is None else f"{row[name]:.{digits}f}"

        return {
            "joint": row["joint"],
            "gain N m/A": number("gain N m/A", 2),
            "+-": f"{100 * spread:.0f} %" if spread else known,
            "mass kg": number("mass kg", 2),
            "rotor kg m2": number("rotor kg m2", 3),
            "rms N m": number("rms N m", 2),
            "up to rad/s": number("up to rad/s", 2),
        }

    def _held_out_rows(self) -> list[Row]:
        robot, rows = self.arm.robot, list[Row]()
        pairs = zip(robot.joint_names, robot.prismatic, strict=True)
        units = [f"{joint} [{'N' if linear else 'N m'}]" for joint, linear in pairs]
        for name, rms in self.held_out.items():
            load = self.loads[name]
            carried = f"{load:.2f} kg" if abs(load) > 0.01 else ""
            values = {unit: f"{value:.2f}" for unit, value in zip(units, rms, strict=True)}
            rows.append({"held out, rms": name, "predicted without its load": carried} | values)
        return rows

    def __repr__(self) -> str:
        """One line."""
        robot = "attached arm" if self.source is None else self.source.name
        return (
            f"Calibration({robot}, {self.arm.robot.joints} joints, scale from "
            f"{SOURCES[self.scale]}, {len(self.loads)} logs, {len(self.findings)} findings)"
        )

    def to_dict(self) -> dict[str, Any]:
        """The results as JSON values."""
        return {
            "name": "calibrate",
            "joints": list(self.arm.robot.joint_names),
            "scale": self.scale,
            "drive_gain": self.arm.drive_gain.tolist(),
            "gain_relative_sd": self.gain_error.tolist(),
            "mass": self.arm.robot.inertial[:, 0].tolist(),
            "armature": self.arm.robot.armature.tolist(),
            "rms_nm": self.rms.tolist(),
            "held_out_rms_nm": {name: rms.tolist() for name, rms in self.held_out.items()},
            "loads_kg": dict(self.loads),
            "speed_rad_s": self.speed.tolist(),
            "moves": self.moves.tolist(),
            "findings": finding_rows(self.findings),
        }

    def save(self, path: str | Path) -> Path:
        """Write a calibrated robot file, in the format of the logs' robot file.

        Raises:
            ArgumentError: the arm was attached to the logs, so there is no robot file.
            OSError: cannot be written.
        """
        if self.source is None:
            raise ArgumentError("the arm is attached to the logs: there is no robot file to write")
        word = _method(self.scale)
        arm_file.save_arm(self.arm, self.source, path, scale=word, logs=list(self.loads))
        return Path(path)


def _method(scale: str) -> str:
    """The argument ``scale`` of :func:`identify`."""
    return "gains" if scale in ("preset", "torques") else scale


def accepted_words(accept: str | Collection[str]) -> frozenset[str]:
    """The words of ``accept=``, which may be one word."""
    return frozenset([accept] if isinstance(accept, str) else accept)


def column_findings(arm: ArmModel, logs: Mapping[str, Recording]) -> Findings:
    """Errors ``"signs"`` and ``"order"``: columns that do not fit the arm.

    If friction would push a joint in some logs, the order is checked in these logs, else in all of
    them together, and then in each.
    """
    signs = sign_findings(arm, logs)
    named = {name for finding in signs for name in finding.where}
    strange = {name: log for name, log in logs.items() if name in named}
    order = list(order_findings(arm, strange or logs))
    if not order and len(logs) > 1:
        for name, log in logs.items():
            order += [
                replace(finding, text=f"{name}: {finding.text}", where=(name, *finding.where))
                for finding in order_findings(arm, {name: log})
            ]
    return Findings((*signs, *order))


def calibrate(
    logs: Logs,
    *,
    gains: Sequence[float] = (),
    scale: Scale = "auto",
    accept: str | Collection[str] = (),
) -> Calibration:
    """Identify inertia, friction and drive gains from logs in which nothing touched the arm.

    Currents do not determine the drive gains. These come from ``gains`` if given, else from a log
    with a known load, else from the preset of the columns, else from the robot file's masses. Each
    log is then predicted by a calibration from the other logs. The method is described in
    :mod:`~tauguard.detectors.calibration.identification`.

    Args:
        logs: of :func:`tauguard.read_logs`, with 10 s of motion or more in all; of a simulated arm,
            the arm and its gains come from the recordings.
        gains: drive gains [N m/A], one per joint.
        scale: what fixes the scale of the torques: ``"gains"``, ``"payload"``, ``"masses"``, or
            ``"auto"`` as above.
        accept: findings that become warnings: ``"order"``, ``"gravity"``, ``"alarms"`` (bursts of
            torque like those of contacts), ``"error"`` (of a held-out log), or names of logs that
            may have bursts.

    Raises:
        RefusedError: the logs do not fit the robot or each other; ``error.findings`` has all
            causes, ``error.accept`` the words that accept them.
        ArgumentError: gains that do not fit the arm or ``scale``.
        MismatchError: no robot, or logs of different presets.
    """
    words = accepted_words(accept)
    with preceded_by(logs.findings):
        arm = _calibrate(logs, gains, scale, words)
    return replace(arm, findings=Findings((*logs.findings, *arm.findings)))


def _calibrate(
    logs: Logs, gains: Sequence[float], scale: Scale, words: Collection[str]
) -> Calibration:
    begin = beginning(logs, gains, scale, words)
    arm, used, source, numbers = begin.arm, begin.logs, begin.source, begin.numbers
    recordings, traces = list(used.values()), [log.trace for log in used.values()]
    columns = column_findings(arm, used)
    findings = raise_errors(RefusedError, (*begin.findings, *columns), words)
    method = _method(source)
    data = filtered_logs(arm, recordings) if method == "gains" else None
    identified = identify(arm, recordings, scale=method, data=data)
    doubts: list[Finding | None] = []
    if method != "masses":
        doubts.append(gravity_finding(numbers, identified.arm.robot, traces))
    if data is not None:
        doubts += load_findings(arm, used, data)
    elif begin.known_gains:
        doubts += load_findings(arm, used, filtered_logs(arm, recordings), LOAD_AS_SCALE)
    if method != "gains":
        doubts.append(_torque_note(torque_per_ampere(identified.arm, traces)))
    held: list[Array] = []
    if each_can_be_left_out(recordings):
        held = left_out(arm, recordings, scale=method, data=data)
    doubts += unseen_motion(logs.traces)
    doubts += explained(identified.arm, used, held, words)
    doubts.append(held_out_finding(identified.arm, used, held))
    doubts += identified.findings
    findings = raise_errors(RefusedError, [*findings, *_there(doubts)], words)
    names = list(used)
    return Calibration(
        identified.arm,
        source,
        identified.rms,
        dict(zip(names, held, strict=False)),
        dict(zip(names, identified.loads[:, 0].tolist(), strict=True)),
        identified.gain_error,
        exceeded([(trace.t, np.abs(trace.qd)) for trace in traces]),
        motion_seconds(recordings) >= SHOWN_SECONDS,
        findings,
        traces[0].meta.get("columns", ""),
        logs.robot,
    )


@dataclass(frozen=True)
class Beginning:
    """Logs in which a joint moves, and the arm before an identification from them."""

    arm: ArmModel
    source: str  #: what fixes the scale of the torques, as ``Calibration.scale``
    numbers: RobotNumbers  #: of the robot file
    logs: Mapping[str, Recording]
    known_gains: bool  #: the arm's gains do not come from these logs
    findings: Findings  #: errors among them are not raised yet

    @property
    def method(self) -> str:
        """The argument ``scale`` of :func:`.identification.identify`."""
        return _method(self.source)


def beginning(
    logs: Logs, gains: Sequence[float], scale: Scale, accept: Collection[str]
) -> Beginning:
    """Check length, names and units of logs, and choose the initial arm.

    The arguments and errors are those of :func:`calibrate`.
    """
    gains = tuple(gains)
    if gains and scale in ("masses", "payload"):
        raise ArgumentError(
            f'`gains=` cannot be combined with `scale="{scale}"`, which finds the gains'
        )
    numbers, gains = _numbers(logs, gains)
    used, still = moving(logs)
    recordings, traces = list(used.values()), [log.trace for log in used.values()]
    checks = [length_finding(recordings)]
    if not gains and logs.robot is not None:
        checks.append(robot_name_finding(logs.robot, traces))
    findings = raise_errors(RefusedError, [*still, *_there(checks)], accept)
    arm, source = initial_arm(numbers, recordings, gains, scale)
    known = bool(gains) or (source != "torques" and bool(preset_gains(traces)))
    unit = unit_finding(arm, traces) if known else None
    findings = Findings([*findings, *_there([unit])])
    return Beginning(arm, source, numbers, used, known, findings)


def explained(
    arm: ArmModel,
    logs: Mapping[str, Recording],
    held: Sequence[Array],
    accept: Collection[str],
) -> Findings:
    """Findings on torque that a calibration does not explain; not on bursts in accepted logs.

    Args:
        arm: identified from the logs.
        logs: by name.
        held: held-out RMS of each log [N m], shape (n,) each; may be empty.
        accept: words of the caller, among them names of logs, with or without extension.
    """
    joints, left = arm.robot.joint_names, unexplained(arm, logs)
    others = {n: one for n, one in left.items() if not {n, Path(n).stem} & set(accept)}
    return Findings(
        (*unexplained_findings(joints, left, logs, held), *burst_findings(joints, others))
    )


def _there(findings: Sequence[Finding | None]) -> list[Finding]:
    return [finding for finding in findings if finding is not None]


def _numbers(logs: Logs, gains: tuple[float, ...]) -> tuple[RobotNumbers, tuple[float, ...]]:
    """The robot's numbers and the given gains; for a simulated arm, those attached to it."""
    if logs.numbers is not None:
        return logs.numbers, gains
    if logs.robot is not None:
        raise MismatchError("logs: the robot file was not read; use `tauguard.read_logs`")
    attached = nominal_arm(logs.traces)
    return attached.robot, gains or tuple(attached.drive_gain.tolist())


def _torque_note(ratio: float) -> Finding | None:
    if ratio >= LEAST_TORQUE_PER_AMPERE:
        return None
    text = (
        f"one unit of the current columns gives {ratio:.1f} N m, so the columns may hold joint "
        "torques; if they do, add `torque=True`"
    )
    return note("torques?", text)
