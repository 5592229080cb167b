"""The arms of the fault study, each with a detector and logs that did not train it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from tauguard.benchmark.arms import ARMS, files, initial_arm, is_there
from tauguard.benchmark.arms import logs as logs_of
from tauguard.datasets.plans import free_episodes, struck_episodes
from tauguard.detectors import CollisionAlarm, make_detector
from tauguard.detectors.alarms.training import train
from tauguard.detectors.calibration.nominal import nominal_design
from tauguard.detectors.faults.inputs import UsualInput
from tauguard.detectors.scores.free_motion import CONFIRMATION, FreeMotion
from tauguard.envs import simulate
from tauguard.models import Mismatch
from tauguard.traces.resample import resampled
from tauguard.traces.trace import Trace

#: Samples of a simulation that are kept [Hz].
RATE = 500.0
#: One in this many collision-free logs of a real arm is left out of training.
LEFT_OUT = 3


def thinned(trace: Trace, rate: float) -> Trace:
    """The trace at ``rate`` [Hz], without truth."""
    return replace(resampled(trace, rate), truth=None)


def trained(traces: Sequence[Trace], rate: float, per_hour: float) -> CollisionAlarm:
    """Train a detector from collision-free motion at ``rate`` [Hz], which takes seconds."""
    own = [thinned(trace, rate) for trace in traces]
    return train(make_detector("moving-thresholds"), own, nominal_design(), per_hour)


@dataclass(frozen=True)
class ArmLogs:
    """A trained detector, and logs that were used neither for it nor for its fault checks."""

    name: str
    alarm: CollisionAlarm
    logs: dict[str, Trace]
    contacts: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    """Onset and end [s] of each contact of a log, where the truth is known."""

    @cached_property
    def alarms(self) -> dict[str, list[float]]:
        """Times at which alarms begin in each log, by the log's clock [s]."""
        return {
            name: [float(alarm.start) for alarm in self.alarm.detect(trace).alarms]
            for name, trace in self.logs.items()
        }


def arms(quick: bool, seed: int) -> Iterator[ArmLogs]:
    """Yield the simulated arm and, unless ``quick``, the real arms whose logs are available."""
    yield simulated(quick, seed)
    if quick:
        return
    for arm in ARMS.values():
        if is_there(arm) and any("/free/" in pattern for pattern in arm.free) and not arm.blind:
            yield real(arm.name)


def simulated(quick: bool, seed: int) -> ArmLogs:
    """A CURA6 drawn by the seed, at 500 Hz; its logs have collisions and other loads."""
    drawn = Mismatch(seed=1000 + seed)
    speeds, loads = (20.0, 60.0), (0.0, 2000.0)
    free = free_episodes(seed, 3 if quick else 8, 20.0 if quick else 40.0, speeds, loads, drawn)
    struck = struck_episodes(500 + seed, 1 if quick else 4, 8, (40.0,), (0.0, 1000.0), drawn)
    alarm = trained([simulate(episode) for episode in free], RATE, 5.0)
    arm = ArmLogs("simulated", alarm, {})
    for k, trace in enumerate(map(simulate, struck)):
        assert trace.truth is not None
        arm.logs[f"struck_{k}"] = thinned(trace, RATE)
        arm.contacts[f"struck_{k}"] = [(c.onset, c.end) for c in trace.truth.collisions]
    return arm


def real(name: str) -> ArmLogs:
    """A real arm, trained on two thirds of its collision-free logs and tested on all others."""
    arm = ARMS[name]
    every = {log.name: log for log, _ in logs_of(name)}
    free = [path.stem for path in files(arm, "free") if path.parent.name == "free"]
    own = [log for k, log in enumerate(free) if k % LEFT_OUT]
    training = [every[log] for log in own]
    detector = FreeMotion().fit(training, initial_arm(arm))
    usual = UsualInput.of([r.trace for r in training], detector.arm)
    alarm = CollisionAlarm(detector, 1.0, CONFIRMATION, inputs=usual)
    return ArmLogs(name, alarm, {log: r.trace for log, r in every.items() if log not in own})
