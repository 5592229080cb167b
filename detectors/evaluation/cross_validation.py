"""Cross-validation of logs that are given as free of contacts.

A contact in such a log raises the bounds, and similar contacts are then missed. So every log is
evaluated with a calibration and bounds from the other logs, and its alarms are counted. A log with
a far higher rate of alarms than the others stands out.
"""

from __future__ import annotations

import functools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.calibration.identification import Subsets
from tauguard.detectors.calibration.recording import (
    LEAST,
    UNKNOWN_LOAD,
    Recording,
    check_length,
    motion_length,
    moves,
    pieces,
)
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.events import SERIES, find_alarms
from tauguard.detectors.features.free_bound import (
    Bound,
    friction_levels,
    standing_positions,
)
from tauguard.detectors.scores.free_motion import (
    FOLDS,
    SETTLE,
    FittedFreeMotion,
    Judged,
    learned,
    standing_detector,
    with_load_of,
)
from tauguard.traces.trace import Alarm

#: Largest number of calibrations; more logs than this are left out in groups.
TURNS = 12

#: A log stands out if its number of alarms has less than this probability at the other logs' rate,
#: corrected for the number of logs. On three real arms the probability of a free log is at least
#: 0.14, and that of a log with pushes at most 1e-5.
CHANCE = 0.01

#: Least median of a log's residual in motion over its bound at which the log differs throughout, as
#: with an unknown load (1.1 and 0.6 on two simulated arms; up to 0.5 in free logs of three arms).
THROUGHOUT = 0.8


#: Least motion that remains when logs are left out [s].
KEPT = 20.0


@dataclass(frozen=True)
class CrossValidatedLog:
    """A log, evaluated with a calibration and bounds from the other logs."""

    name: str
    begin: float  #: its first time [s]
    seconds: float  #: its length [s]
    alarms: tuple[Alarm, ...]  #: in the log's own time
    level: float  #: median of the largest residual over bound of joints in motion

    @property
    def throughout(self) -> bool:
        """Whether its torques differ from the other logs' throughout."""
        return self.level > THROUGHOUT


@dataclass(frozen=True)
class CrossValidation:
    """The logs to learn from, and those that are left out."""

    kept: tuple[CrossValidatedLog, ...]  #: each evaluated by the other kept ones
    left_out: tuple[CrossValidatedLog, ...]
    """Logs that stood out, each evaluated by those that remained then."""
    accepted: tuple[CrossValidatedLog, ...]  #: logs that stand out and are kept on request


def cross_validate(
    recordings: Mapping[str, Recording], arm: ArmModel, accepted: Collection[str] = ()
) -> CrossValidation:
    """Leave out logs that stand out, one after the other, never more than half of them.

    Args:
        recordings: by name.
        arm: nominal numbers and drive gains.
        accepted: names that are kept in any case.
    """
    names, out = list(recordings), list[CrossValidatedLog]()
    least = min(KEPT, motion_length(list(recordings.values())))
    while True:
        judged = judge_logs({name: recordings[name] for name in names}, arm)
        odd = standing_out(judged)
        worst = next((log for log in odd if log.name not in accepted), None)
        rest = [recordings[n] for n in names if worst is None or n != worst.name]
        if worst is None or 2 * len(rest) < len(recordings) or motion_length(rest) < least:
            vouched = tuple(log for log in odd if log.name in accepted)
            return CrossValidation(tuple(judged), tuple(out), vouched)
        out.append(worst)
        names.remove(worst.name)


def standing_out(logs: Sequence[CrossValidatedLog]) -> list[CrossValidatedLog]:
    """The logs with far more alarms for their length than the others, the least likely first."""
    from scipy.stats import binom

    count = sum(len(log.alarms) for log in logs)
    seconds = sum(log.seconds for log in logs)
    if len(logs) < 2:
        return []
    chance = {
        log.name: float(binom.sf(len(log.alarms) - 1, count, log.seconds / seconds)) * len(logs)
        for log in logs
    }
    odd = [log for log in logs if chance[log.name] < CHANCE]
    return sorted(odd, key=lambda log: chance[log.name])


