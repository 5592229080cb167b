"""Trained with little: false alarms and the smallest push found, by seconds of training.

Every arm's logs are parted: two thirds to train with, a third to judge; for real arms in turn.
Nothing was chosen on the simulated ones, which are drawn at random.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from studies.real_arms.arms import available, nominal, recordings
from studies.real_arms.simulated import drawn_arm
from studies.real_arms.smallest_push import smallest_pushes
from tauguard.detectors import ArmModel, poisson_rate
from tauguard.detectors.calibration.recording import Recording, cut
from tauguard.detectors.evaluation.events import find_alarms
from tauguard.detectors.methods.free_motion import CONFIRMATION, FittedFreeMotion, FreeMotion
from tauguard.detectors.thresholds.alarm import CollisionAlarm
from tauguard.detectors.thresholds.quiet_start import SERIES
from tauguard.report import Row

Array = NDArray[np.float64]

#: Seconds to train with; inf: all that there are.
SECONDS = (30.0, 120.0, np.inf)
#: Simulated arms, and logs of each.
ARMS, LOGS = 5, 12
#: Nothing shorter is added to a training [s].
LEAST = 1.0
#: Parts that the logs are dealt into.
PARTS = 3
#: Moments a log, standing and moving, at which pushes are tried.
MOMENTS = 2


def rows(quick: bool, seed: int) -> list[Row]:
    """A row an arm and a training length; quick: a real arm, a simulated one, one length."""
    found: list[Row] = []
    turns, lengths = (1, SECONDS[1:2]) if quick else (PARTS, SECONDS)
    for arm in available()[: 1 if quick else None]:
        start, logs = nominal(arm), recordings(arm, arm.free)
        found += [_row(arm.name, start, logs, seconds, turns, seed) for seconds in lengths]
    drawn = range(100 + ARMS * seed, 100 + ARMS * seed + (1 if quick else ARMS))
    for number in tqdm(drawn, desc="simulated", unit="arm", disable=None):
        start, logs = drawn_arm(number, 4 if quick else LOGS)
        name = f"simulated {number}"
        found += [_row(name, start, logs, seconds, 1, seed) for seconds in lengths]
    return found


def _row(
    name: str,
    start: ArmModel,
    logs: Mapping[str, Recording],
    seconds: float,
    turns: int,
    seed: int,
) -> Row:
    row: Row = {"study": "trained with", "arm": name, "seconds": seconds}
    if not np.isfinite(seconds):
        row["seconds"] = "all"
    alarms, watched, standing, moving = 0, 0.0, [], []
    rng = np.random.default_rng([seed, 7])
    for turn in range(turns):
        held = list(logs)[turn::PARTS]
        use = first_seconds([r for n, r in logs.items() if n not in held], seconds, rng)
        try:
            fitted = FreeMotion().fit(use, start)
        except ValueError as error:
            row["note"] = str(error)
            continue
        for log in held:
            recording = logs[log]
            trace, known = recording.trace, _told(fitted, recording)
            up = CollisionAlarm(known, 1.0, CONFIRMATION).detect(trace).alarm
            alarms += len(find_alarms(trace.t, up, SERIES))
            watched += float(trace.t[-1] - trace.t[0])
            standing += smallest_pushes(known, trace, False, MOMENTS, rng)
            moving += smallest_pushes(known, trace, True, MOMENTS, rng)
    if not watched:
        return row
    rate = poisson_rate(alarms, watched / 3600)
    return row | {
        "watched min": watched / 60,
        "false alarms": alarms,
        "per hour at most": rate["high"],
        "standing N": float(np.median(standing)) if standing else None,
        "moving N": float(np.median(moving)) if moving else None,
        "pushes": len(standing) + len(moving),
    }


def _told(fitted: FittedFreeMotion, recording: Recording) -> FittedFreeMotion:
    return fitted if recording.load is None else fitted.carrying(recording.load)


def first_seconds(
    logs: list[Recording], seconds: float, rng: np.random.Generator
) -> list[Recording]:
    """Logs in random order up to ``seconds`` in all; the last one is cut."""
    kept: list[Recording] = []
    left = seconds
    for k in rng.permutation(len(logs)):
        if left < LEAST:
            break
        trace = logs[k].trace
        length = float(trace.t[-1] - trace.t[0])
        if length > left + 1e-6:
            rows = int(np.searchsorted(trace.t, trace.t[0] + left))
            kept.append(Recording(cut(trace, slice(None, rows)), logs[k].load))
            break
        kept.append(logs[k])
        left -= length
    return kept
