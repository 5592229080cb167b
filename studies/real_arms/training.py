"""How much training an arm needs: false alarms and the smallest push found, by its seconds.

Every arm's logs are parted: two thirds to train with, a third to judge; for real arms in turn.
Simulated arms have drawn masses, friction, temperatures and sample rates; nothing was chosen on
them. Pushes are added to the judged logs as joint torques, at random moments and in random
directions, and grow until they are found.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from studies.real_arms.arms import available, nominal, recordings, thinned
from tauguard.detectors import ArmModel, RobotNumbers, poisson_rate
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.calibration.recording import Recording, cut
from tauguard.detectors.diagnosis.contact_force import link_poses, point_jacobians
from tauguard.detectors.evaluation.semi_real import Added, add_contact
from tauguard.detectors.events import SERIES, find_alarms
from tauguard.detectors.features.free_bound import SLOW
from tauguard.detectors.scores.free_motion import CONFIRMATION, FittedFreeMotion, FreeMotion
from tauguard.envs import Episode, simulate
from tauguard.models import Mismatch, cura6, load_arm, pin_model
from tauguard.report import Row
from tauguard.traces import Trace

Array = NDArray[np.float64]

NOTES = {
    "trained with": "false alarms in logs left out; median force at the tool that is found within "
    "0.4 s, pushes added to those logs at moments and in directions drawn at random.",
}
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
#: A push lasts so long [s]; the detector sees the log from so long before it [s].
LASTS, BEFORE = 0.4, 4.0
#: A standing arm has stood for so long [s]; a moving one has a joint above this speed [rad/s].
STOOD, MOVING = 1.0, 0.1
#: Forces that are tried [N]; found to this factor.
WEAKEST, STRONGEST, STEPS = 2.0, 500.0, 6
#: Sample intervals [s]: 100 to 1000 Hz.
INTERVALS = (10e-3, 8e-3, 4e-3, 2e-3, 1e-3)
#: Length of one log [s].
LENGTH = 30.0


def measure(quick: bool, seed: int) -> list[Row]:
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
    name: str, start: ArmModel, logs: Mapping[str, Recording], seconds: float, turns: int, seed: int
) -> Row:
    length = seconds if np.isfinite(seconds) else "all"
    row: Row = {"study": "trained with", "arm": name, "seconds": length}
    alarms, judged, standing, moving = 0, 0.0, [], []
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
            trace, load = recording.trace, recording.load
            known = fitted if load is None else fitted.carrying(load)
            up = CollisionAlarm(known, 1.0, CONFIRMATION).detect(trace).alarm
            alarms += len(find_alarms(trace.t, up, SERIES))
            judged += float(trace.t[-1] - trace.t[0])
            standing += smallest_pushes(known, trace, False, MOMENTS, rng)
            moving += smallest_pushes(known, trace, True, MOMENTS, rng)
    if not judged:
        return row
    rate = poisson_rate(alarms, judged / 3600)
    return row | {
        "minutes": judged / 60,
        "false alarms": alarms,
        "per hour at most": rate["high"],
        "standing N": float(np.median(standing)) if standing else None,
        "moving N": float(np.median(moving)) if moving else None,
        "pushes": len(standing) + len(moving),
    }


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


def drawn_arm(seed: int, count: int) -> tuple[ArmModel, dict[str, Recording]]:
    """What the user of a drawn arm believes, and collision-free logs of it by name.

    The file is up to 30 % wrong in masses, 3 cm in centres, 8 % in the gains.
    Successive seeds take the sizes and the sample rates in turn; each log is as long as
    :data:`LENGTH`.
    """
    rng = np.random.default_rng([seed, 2])
    name = cura6.NAMES[seed % len(cura6.NAMES)]
    level = float(rng.uniform(0.3, 0.8))
    mismatch = Mismatch(
        seed, mass=0.3, com=0.03, inertia=0.3, gain=0.08, coulomb=level, viscous=level
    )
    recordings = {}
    for k in range(count):
        episode = Episode(
            seed=1000 * seed + k,
            seconds=LENGTH,
            speed=float(rng.uniform(10, 60)),
            mismatch=mismatch,
            temperature=float(rng.uniform(25, 40)),
            arm=name,
        )
        trace = simulate(episode)
        recordings[f"log_{k}"] = Recording(thinned(trace, 1 / INTERVALS[seed % len(INTERVALS)]))
    robot = RobotNumbers.from_pin(pin_model(cura6.arm_xml(name)))
    return ArmModel(robot, load_arm(name).facts.drive.gain), recordings


def smallest_pushes(
    fitted: FittedFreeMotion, trace: Trace, moving: bool, count: int, rng: np.random.Generator
) -> list[float]:
    """Forces [N] that are just found, at moments and in directions drawn at random.

    ``inf``: even the strongest is missed. Moments at which the detector alarms by itself, and
    directions that hardly turn any joint, are passed over.
    """
    alarm = CollisionAlarm(fitted, 1.0, CONFIRMATION)
    found = []
    for at in _moments(trace, moving, count, rng):
        torque = _per_newton(fitted, trace.q[at], rng)
        start, dt = trace.t[at], trace.dt
        part = cut(trace, slice(at - round(BEFORE / dt), at + round(1.2 * LASTS / dt)))

        def alarms(
            force: float, part: Trace = part, start: float = start, torque: Array = torque
        ) -> bool:
            push = Added(start, LASTS, tuple(force * torque), "push")
            up = alarm.detect(add_contact(part, fitted.arm.drive_gain, push)).alarm
            return bool(up[part.t >= start].any())

        if alarms(0.0) or np.abs(torque).max() < 0.05:
            continue
        low, high = WEAKEST, STRONGEST
        if not alarms(high):
            found.append(np.inf)
            continue
        for _ in range(STEPS):
            middle = float(np.sqrt(low * high))
            low, high = (low, middle) if alarms(middle) else (middle, high)
        found.append(high)
    return found


def _moments(trace: Trace, moving: bool, count: int, rng: np.random.Generator) -> list[int]:
    """Rows at which a push may begin."""
    speed, dt = np.abs(trace.qd).max(axis=1), trace.dt
    fits = speed > MOVING if moving else speed < SLOW
    before = 0 if moving else round(STOOD / dt)
    lasting = round(LASTS / dt)
    first, last = round((BEFORE + 0.5) / dt), len(speed) - round(1.5 * LASTS / dt)
    sums = np.concatenate([[0], np.cumsum(fits)])
    rows = np.arange(max(first, before), max(last, 0))
    through = sums[rows + lasting] - sums[rows - before] == lasting + before
    allowed = rows[through]
    return [int(row) for row in rng.permutation(allowed)[:count]]


def _per_newton(fitted: FittedFreeMotion, q: Array, rng: np.random.Generator) -> Array:
    """Joint torques of 1 N at the last link's origin in a random direction, shape (n,)."""
    robot = fitted.arm.robot
    direction = rng.standard_normal(3)
    placed = link_poses(robot, q)
    last = np.array([robot.joints - 1])
    jacobian = point_jacobians(robot, placed, last, placed.origin[-1:])[0]
    torque: Array = (direction / np.linalg.norm(direction)) @ jacobian
    return torque


def draw(rows: list[Row], figure: Any) -> None:
    """The force that is found, arm by arm, over the seconds of training."""
    axes = figure.subplots()
    lengths = list(dict.fromkeys(str(row["seconds"]) for row in rows))
    for name in dict.fromkeys(row["arm"] for row in rows):
        own = [row for row in rows if row["arm"] == name and row.get("moving N") is not None]
        at = [lengths.index(str(row["seconds"])) for row in own]
        axes.plot(at, [row["moving N"] for row in own], "o-", label=name)
    axes.set_xticks(range(len(lengths)), lengths)
    axes.set(xlabel="seconds of training", ylabel="median force found in motion [N]", yscale="log")
    axes.legend(frameon=False)
