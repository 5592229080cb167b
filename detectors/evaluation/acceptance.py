"""Checks of a calibration and a detector by cross-validation on collision-free logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.calibration.recording import Load, Recording
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.evaluation.card_page import times
from tauguard.detectors.evaluation.cross_validation import CrossValidatedLog, CrossValidation
from tauguard.detectors.features.free_bound import friction_levels
from tauguard.findings import Finding, Findings, cause, note
from tauguard.report import poisson_rate


@dataclass(frozen=True)
class Acceptance:
    """Limits of a calibration and of a detector in cross-validation."""

    maximum_error: float = 2.0
    """Of a calibration in a held-out log, root mean square in friction levels of the joint. On
    three real arms the error is at most 1.3, for a wrist that moves in only one log. The estimator
    of a detector then reduces this error."""
    maximum_bound_ratio: float = 1.0  #: median of residual over bound in motion, of each log


def alarm_finding(logs: Sequence[CrossValidatedLog], per_hour: float) -> Finding | None:
    """An error ``"alarms"`` if cross-validated logs have more than ``per_hour`` alarms per hour.

    The rate must be above ``per_hour`` with 97.5 % confidence.
    """
    alarms, seconds = sum(len(log.alarms) for log in logs), sum(log.seconds for log in logs)
    low = poisson_rate(alarms, seconds / 3600)["low"]
    if low is None or low <= per_hour:
        return None
    own = ", ".join(f"{log.name}: {times(log)}" for log in logs if log.alarms)
    text = (
        f"{alarms} alarms in {seconds / 60:.1f} min of collision-free logs, each log judged by "
        f"thresholds from the others ({own}): at least {low:.0f} an hour where {per_hour:g} are "
        "accepted; if something touched the arm at these times, leave out these logs or cut out "
        "the touches; if nothing did, give more logs of similar motion"
    )
    return cause("alarms", text, *(log.name for log in logs if log.alarms), accept="alarms")


def bound_finding(
    logs: Sequence[CrossValidatedLog], options: Acceptance = Acceptance()
) -> Finding | None:
    """An error ``"error"`` for logs whose residual exceeds the other logs' bounds half of the time.

    Only the time in which joints move counts.
    """
    beyond = [log for log in logs if log.level > options.maximum_bound_ratio]
    if not beyond:
        return None
    own = ", ".join(f"{log.name} (median {log.level:.1f} times the bound)" for log in beyond)
    text = (
        "with bounds from the other logs, the residual exceeds its bound for half of the time "
        f"in which joints move, in {own}; possible causes: a load that was not given, or a "
        "motion that the others do not show"
    )
    return cause("error", text, *(log.name for log in beyond), accept="error")


def held_out_finding(
    arm: ArmModel,
    recordings: Mapping[str, Recording],
    held: Sequence[Array],
    options: Acceptance = Acceptance(),
) -> Finding | None:
    """An error ``"held-out-error"`` if the calibration errs much in a held-out log.

    Args:
        arm: identified from all recordings.
        recordings: collision-free, by name; those with a load are not checked.
        held: held-out RMS residual of each recording without a load [N m], shape (n,) each; may be
            empty.
        options: limits.
    """
    if not len(held):
        return None
    names, several = list(recordings), list(recordings.values())
    level = friction_levels(arm, several)[0]
    laden = np.array([recording.load != Load() for recording in several])
    over = np.where(laden[:, None], 0.0, np.asarray(held) / level)
    log, joint = divmod(int(np.argmax(over)), over.shape[1])
    if over[log, joint] <= options.maximum_error:
        return None
    name = arm.robot.joint_names[joint]
    text = (
        f"predicted by the other logs, {name} in {names[log]} has a "
        f"torque error of {held[log][joint]:.3g} N m (root mean square), more than "
        f"{options.maximum_error:g} times its friction of {level[joint]:.3g} N m; possible causes: "
        "poses or loads that the others do not show, or a contact; give more logs, or leave this "
        "one out"
    )
    return cause("held-out-error", text, names[log], name, accept="error")


def odd_log_findings(validation: CrossValidation) -> Findings:
    """Notes ``"log-left-out"``, ``"odd-log"`` and ``"load?"`` on logs that differ from the others.

    They have far more alarms than the others, or other torques throughout.
    """
    findings = []
    count = sum(len(log.alarms) for log in validation.kept) or "none"
    others = f"{count} in {sum(log.seconds for log in validation.kept) / 60:.1f} min"
    for log in validation.left_out:
        cause = (
            f"a load (then give {_payload(log.name)}), another temperature"
            if log.throughout
            else "something touched the arm"
        )
        text = (
            f"{log.name} stands out: {times(log)}, judged by thresholds from the other logs, which "
            f"have {others}. Possible causes: {cause}, or a motion that the others lack. The log "
            "is left out of the training; if nothing touched the arm, keep it with "
            f'`accept="{log.name}"`'
        )
        findings.append(note("log-left-out", text, log.name))
    for log in validation.accepted:
        text = (
            f"{log.name} stands out ({times(log)}) and is kept as `accept=` says: if it contains a "
            "contact, the thresholds rise, and similar contacts are missed"
        )
        findings.append(note("odd-log", text, log.name))
    for log in validation.kept:
        if log.throughout:
            text = (
                f"{log.name}: its torques differ throughout from those of the other logs: did the "
                f"arm carry something (then give {_payload(log.name)})?"
            )
            findings.append(note("load?", text, log.name))
    return Findings(findings)


def _payload(log: str) -> str:
    return f'`payload={{"{log}": KG}}` or `payload={{"{log}": None}}`'
