"""Alarms of every method, setting and knob on every log of the benchmark.

A trial trains the methods on logs of one arm and runs them on other logs: each collision-free log
is in one of six folds, which the others train for; a log with contacts is judged after training on
all collision-free logs but the run of its program. The Panda has none, so that the untouched
beginnings of its other logs train.

For the choice of settings, every collision-free log is judged a second time with torques added: a
half sine of 0.3 s every 2.5 s, at one joint after the other.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from studies.real_arms.methods import METHODS, Method, Training, own
from tauguard.arrays import Array
from tauguard.benchmark.arms import ARMS, Arm, arm_named, initial_arm, is_there, logs
from tauguard.benchmark.judging import SETTLE
from tauguard.detectors import ArmModel
from tauguard.detectors.events import confirmation_samples, confirmed, find_alarms
from tauguard.findings import ArgumentError
from tauguard.traces import Alarm, Trace
from tauguard.traces.logs import Log, Recording, cut

#: Time above the knob until an alarm [s].
CONFIRMED = 0.04
#: The knobs. 1 is the threshold that a method learns.
KNOBS = tuple(sorted({*np.round(np.geomspace(0.2, 8, 75), 4).tolist(), 1.0}))
FOLDS = 6
#: Shortest untouched beginning of a log that trains [s], and time left out before the first touch.
SHORTEST, BEFORE = 1.2, 0.1
#: Torques added for the choice of settings [N m]: at the first three joints, and at the others.
PULSES, PULSE, EVERY = (15.0, 5.0), 0.3, 2.5


@dataclass(frozen=True)
class Trial:
    """One training and the logs that are judged with it."""

    arm: str
    judged: tuple[str, ...]  #: names of logs
    contact: bool  #: whether they have contacts
    methods: tuple[str, ...]  #: names, or a user's ``module:Class``


@dataclass(frozen=True)
class Run:
    """One method with one setting on one log, at every knob."""

    arm: str
    log: str
    contact: bool
    method: str
    setting: float
    alarms: tuple[Array, ...]  #: start and end of each alarm [s], shape (K, 2), for each knob
    pulses: tuple[int, ...] = ()  #: number of added torques found, for each knob
    added: int = 0  #: number of added torques


def trials(methods: Sequence[str], arms: Iterable[str]) -> list[Trial]:
    """The trials of the arms whose logs are in the data folder."""
    jobs = []
    for arm in map(arm_named, arms):
        if not is_there(arm) or not is_there(arm_named(arm.trained_on or arm.name)):
            continue
        free = [log.name for log, _ in logs(arm.name, "free")]
        folds = 1 if arm.trained_on else FOLDS
        held = [tuple(free[fold::folds]) for fold in range(min(folds, len(free)))]
        touched = [log.name for log, contacts in logs(arm.name, "contact") if contacts]
        groups: dict[str, list[str]] = {}
        for name in touched:
            alone = name if not arm.free else arm.same_program.get(name, "")
            groups.setdefault(alone, []).append(name)
        jobs += [Trial(arm.name, names, False, tuple(methods)) for names in held]
        jobs += [Trial(arm.name, tuple(names), True, tuple(methods)) for names in groups.values()]
    return jobs


def run(trial: Trial) -> list[Run]:
    """Run a trial, in one thread, so that results do not depend on the number of processors."""
    with threadpool_limits(1):
        return list(_runs(trial))


def _runs(trial: Trial) -> Iterator[Run]:
    arm = ARMS[trial.arm]
    source = ARMS[arm.trained_on] if arm.trained_on else arm
    leave = set(trial.judged) | {arm.same_program.get(name, "") for name in trial.judged}
    training = Training(
        [log for name, log in training_logs(source).items() if name not in leave],
        initial_arm(source),
        standing=not source.free,
    )
    part = logs(arm.name, "contact" if trial.contact else "free")
    judged = [log for log, _ in part if log.name in trial.judged]
    pulsed = [] if trial.contact else [with_pulses(log, training.start) for log in judged]
    for name in trial.methods:
        method = METHODS.get(name) or Method(name, "yours", "yours", own(name))
        for setting in method.settings:
            try:
                score = method.fit(training, setting)
            except ArgumentError:  # too little motion, as on the Panda, which only stands
                continue
            for k, log in enumerate(judged):
                alarms = at_knobs(log.trace, score(log))
                one = Run(arm.name, log.name, trial.contact, name, setting, alarms)
                if pulsed:
                    changed, onsets = pulsed[k]
                    hits = [_found(a, onsets) for a in at_knobs(changed.trace, score(changed))]
                    one = replace(one, pulses=tuple(hits), added=len(onsets))
                yield one


def training_logs(arm: Arm) -> dict[str, Recording]:
    """Collision-free logs by name; without any, the untouched beginnings of the others."""
    if arm.free:
        return {log.name: log for log, _ in logs(arm.name, "free")}
    found: dict[str, Recording] = {}
    for log, contacts in logs(arm.name, "contact"):
        t = log.trace.t
        rows = int(np.searchsorted(t, contacts[0].onset - BEFORE))
        if contacts[0].onset - t[0] > SHORTEST:
            found[log.name] = Recording(cut(log.trace, slice(None, rows)), log.load)
    return found


def at_knobs(trace: Trace, score: Array) -> tuple[Array, ...]:
    """The alarms of a score at every knob, shape (K, 2) each."""
    settled = trace.t - trace.t[0] > SETTLE
    samples = confirmation_samples(CONFIRMED, trace.dt)
    found = []
    for knob in KNOBS:
        up = confirmed((score > knob) & settled, samples)
        alarms = find_alarms(trace.t, up)
        found.append(np.array([(a.start, a.end) for a in alarms]).reshape(-1, 2))
    return tuple(found)


def alarms_of(array: Array) -> list[Alarm]:
    """The alarms of one knob."""
    return [Alarm(start, end) for start, end in array.tolist()]


def with_pulses(log: Log, start: ArmModel) -> tuple[Recording, Array]:
    """The log with torques added to its currents, and their onsets [s]."""
    trace, n = log.trace, start.robot.joints
    onsets = np.arange(trace.t[0] + 2.0, trace.t[-1] - 1.0, EVERY)
    added = np.zeros_like(trace.current)
    for k, onset in enumerate(onsets):
        phase = (trace.t - onset) / PULSE
        size = PULSES[0 if k % n < 3 else 1] * (1 if (k // n) % 2 else -1)
        added[:, k % n] += np.where((phase > 0) & (phase < 1), size * np.sin(np.pi * phase), 0.0)
    changed = replace(trace, current=trace.current + added / start.drive_gain)
    return Recording(changed, log.load), onsets


def _found(alarms: Array, onsets: Array) -> int:
    """Number of onsets after which an alarm starts within the rule's window of 0.5 s."""
    starts = np.append(alarms[:, 0], np.inf)
    first = starts[np.searchsorted(starts, onsets)]
    return int((first <= onsets + 0.5).sum())
