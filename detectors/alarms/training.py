"""Training of detectors, and thresholds from collision-free motion.

Scores are reduced to peaks of short pieces of motion (:mod:`.free_scores`) and normalised by
speed (:mod:`.speed_normalisation`). The threshold is the score that peaks exceed at the accepted
rate of false alarms, by a tail model (:mod:`.tail_model`), or one that calibration episodes
guarantee (:mod:`.guarantee`). :mod:`.expected_rate` computes an interval of the rate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.alarms.beside_free_motion import BesideFreeMotion
from tauguard.detectors.alarms.self_check import check_alarms, check_ranges, standing_then_hit
from tauguard.detectors.calibration.identification import Subsets
from tauguard.detectors.calibration.nominal import nominal_arm
from tauguard.detectors.calibration.recording import (
    LEAST,
    Load,
    Recording,
    motion_length,
    moves,
    pieces,
)
from tauguard.detectors.codec import check_storable
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.events import CONFIRMATION
from tauguard.detectors.faults.inputs import UsualInput
from tauguard.detectors.one_thread import one_thread
from tauguard.detectors.scores.free_motion import CONFIRMATION as FREE_CONFIRMATION
from tauguard.detectors.scores.free_motion import FittedFreeMotion
from tauguard.detectors.scores.method import FittedMethod, Method
from tauguard.detectors.thresholds.free_scores import FreeScores
from tauguard.detectors.thresholds.guarantee import Guarantee, guaranteed_threshold
from tauguard.detectors.thresholds.tail_model import normalisations, threshold_for_rate
from tauguard.findings import ArgumentError, Finding, Findings, note
from tauguard.models.stored_robot import StoredRobot
from tauguard.traces.trace import Trace

#: Fraction of the collision-free traces that is held out for the threshold without folds.
HELD_OUT = 0.34

#: Number of folds of the cross-validation.
FOLDS = 3

#: A learned score beside free motion has at least the threshold 1 / (UNLIKE (N + 1)) times the
#: highest score of N logs. So UNLIKE is the accepted probability that a new log exceeds it: a new
#: log has the highest score of N + 1 logs with probability 1 / (N + 1), and a score k times the
#: highest of N logs is assumed to be k times less probable (k was up to 3.1 on real arms).
UNLIKE = 0.05


def held_out(traces: Sequence[Trace]) -> tuple[list[Trace], list[Trace]]:
    """Traces to train on, and collision-free ones for the threshold.

    Returns:
        The two lists. With fewer than two collision-free traces each list has all traces. Then the
        threshold comes from motion that the detector was trained on.
    """
    free = [i for i, t in enumerate(traces) if not _collisions(t)]
    count = min(len(free) - 1, max(1, round(HELD_OUT * len(free)))) if len(free) > 1 else 0
    if count == 0:
        return list(traces), list(traces)
    # Evenly spaced, because traces are often listed by speed or payload.
    kept = {free[round((k + 0.5) * len(free) / count - 0.5)] for k in range(count)}
    return [t for i, t in enumerate(traces) if i not in kept], [traces[i] for i in sorted(kept)]


def train(
    detector: Method,
    traces: Sequence[Trace],
    arm: ArmModel | None = None,
    per_hour: float = 10.0,
    folds: int = FOLDS,
) -> CollisionAlarm:
    """Fit a detector and choose its threshold from motion that it was not trained on.

    Args:
        detector: settings of a method.
        traces: with truth, of one arm at one sample rate.
        arm: arm model before training (default: the one attached to simulated traces).
        per_hour: accepted false alarms per hour of motion like that of the training traces.
        folds: folds of the cross-validation (at most one per collision-free trace). The detector is
            trained on all traces. The threshold comes from the collision-free traces: each is
            scored by a detector that was trained without its load or, if there are fewer loads than
            folds, without this trace. This needs ``folds`` more fits. With 1, a third of the
            collision-free traces is held out for the threshold instead, which is faster.

    Raises:
        ArgumentError: traces of different arms or rates, or without data that the method needs;
            ``per_hour`` not above 0, or ``folds`` below 1; a method with a field that no model file
            can hold.
    """
    believed = nominal_arm(traces) if arm is None else arm
    return train_and_score(detector, traces, believed, per_hour, folds)[0]


def free_alarm(fitted: FittedFreeMotion, traces: Sequence[Trace]) -> CollisionAlarm:
    """The alarm of a free-motion detector, whose threshold is 1.

    Args:
        fitted: the detector.
        traces: the logs that it was trained on; the limits of usual samples come from them.
    """
    usual = UsualInput.of(traces, fitted.arm)
    return CollisionAlarm(fitted, 1.0, FREE_CONFIRMATION, inputs=usual)


def train_and_score(
    detector: Method,
    traces: Sequence[Trace],
    arm: ArmModel,
    per_hour: float,
    folds: int = FOLDS,
) -> tuple[CollisionAlarm, list[FreeScores]]:
    """As :func:`train`, with the normalised scores that the threshold comes from."""
    if not (per_hour > 0 and folds >= 1):
        raise ArgumentError(f"per_hour {per_hour}, folds {folds}: expected above 0, and 1 or more")
    check_storable(detector)
    free = sum(not _collisions(trace) for trace in traces)
    with one_thread():
        if min(folds, free) < 2:
            own, rest = held_out(traces)
            fitted = detector.fit(own, arm)
            found = _free_scores(fitted, rest)
        else:
            found = _cross_fitted(detector, traces, arm, left_out(traces, min(folds, free)))
            fitted = detector.fit(traces, arm)
        alarm, scores = _with_rate(fitted, found, per_hour)
    text = traces[0].attachments.get("arm.xml")
    name = Path(traces[0].meta.get("arm", "cura6")).stem or "arm"
    robot = None if text is None else StoredRobot.of_text(f"{name}.xml", text)
    usual = UsualInput.of(traces, alarm.detector.arm)
    alarm = replace(alarm, inputs=usual, robot=robot)
    _check_usable(alarm, traces)
    return alarm, scores


def _check_usable(alarm: CollisionAlarm, traces: Sequence[Trace]) -> None:
    """Refuse a detector that no model file would be read with.

    A method of the user's own that cannot score a trace of bare signals is not judged here.

    Raises:
        ArgumentError: says how much motion it was trained on, and how much is needed.
    """
    detector = alarm.detector
    try:
        with np.errstate(all="ignore"):
            check_ranges(alarm)
            bare, _ = standing_then_hit(detector.arm, detector.dt, detector.settle)
            try:
                detector.scores(bare)
            except Exception:
                return
            check_alarms(alarm)
    except ArgumentError as error:
        free = [float(t.t[-1] - t.t[0]) for t in traces if not _collisions(t)]
        raise ArgumentError(
            f"the trained detector cannot be used: {error}; it was trained on {len(traces)} "
            f"recordings, {len(free)} of them without collisions ({sum(free):.0f} s): give two or "
            "more without collisions, better some minutes of such motion"
        ) from None


def train_beside(
    detector: Method,
    struck: Sequence[Trace],
    logs: Mapping[str, Trace],
    arm: ArmModel,
    per_hour: float,
) -> tuple[CollisionAlarm, list[FreeScores], Findings]:
    """Train a learned alarm that runs together with a free-motion detector.

    The threshold comes from the logs alone, because simulated noise differs. Each log, or each half
    of a single one, is scored by a detector and an arm model that were made without it. Few logs
    hardly show the tail of the scores. So the threshold exceeds all these scores, by a larger
    factor for fewer logs (:data:`UNLIKE`).

    Args:
        detector: settings of a method.
        struck: simulated traces with truth, with the arm's joint names.
        logs: collision-free and without a load, of the arm, by name.
        arm: calibrated from all logs.
        per_hour: accepted false alarms per hour of motion like the logs'.

    Returns:
        The alarm, the normalised scores that its threshold comes from, and notes for the user.

    Raises:
        ArgumentError: traces that do not fit, or too little motion.
    """
    check_storable(detector)
    parts = pieces([Recording(log) for log in logs.values()], 2)
    halved = len(parts) > len(logs)
    names = [f"half {k} of {name}" for name in logs for k in (1, 2)] if halved else list(logs)
    moving = [k for k, part in enumerate(parts) if moves(part.trace)]
    calibrated = Subsets(arm, [parts[k] for k in moving])
    found, notes = list[FreeScores](), list[Finding]()
    with one_thread():
        for fold in range(min(FOLDS, len(parts))):
            rest, without = [k for k in range(len(parts)) if k % FOLDS != fold], arm
            if (seconds := motion_length([parts[k] for k in rest])) >= LEAST:
                without = calibrated([place for place, k in enumerate(moving) if k in rest])
            else:
                text = (
                    f"{', '.join(names[fold::FOLDS])}: scored by the arm model calibrated with it, "
                    f"because the rest has {seconds:.1f} s of motion, expected {LEAST:g} s or more"
                )
                notes.append(note("too-short", text, *names[fold::FOLDS]))
            fitted = detector.fit([*struck, *(parts[k].trace for k in rest)], without)
            found += _free_scores(fitted, [part.trace for part in parts[fold::FOLDS]])
        found = [replace(scores, floor=None) for scores in found]
        whole = detector.fit([*struck, *logs.values()], arm)
        alarm, scores = _with_rate(whole, found, per_hour)
    beyond = max(1.0, 1 / (UNLIKE * (len(scores) + 1)))
    least = beyond * max(one.peak for one in scores)
    if least > alarm.threshold:
        kind = "halves of a log" if halved else "logs"
        few = "; it is high because there are few logs: add separate logs" if beyond > 1 else ""
        text = (
            f"the learned score's threshold is {beyond:.2g} times the highest score of "
            f"{len(scores)} {kind}, whatever `false_alarms_per_hour=`{few}"
        )
        notes.append(note("few-logs", text))
    return replace(alarm, threshold=max(alarm.threshold, least)), scores, Findings(notes)


def left_out(traces: Sequence[Trace], folds: int) -> list[set[int]]:
    """Indices of the traces of each fold of a cross-validation.

    All traces with the same load are in one fold, so that the threshold also holds for loads that
    the detector was not trained with. A fold that would contain all traces with collisions contains
    only its collision-free ones. If there are fewer loads than folds, the collision-free traces
    are distributed over the folds, whatever their load, and traces with collisions are in none.

    Args:
        traces: at least ``folds`` of them collision-free.
        folds: number of folds.
    """
    free = [i for i, t in enumerate(traces) if not _collisions(t)]
    struck = set(range(len(traces))) - set(free)
    loads = sorted({_load(traces[i]) for i in free})
    if len(loads) < folds:
        return [set(free[k::folds]) for k in range(folds)]
    parts = [{i for i, t in enumerate(traces) if _load(t) in loads[k::folds]} for k in range(folds)]
    return [part - struck if struck <= part else part for part in parts]


def _load(trace: Trace) -> float:
    """Mass of the heaviest load in a trace [kg]; 0 if unknown."""
    return float(trace.truth.payload.max(initial=0.0)) if trace.truth else 0.0


def _collisions(trace: Trace) -> int:
    return len(trace.truth.collisions) if trace.truth else 0


def _cross_fitted(
    detector: Method, traces: Sequence[Trace], arm: ArmModel, parts: Sequence[set[int]]
) -> list[FreeScores]:
    """Scores of each collision-free trace, by a detector that was trained without its fold."""
    found: list[FreeScores] = []
    for part in parts:
        own = [t for i, t in enumerate(traces) if i not in part]
        left = [traces[i] for i in sorted(part) if not _collisions(traces[i])]
        found += _free_scores(detector.fit(own, arm), left)
    return found


def with_rate(detector: FittedMethod, traces: Sequence[Trace], per_hour: float) -> CollisionAlarm:
    """The alarm of a fitted detector with a speed normalisation and a threshold for a rate.

    Args:
        detector: fitted.
        traces: traces that the detector was not trained on; only collision-free rows are used.
        per_hour: accepted false alarms per hour of such motion.

    Raises:
        ArgumentError: no collision-free motion, or ``per_hour`` not above 0.
    """
    return _with_rate(detector, _free_scores(detector, traces), per_hour)[0]


def _free_scores(detector: FittedMethod, traces: Sequence[Trace]) -> list[FreeScores]:
    """Scores of the collision-free rows, not yet normalised."""
    plain = CollisionAlarm(detector, np.inf, CONFIRMATION)
    return [plain.free_scores(trace) for trace in long_enough(plain, traces)]


def _with_rate(
    detector: FittedMethod, found: Sequence[FreeScores], per_hour: float
) -> tuple[CollisionAlarm, list[FreeScores]]:
    """Normalise the scores and choose the threshold from them."""
    alarm, scores = normalised(detector, found)
    return replace(alarm, threshold=threshold_for_rate(scores, per_hour)), scores


def normalised(
    detector: FittedMethod, found: Sequence[FreeScores]
) -> tuple[CollisionAlarm, list[FreeScores]]:
    """An alarm with infinite threshold, and the scores from which the threshold is chosen.

    Args:
        detector: fitted.
        found: scores of the detector in collision-free motion, not normalised.

    Returns:
        The alarm with its normalisation, and the normalised scores.
    """
    levels, floor = normalisations(found)
    alarm = CollisionAlarm(detector, np.inf, CONFIRMATION, levels, floor=floor)
    return alarm, [one.over(levels, floor) for one in found]


def with_guarantee(
    alarm: CollisionAlarm, traces: Sequence[Trace], per_hour: float, confidence: float = 0.95
) -> tuple[CollisionAlarm, Guarantee]:
    """The alarm with a threshold whose false alarm rate calibration episodes guarantee.

    Args:
        alarm: its threshold is replaced; its speed normalisation must not come from ``traces``.
        traces: collision-free motion episodes that the detector was not trained on.
        per_hour: accepted false alarms per hour.
        confidence: see :func:`~tauguard.detectors.thresholds.guarantee.guaranteed_threshold`.

    Raises:
        ArgumentError: an episode with collisions, or too few episodes for the guarantee.
    """
    for trace in traces:
        if count := _collisions(trace):
            raise ArgumentError(
                f"an episode with {count} collisions: calibration needs collision-free motion"
            )
    scores = [alarm.free_scores(trace) for trace in traces]
    guarantee = guaranteed_threshold(scores, per_hour, confidence)
    return replace(alarm, threshold=guarantee.threshold), guarantee


def long_enough(alarm: CollisionAlarm, traces: Sequence[Trace]) -> list[Trace]:
    """Traces that are longer than settling and confirmation time together.

    Raises:
        ArgumentError: there are none.
    """
    found = [t for t in traces if t.t[-1] - t.t[0] > alarm.settle + alarm.confirmation]
    if not found:
        raise ArgumentError(
            f"no collision-free motion after the {alarm.settle:g} s that {alarm.detector.name} "
            "needs to settle"
        )
    return found


def carrying(alarm: CollisionAlarm, load: Load) -> CollisionAlarm:
    """The alarm for the arm with a load in its gripper.

    Raises:
        ArgumentError: not a free-motion detector: other detectors cannot be given a load.
    """
    if not isinstance(alarm.detector, FittedFreeMotion | BesideFreeMotion):
        raise ArgumentError(
            f"{alarm.detector.name}: a load can be given only to free-motion detectors"
        )
    return replace(alarm, detector=alarm.detector.carrying(load))