def judge_logs(recordings: Mapping[str, Recording], arm: ArmModel) -> list[CrossValidatedLog]:
    """Every log's alarms with calibration and bounds from the other logs.

    A single log is cut into parts, each of which is evaluated by the others. If the other logs have
    too little motion for a calibration, that of all logs is used.

    Returns:
        In order.

    Raises:
        ValueError: all together show too little motion.
    """
    parts = dict(recordings)
    whole = [name for name, r in parts.items() if moves(r.trace)]
    owner = {name: name for name in parts}
    if whole:
        check_length([recordings[name] for name in whole])
    if len(whole) == 1:
        only = [parts.pop(whole[0])]
        cuts = only if parts else pieces(only, 2, 0.0)  # at least one other part
        cuts = pieces(cuts, FOLDS)
        parts |= {f"{whole[0]} {k}": part for k, part in enumerate(cuts)}
        owner = {part: whole[0] if part not in recordings else part for part in parts}
    seen, found = _seen(list(parts.values()), arm), []
    for name, recording in recordings.items():
        own = [one for part, one in zip(parts, seen, strict=True) if owner[part] == name]
        alarms = tuple(alarm for one in own for alarm in one[0])
        t = recording.trace.t
        level = float(np.max([one[1] for one in own], initial=0.0))
        found.append(CrossValidatedLog(name, float(t[0]), float(t[-1] - t[0]), alarms, level))
    return found


def _seen(parts: Sequence[Recording], arm: ArmModel) -> list[tuple[tuple[Alarm, ...], float]]:
    """Alarms and level of each part, under calibration and bounds from the parts of other turns."""
    if not any(moves(part.trace) for part in parts):  # one bound for all, of their calmest pieces
        still = standing_detector(arm, parts)
        return [_alarms_and_level(with_load_of(part, still).judge(part.trace)) for part in parts]
    numbers = [k for k, part in enumerate(parts) if moves(part.trace)]
    moving = [parts[k] for k in numbers]
    turn = {k: place % TURNS for place, k in enumerate(numbers)}
    dt = max(part.trace.dt for part in parts)
    calibrated = Subsets(arm, moving)

    @functools.cache
    def without(left: int) -> FittedFreeMotion:
        use = [place for place in range(len(moving)) if place % TURNS != left]
        try:
            found = calibrated(use, 0.0 if left < 0 else LEAST)
        except ValueError:  # too little motion is left without the turn
            if left < 0:
                raise
            return without(-1)
        levels = friction_levels(found, [moving[place] for place in use])
        bound = Bound.prior(*levels, *standing_positions(parts))
        return FittedFreeMotion(found, dt, bound, UNKNOWN_LOAD, 0.0)

    judges = [without(turn.get(k, -1)) for k in range(len(parts))]
    first = [with_load_of(r, one).judge(r.trace) for r, one in zip(parts, judges, strict=True)]
    found = []
    for k, (part, judge) in enumerate(zip(parts, judges, strict=True)):
        left = turn.get(k, -1)  # a standing log is left out alone
        others = [one for i, one in enumerate(first) if turn.get(i, -2) != left and i != k]
        fresh = with_load_of(part, replace(judge, bound=learned(judge.bound, others)))
        found.append(_alarms_and_level(fresh.judge(part.trace)))
    return found


def _alarms_and_level(judged: Judged) -> tuple[tuple[Alarm, ...], float]:
    t, settled = judged.t, judged.t - judged.t[0] > SETTLE
    alarms = find_alarms(t, (judged.ratio.max(axis=1) > 1) & settled, SERIES)
    fraction: Array = np.where(judged.rest, 0.0, np.abs(judged.residual) / judged.bound).max(axis=1)
    rows = settled & ~judged.rest.all(axis=1)
    return alarms, float(np.median(fraction[rows])) if rows.any() else 0.0
