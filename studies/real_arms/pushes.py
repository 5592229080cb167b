"""Real arms: false alarms and pushes found, beside three simple rules on the same logs.

Each arm's collision-free logs are dealt into folds; a detector trained on the others judges each
log, with its load if that is known. Logs with pushes are judged by a detector trained on all
collision-free logs. A push is found by an alarm between 0.15 s before its start and the peak of its
force. ``by chance`` is what the same alarms find when all are shifted by a random time.

The rules: ``plain observer``, thresholds of 1.5 times the largest residual of a log's first 4 s,
with the gains of the preset and no friction; ``1 A`` and ``10 N m``, a fixed threshold on what the
same calibration as ours leaves, in amperes at the motor and in torque at the joint.

What is optimistic: the constants of the bound were chosen on these logs of all three real arms. A
fresh arm does a little worse.
docs/notes/2026-11-23-real-arms.md lists what was compared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from studies.real_arms.arms import ArmData, Push, available, nominal, pushes, recordings
from tauguard.detectors import ArmModel, poisson_rate
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.calibration.recording import Recording
from tauguard.detectors.estimation.estimator import Estimator, Unknowns
from tauguard.detectors.estimation.observer import LOG_GAIN, observe
from tauguard.detectors.events import SERIES, confirmation_samples, confirmed, find_alarms
from tauguard.detectors.scores.free_motion import CONFIRMATION, FittedFreeMotion, FreeMotion
from tauguard.report import Row, rate
from tauguard.traces import Trace

Array = NDArray[np.float64]
Alarms = Callable[[Trace], NDArray[np.bool_]]

#: An alarm so long before the start of a push still finds it [s].
EARLY = 0.15
#: Random shifts of a log's alarms, for ``by chance``.
SHIFTS = 200
#: Seconds from which the plain observer learns, threshold over the largest residual in them, and
#: its confirmation [s].
QUIET, FACTOR, PLAIN_CONFIRMATION = 4.0, 1.5, 0.05
#: Confirmation of the fixed thresholds [s].
FIXED_CONFIRMATION = 0.04
NOTES = {
    "pushes": "found of pushes by an alarm from 0.15 s before the start to the peak of the force.",
    "false alarms": "per hour of collision-free logs that training has not seen; the plain "
    "observer is not judged in the 4 s that it learns from.",
}


@dataclass
class Tally:
    """What one detector did on one arm."""

    alarms: int = 0
    seconds: float = 0.0
    delays: dict[bool, list[float]] = field(default_factory=lambda: {True: [], False: []})
    chance: dict[bool, float] = field(default_factory=lambda: {True: 0.0, False: 0.0})


def measure(quick: bool, seed: int) -> list[Row]:
    """All rows; one that says so where the data are absent."""
    arms = available()
    found: list[Row] = []
    if not arms:
        found.append({"study": "real arm", "log": "no logs: set TAUGUARD_DATA to their folder"})
    for arm in tqdm(arms, desc="arms", unit="arm", disable=None):
        found += arm_rows(arm, 6, 1 if quick else 6, np.random.default_rng(seed))
    return found


def arm_rows(arm: ArmData, folds: int, turns: int, rng: np.random.Generator) -> list[Row]:
    """The rows of one arm; of its ``folds`` of free logs, so many ``turns`` are left out."""
    start, free = nominal(arm), recordings(arm, arm.free)
    contact = recordings(arm, ("contact",))
    tallies: dict[str, Tally] = {}
    names = list(free)
    for fold in range(min(turns, len(names))):
        held = names[fold::folds]
        fitted = FreeMotion().fit([r for n, r in free.items() if n not in held], start)
        for name in held:
            for how, alarms in detectors(fitted, start, free[name]).items():
                count(tallies.setdefault(how, Tally()), how, alarms, free[name].trace)
    if contact:
        fitted = FreeMotion().fit(list(free.values()), start)
    for name, recording in contact.items():
        known = pushes(arm, name)
        for how, alarms in detectors(fitted, start, recording).items():
            find(tallies[how], alarms, recording.trace, known, rng)
    found = [row for how, tally in tallies.items() for row in _rows(arm.name, how, tally)]
    return sorted(found, key=lambda row: (str(row["study"]), str(row.get("state", ""))))


def detectors(fitted: FittedFreeMotion, start: ArmModel, recording: Recording) -> dict[str, Alarms]:
    """Ours and the rules, for one log."""
    ours = fitted if recording.load is None else fitted.carrying(recording.load)
    alarm = CollisionAlarm(ours, 1.0, CONFIRMATION)

    def plain(trace: Trace) -> NDArray[np.bool_]:
        tau, time = trace.current * start.drive_gain, trace.t - trace.t[0]
        size = np.abs(observe(start.robot, trace.t, trace.q, trace.qd, tau, LOG_GAIN))
        learned = (time >= 3 / LOG_GAIN) & (time < QUIET)
        above = (size > FACTOR * size[learned].max(axis=0)).any(axis=1) & (time >= QUIET)
        return confirmed(above, confirmation_samples(PLAIN_CONFIRMATION, trace.dt))

    def fixed(threshold: Array) -> Alarms:
        def alarms(trace: Trace) -> NDArray[np.bool_]:
            estimator = Estimator(ours.arm, 20.0, trace.dt, Unknowns.none())
            left = estimator.run(trace.t, trace.q, trace.qd, trace.current).residual
            above = (np.abs(left) > threshold).any(axis=1) & (trace.t > trace.t[0] + 0.5)
            return confirmed(above, confirmation_samples(FIXED_CONFIRMATION, trace.dt))

        return alarms

    ampere = np.where(start.drive_gain == 1, 10.0, np.abs(start.drive_gain))
    return {
        "ours": lambda trace: alarm.detect(trace).alarm,
        "plain observer": plain,
        "1 A": fixed(ampere),
        "10 N m": fixed(np.full(len(ampere), 10.0)),
    }


def count(tally: Tally, how: str, alarms: Alarms, trace: Trace) -> None:
    """Adds the false alarms of a collision-free log."""
    learned = QUIET if how == "plain observer" else 0.0
    tally.alarms += len(find_alarms(trace.t, alarms(trace), SERIES))
    tally.seconds += max(float(trace.t[-1] - trace.t[0]) - learned, 0.0)


def find(
    tally: Tally, alarms: Alarms, trace: Trace, known: tuple[Push, ...], rng: np.random.Generator
) -> None:
    """Adds the pushes of a log: each one's delay, inf where it is missed."""
    t = trace.t - trace.t[0]
    starts = np.array([alarm.start for alarm in find_alarms(t, alarms(trace), SERIES)])
    shifted = (starts + rng.uniform(0, t[-1], (SHIFTS, 1))) % t[-1]
    for push in known:
        begin = push.start - EARLY
        hits = starts[(starts >= begin) & (starts <= push.peak)]
        tally.delays[push.moving].append(float(hits[0] - push.start) if len(hits) else np.inf)
        lucky = ((shifted >= begin) & (shifted <= push.peak)).any(axis=1)
        tally.chance[push.moving] += float(lucky.mean())


