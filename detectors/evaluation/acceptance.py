"""Checks of a calibration and a detector by cross-validation on collision-free logs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.calibration.recording import Load, Recording
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.evaluation.card_page import times
from tauguard.detectors.evaluation.cross_validation import CrossValidatedLog
from tauguard.detectors.features.free_bound import friction_levels
from tauguard.findings import RefusedError
from tauguard.report import poisson_rate

#: Largest accepted RMS error of a calibration in a held-out log, in friction levels of the joint.
#: On three real arms the error is at most 1.3, for a wrist that moves in only one log. The
#: estimator of a detector then reduces this error.
HELD_OUT = 2.0
#: Accepted false alarms per hour of logs without a contact.
ASKED = 10.0


def check_own_alarms(logs: Sequence[CrossValidatedLog], asked: float = ASKED) -> None:
    """Refuse a detector whose cross-validated logs have more than ``asked`` alarms per hour.

    Args:
        logs: cross-validated logs.
        asked: accepted false alarms per hour.

    Raises:
        RefusedError: the rate is above ``asked`` with 97.5 % confidence.
    """
    alarms, seconds = sum(len(log.alarms) for log in logs), sum(log.seconds for log in logs)
    low = poisson_rate(alarms, seconds / 3600)["low"]
    if low is None or low <= asked:
        return
    own = ", ".join(f"{log.name}: {times(log)}" for log in logs if log.alarms)
    raise RefusedError(
        f"{alarms} alarms in {seconds / 60:.1f} min of collision-free logs, each log judged by "
        f"thresholds from the others ({own}): at least {low:.0f} an hour where {asked:g} are "
        "accepted; if something touched the arm at these times, leave out these logs or cut out "
        "the touches; if nothing did, give more logs of similar motion"
    )


def check_own_error(logs: Sequence[CrossValidatedLog]) -> None:
    """Refuse logs whose residual exceeds the other logs' bounds for half of the time in motion.

    Raises:
        RefusedError: names the logs.
    """
    if beyond := [log for log in logs if log.level > 1]:
        own = ", ".join(f"{log.name} (median {log.level:.1f} times the bound)" for log in beyond)
        raise RefusedError(
            "with bounds from the other logs, the residual exceeds its bound for half of the time "
            f"in which joints move, in {own}; possible causes: a load that was not given, or a "
            "motion that the others do not show"
        )


def check_held_out(
    arm: ArmModel, names: Sequence[str], recordings: Sequence[Recording], held: Sequence[Array]
) -> None:
    """Refuse a calibration whose error in a held-out log exceeds HELD_OUT friction levels.

    Args:
        arm: identified from all recordings.
        names: names of the recordings.
        recordings: collision-free; those with a load are not checked.
        held: held-out RMS residual of each recording without a load [N m], shape (n,) each.

    Raises:
        RefusedError: names joint, log, error and friction level of the largest excess.
    """
    if not len(held):
        return
    level = friction_levels(arm, recordings)[0]
    laden = np.array([recording.load != Load() for recording in recordings])
    over = np.where(laden[:, None], 0.0, np.asarray(held) / level)
    log, joint = divmod(int(np.argmax(over)), over.shape[1])
    if over[log, joint] > HELD_OUT:
        raise RefusedError(
            f"predicted by the other logs, {arm.robot.joint_names[joint]} in {names[log]} has a "
            f"torque error of {held[log][joint]:.3g} N m (root mean square), more than "
            f"{HELD_OUT:g} times its friction of {level[joint]:.3g} N m; possible causes: poses or "
            "loads that the others do not show, or a contact; give more logs, or leave this one out"
        )
