"""Cross-validation of logs that are given as free of contacts.

A contact in a training log would raise the bounds, so that similar contacts are missed. So each log
is evaluated with a calibration and bounds from all other logs, and its alarms are counted. A log
stands out if its rate of alarms is far higher than that of all other logs.
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
from tauguard.detectors.events import find_alarms
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

#: Largest number of calibrations. More logs than this are held out in groups.
TURNS = 12

#: A log stands out if its number of alarms has a probability below this at the rate of all other
#: logs. The probability is corrected for the number of logs. On three real arms it is at least
#: 0.14 for a free log, and at most 1e-5 for a log with pushes.
CHANCE = 0.01

#: A log differs throughout, as with an unknown load, if the median ratio of residual to bound in
#: motion is above this. The ratio is 1.1 and 0.6 with a load on two simulated arms, and at most 0.5
#: in free logs of three arms.
THROUGHOUT = 0.8


#: Least motion that remains when logs are left out [s].
KEPT = 20.0


@dataclass(frozen=True)
class CrossValidatedLog:
    """A log, evaluated with a calibration and bounds from the other logs."""

    name: str
    begin: float  #: first time of the log [s]
    seconds: float  #: length of the log [s]
    alarms: tuple[Alarm, ...]  #: with times of the log
    level: float  #: median, over samples in motion, of the joints' largest ratio residual / bound

    @property
    def throughout(self) -> bool:
        """Whether the torques differ from those of all other logs throughout."""
        return self.level > THROUGHOUT


@dataclass(frozen=True)
class CrossValidation:
    """The logs for training, and the logs that are left out."""

    kept: tuple[CrossValidatedLog, ...]  #: each evaluated with all other kept logs
    left_out: tuple[CrossValidatedLog, ...]
    """Logs that stood out, each evaluated with the logs that were kept at that time."""
    accepted: tuple[CrossValidatedLog, ...]  #: logs that stand out and are kept on request


def cross_validate(
    recordings: Mapping[str, Recording], arm: ArmModel, accepted: Collection[str] = ()
) -> CrossValidation:
    """Leave out logs that stand out, one at a time, at most half of all logs.

    Args:
        recordings: by name.
        arm: nominal numbers and drive gains.
        accepted: names of logs that are always kept.
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
    """The logs whose rate of alarms is far above that of all other logs, least likely first."""
    from scipy.special import bdtrc  # scipy.stats loads for seconds

    count = sum(len(log.alarms) for log in logs)
    seconds = sum(log.seconds for log in logs)
    if len(logs) < 2:
        return []
    chance = {
        log.name: float(bdtrc(len(log.alarms) - 1, count, log.seconds / seconds)) * len(logs)
        for log in logs
    }
    odd = [log for log in logs if chance[log.name] < CHANCE]
    return sorted(odd, key=lambda log: chance[log.name])


def judge_logs(recordings: Mapping[str, Recording], arm: ArmModel) -> list[CrossValidatedLog]:
    """Evaluate each log with a calibration and bounds from all other logs.

    A single log is cut into parts, and each part is evaluated with all other parts. If the other
    logs have too little motion for a calibration, the calibration from all logs is used.

    Returns:
        The logs in their order.

    Raises:
        ValueError: all logs together have too little motion.
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
    """Alarms and level of each part, with calibration and bounds from parts of other folds."""
    if not any(moves(part.trace) for part in parts):  # one bound, from the calmest pieces of logs
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
        if left >= 0 and motion_length([moving[place] for place in use]) < LEAST:
            return without(-1)
        found = calibrated(use, 0.0 if left < 0 else LEAST)
        levels = friction_levels(found, [moving[place] for place in use])
        bound = Bound.prior(*levels, *standing_positions(parts))
        return FittedFreeMotion(found, dt, bound, UNKNOWN_LOAD, 0.0)

    judges = [without(turn.get(k, -1)) for k in range(len(parts))]
    first = [with_load_of(r, one).judge(r.trace) for r, one in zip(parts, judges, strict=True)]
    found = []
    for k, (part, judge) in enumerate(zip(parts, judges, strict=True)):
        left = turn.get(k, -1)  # -1: a log without motion has a fold of its own
        others = [one for i, one in enumerate(first) if turn.get(i, -2) != left and i != k]
        fresh = with_load_of(part, replace(judge, bound=learned(judge.bound, others)))
        found.append(_alarms_and_level(fresh.judge(part.trace)))
    return found


def _alarms_and_level(judged: Judged) -> tuple[tuple[Alarm, ...], float]:
    t, settled = judged.t, judged.t - judged.t[0] > SETTLE
    alarms = find_alarms(t, (judged.ratio.max(axis=1) > 1) & settled)
    fraction: Array = np.where(judged.rest, 0.0, np.abs(judged.residual) / judged.bound).max(axis=1)
    rows = settled & ~judged.rest.all(axis=1)
    return alarms, float(np.median(fraction[rows])) if rows.any() else 0.0
