"""How much training an arm needs: false alarms by its seconds, beside what its own logs promise.

Every arm's logs are parted: two thirds to train with, a third to judge; for real arms in turn.
Simulated arms have drawn masses, friction, temperatures and sample rates; nothing was chosen on
them. ``own alarms`` are those of the training's logs, each left out in turn, as the card counts
them; both rates an hour are 95 % intervals.
"""

from collections.abc import Mapping

import numpy as np
from tqdm import tqdm

from studies.real_arms.arms import available, nominal, recordings, thinned
from tauguard.detectors import ArmModel, RobotNumbers, poisson_rate
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.calibration.recording import Recording, cut
from tauguard.detectors.evaluation.cross_validation import judge_logs
from tauguard.detectors.events import SERIES, find_alarms
from tauguard.detectors.scores.free_motion import CONFIRMATION, FreeMotion, with_load_of
from tauguard.envs import Episode, simulate
from tauguard.models import Mismatch, cura6, load_arm, pin_model
from tauguard.report import Row

NOTES = {
    "trained with": "false alarms in logs left out, and alarms of the training's own logs as the "
    "card counts them; 95 % intervals.",
}
#: Seconds to train with; inf: all that there are.
SECONDS = (30.0, 90.0, np.inf)
#: Simulated arms, and logs of each.
ARMS, LOGS = 5, 12
#: Nothing shorter is added to a training [s].
LEAST = 1.0
#: Parts that the logs are dealt into.
PARTS = 3
#: Sample intervals [s]: 100 to 1000 Hz.
INTERVALS = (10e-3, 8e-3, 4e-3, 2e-3, 1e-3)
#: Length of one log [s].
LENGTH = 30.0


def measure(quick: bool, seed: int) -> list[Row]:
    """A row an arm and a training length; quick: a real arm, a simulated one, one length."""
    found: list[Row] = []
    turns, lengths = (1, SECONDS[1:2]) if quick else (PARTS, SECONDS)
    for arm in [one for one in available() if one.free][: 1 if quick else None]:
        start, logs = nominal(arm), recordings(arm)
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
    found, promised = np.zeros(2), np.zeros(2)  # alarms, hours
    rng = np.random.default_rng([seed, 7])
    for turn in range(turns):
        held = list(logs)[turn::PARTS]
        use = first_seconds([r for n, r in logs.items() if n not in held], seconds, rng)
        try:
            fitted = FreeMotion().fit(use, start)
        except ValueError as error:
            row["note"] = str(error)
            continue
        for log in judge_logs({str(k): r for k, r in enumerate(use)}, start):
            promised += len(log.alarms), log.seconds / 3600
        for recording in (logs[log] for log in held):
            trace = recording.trace
            known = with_load_of(recording, fitted)
            up = CollisionAlarm(known, 1.0, CONFIRMATION).detect(trace).alarm
            hours = float(trace.t[-1] - trace.t[0]) / 3600
            found += len(find_alarms(trace.t, up, SERIES)), hours
    for said, (alarms, hours) in (("false alarms", found), ("own alarms", promised)):
        if hours:
            rate = poisson_rate(int(alarms), hours)
            row |= {said: int(alarms), f"{said}: minutes": 60 * hours}
            row |= {f"{said}: per hour": f"{rate['low']:.0f} to {rate['high']:.0f}"}
    return row


def first_seconds(
    logs: list[Recording], seconds: float, rng: np.random.Generator
) -> list[Recording]:
    """Logs in random order up to ``seconds`` in all; the last one is cut."""
    kept: list[Recording] = []
    left = seconds
    for k in rng.permutation(len(logs)):
        trace = logs[k].trace
        if left >= LEAST:
            rows = int(np.searchsorted(trace.t, trace.t[0] + left + 1e-6))
            kept.append(Recording(cut(trace, slice(None, rows)), logs[k].load))
        left -= float(trace.t[-1] - trace.t[0])
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