def _rows(arm: str, how: str, tally: Tally) -> list[Row]:
    per_hour = poisson_rate(tally.alarms, tally.seconds / 3600)
    row: Row = {"study": "false alarms", "arm": arm, "detector": how}
    row |= {"minutes": tally.seconds / 60, "alarms": tally.alarms, "per hour": per_hour["value"]}
    rows = [row | {"at least": per_hour["low"], "at most": per_hour["high"]}]
    for moving, delays in tally.delays.items():
        found = [delay for delay in delays if np.isfinite(delay)]
        if delays:
            state = "moving" if moving else "standing"
            row = {"study": "pushes", "arm": arm, "state": state, "detector": how}
            row["found"] = rate(len(found), len(delays))
            row["by chance"] = tally.chance[moving] / len(delays)
            row["median delay ms"] = 1e3 * float(np.median(found)) if found else None
            rows.append(row)
    return rows


def draw(rows: list[Row], figure: Any) -> None:
    """False alarms per hour, and pushes found, of each detector."""
    axes = figure.subplots(1, 2)
    for axis, study in zip(axes, ("false alarms", "pushes"), strict=True):
        own = [row for row in rows if row["study"] == study]
        for k, row in enumerate(own):
            value = row["per hour"] if study == "false alarms" else row["found"]["value"]
            axis.barh(k, value, color="C0" if row["detector"] == "ours" else "0.75")
        names = [f"{r['arm']} {r.get('state', '')} {r['detector']}" for r in own]
        axis.set_yticks(range(len(own)), names, fontsize=7)
        axis.invert_yaxis()
        axis.spines[["top", "right"]].set_visible(False)
        axis.set_xlabel("false alarms per hour" if study == "false alarms" else "share found")
