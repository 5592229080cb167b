"""Real arms: false alarms and pushes found, beside public observers on the same logs.

Each arm's collision-free logs are divided into folds. A detector judges each log after training on
the other folds, and gets the log's load if it is known. For logs with pushes a detector is trained
on all collision-free logs. For a Panda's touches it is trained on the untouched beginnings of the
other logs. An alarm finds a push if it begins at most 0.15 s before the push and before the peak of
the force (before the end of a labelled touch, or in the first 0.5 s of a push that lasts seconds).
``by chance`` is the number of pushes that the alarms find if a random time is added to all of them.

Our detector is compared with the observers of :mod:`studies.real_arms.observers`, which use our
calibration, and with Franka's estimate and the torque thresholds of libfranka's examples.

The results are optimistic: the constants of the bound were chosen on the logs of UR10e, UR5, UR3
and the Panda. On a new arm they are a little worse.
docs/notes/real_arms.md has the figures.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from studies.framework import draw_found, groups, table_rows
from studies.real_arms import detections, observers
from studies.real_arms.arms import ArmData, Push, Touched, available, nominal, recordings, touched
from tauguard.detectors import ArmModel, poisson_rate
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.calibration.recording import Recording
from tauguard.detectors.events import find_alarms
from tauguard.detectors.scores.free_motion import (
    CONFIRMATION,
    SETTLE,
    FittedFreeMotion,
    FreeMotion,
    with_load_of,
)
from tauguard.report import Row, rate
from tauguard.traces import Trace

Alarms = Callable[[Recording], NDArray[np.bool_]]

#: Time before the start of a push in which an alarm still finds it [s].
EARLY = 0.15
#: Time after a push in which an alarm belongs to it [s].
LATE = 0.5
#: Number of random shifts of a log's alarms, for ``by chance``.
SHIFTS = 200
#: Lower torque thresholds of libfranka's examples [N m].
FRANKA = np.array([20.0, 20.0, 18.0, 18.0, 16.0, 14.0, 12.0])
NOTES = {
    "pushes": "pushes that are found: an alarm starts between 0.15 s before the push and the "
    "peak of its force.",
    "false alarms": "per hour of collision-free logs that training has not seen, and of the "
    "untouched parts of logs with touches; 95 % interval.",
}


def table(rows: list[Row]) -> list[Row]:
    """Pushes found beside the arm's false alarms, then every arm's rate of false alarms."""
    rest = [row for row in rows if row["study"] != "pushes"]
    return [{"study": "pushes", **line} for line in detections(rows)] + rest


def draw(rows: list[Row], figure: Any) -> None:
    """Pushes found, by arm, state and detector."""
    own = groups(table_rows(rows, "pushes"), lambda row: f"{row['arm']}, {row['state']}")
    draw_found({k: {row["detector"]: row["found"] for row in v} for k, v in own.items()}, figure)


@dataclass
class Tally:
    """Results of one detector on one arm."""

    alarms: int = 0
    seconds: float = 0.0
    delays: dict[bool, list[float]] = field(default_factory=lambda: {True: [], False: []})
    chance: dict[bool, float] = field(default_factory=lambda: {True: 0.0, False: 0.0})


#: Number of folds of the collision-free logs.
FOLDS = 6
#: Arms of a quick run: most pushes, least work.
QUICK = ("ur5", "panda_touch")


def measure(quick: bool, seed: int) -> list[Row]:
    """All rows, or one that says that the data are absent. A quick run judges no free log."""
    arms, rng = available(), np.random.default_rng(seed)
    found: list[Row] = []
    if not arms:
        found.append({"study": "real arm", "log": "no logs: set TAUGUARD_DATA to their folder"})
    arms = [arm for arm in arms if arm.name in QUICK] or arms if quick else arms
    for arm in tqdm(arms, desc="arms", unit="arm", disable=None):
        tallies = arm_tallies(arm, 0 if quick else FOLDS, rng)
        rows = [row for how, tally in tallies.items() for row in _rows(arm.name, how, tally)]
        found += sorted(rows, key=lambda row: (str(row["study"]), str(row.get("state", ""))))
    return found


def arm_tallies(arm: ArmData, turns: int, rng: np.random.Generator) -> dict[str, Tally]:
    """Results of every detector on one arm, with ``turns`` folds held out one by one."""
    start, free, contact = nominal(arm), recordings(arm), touched(arm)
    tallies: dict[str, Tally] = {}

    def judge(by: Mapping[str, Alarms], log: Recording, known: tuple[Push, ...] | None) -> None:
        for how, alarms in by.items():
            count(tallies.setdefault(how, Tally()), alarms(log), log.trace, known, rng)

    names = list(free)
    for fold in range(min(turns, len(names) if arm.free else 0)):
        held = names[fold::FOLDS]
        by = detectors([r for n, r in free.items() if n not in held], start)
        for name in held:
            judge(by, free[name], None)
    whole = detectors(list(free.values()), start) if arm.free and contact else {}
    for name, one in list(contact.items())[: None if arm.free or turns > 1 else 1]:
        others = [r for n, r in free.items() if n != name]
        by = whole or detectors(others, start, standing=True) | franka(one)
        judge(by, one.recording, one.pushes)
    return tallies


def detectors(
    training: list[Recording], start: ArmModel, standing: bool = False
) -> dict[str, Alarms]:
    """Ours and the public observers, trained on some logs."""
    fitted: FittedFreeMotion = FreeMotion().fit(training, start)
    peers = observers.with_thresholds(fitted.arm, [r.trace for r in training], baseline=standing)

    def ours(log: Recording) -> NDArray[np.bool_]:
        return CollisionAlarm(with_load_of(log, fitted), 1.0, CONFIRMATION).detect(log.trace).alarm

    def of(name: str) -> Alarms:
        return lambda log: peers[name](with_load_of(log, fitted).arm, log.trace)

    return {"ours": ours} | {name: of(name) for name in peers}


def franka(one: Touched) -> dict[str, Alarms]:
    """Franka's own estimate, with the examples' thresholds and with thresholds from logs."""
    if one.own is None:
        return {}
    own = one.own - np.median(one.own[: one.quiet], axis=0)
    learned = observers.FACTOR * np.abs(own[: one.quiet]).max(axis=0)

    def above(limit: NDArray[np.float64]) -> Alarms:
        return lambda log: observers.alarms(own, limit, log.trace)

    return {"Franka's estimate, 12 to 20 N m": above(FRANKA), "Franka's estimate": above(learned)}


def count(
    tally: Tally,
    alarm: NDArray[np.bool_],
    trace: Trace,
    known: tuple[Push, ...] | None,
    rng: np.random.Generator,
) -> None:
    """Add a log: the delays of its pushes (inf: missed), or its false alarms.

    If every contact is labelled, alarms outside of them are false.
    """
    t = trace.t - trace.t[0]
    starts = np.array([one.start for one in find_alarms(t, alarm)])
    shifted = (starts + rng.uniform(0, t[-1], (SHIFTS, 1))) % t[-1]
    inside = np.zeros(len(starts), dtype=np.bool_)
    for push in known or ():
        begin = push.start - EARLY
        if push.start < SETTLE:
            continue
        hits = starts[(starts >= begin) & (starts <= push.peak)]
        inside |= (starts >= begin) & (starts <= push.peak + LATE)
        tally.delays[push.moving].append(float(hits[0] - push.start) if len(hits) else np.inf)
        lucky = ((shifted >= begin) & (shifted <= push.peak)).any(axis=1)
        tally.chance[push.moving] += float(lucky.mean())
    if known is None or all(push.labelled for push in known):
        tally.alarms += int((~inside).sum())
        tally.seconds += float(t[-1]) - sum(push.peak - push.start for push in known or ())


def _rows(arm: str, how: str, tally: Tally) -> list[Row]:
    per_hour = poisson_rate(tally.alarms, tally.seconds / 3600)
    row: Row = {"study": "false alarms", "arm": arm, "detector": how}
    row |= {"minutes": tally.seconds / 60, "alarms": tally.alarms, "per hour": per_hour["value"]}
    row |= {"at least": per_hour["low"], "at most": per_hour["high"]}
    rows = [row] if tally.seconds else []
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
