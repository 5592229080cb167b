"""Logs given as free of contacts, each judged by what the other logs show.

A contact in such a log raises the bounds, and contacts like it are then missed. So every log is
looked at under a calibration and bounds from the others. Its alarms are counted; a log that has far
more of them for its length than the others stands out.
"""

from __future__ import annotations

import functools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.calibration.identification import Subsets
from tauguard.detectors.calibration.recording import (
    UNKNOWN_LOAD,
    Recording,
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

#: Calibrations that leave logs out, at most: more logs than this are left out in groups.
TURNS = 12

#: A log stands out where so many alarms had this probability at the others' rate, for all logs
#: together. On three real arms the least of a free log is 0.14, the largest of a log with pushes
#: among free ones 1e-5.
CHANCE = 0.01

#: Median of a log's residual in motion over its bound, from which on it differs throughout, as with
#: a load that is not given (1.1 and 0.6 on two simulated arms; up to 0.5 of three arms' free logs).
THROUGHOUT = 0.8


#: Motion that is kept at least when logs are left out [s].
KEPT = 20.0


@dataclass(frozen=True)
class CrossValidatedLog:
    """A log under a calibration and bounds from the others."""

    name: str
    begin: float  #: its first time [s]
    seconds: float  #: its length
    alarms: tuple[Alarm, ...]  #: in the log's own time
    level: float  #: median of the largest residual over bound of joints in motion

    @property
    def throughout(self) -> bool:
        """Whether its torques differ from the others' all along, not now and then."""
        return self.level > THROUGHOUT


@dataclass(frozen=True)
class CrossValidation:
    """Which logs to learn from."""

    kept: tuple[CrossValidatedLog, ...]  #: each judged by the other kept ones
    left_out: tuple[CrossValidatedLog, ...]
    """That stood out, each judged by those that were left then."""
    accepted: tuple[CrossValidatedLog, ...]  #: kept ones that stand out but were vouched for


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
    """Every log's alarms under calibration and bounds from the others.

    One log alone is cut, and each part judged by the other parts.

    Where the others show too little motion to calibrate from, the calibration is that of all logs.

    Returns:
        In order.

    Raises:
        ValueError: all together show too little motion.
    """
    parts = dict(recordings)
    whole = [name for name, r in parts.items() if moves(r.trace)]
    owner = {name: name for name in parts}
    if len(whole) == 1:
        cuts = pieces([parts.pop(whole[0])], FOLDS)
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
            found = calibrated(use)
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
