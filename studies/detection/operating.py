"""Detectors of one arm at operating points: training, thresholds, and counted alarms.

Hours of motion at 1 kHz do not fit the memory: an episode is simulated, scored by every detector,
reduced to alarms at the operating points, and deleted.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np

from studies.detection.motions import CALIBRATE, Conditions, Struck, free_pool, stream
from tauguard.arrays import Array
from tauguard.datasets.plans import BEGIN, TRAINING_PAYLOADS
from tauguard.detectors import CollisionAlarm, FittedMethod, find_alarms, make_detector, match
from tauguard.detectors.alarms.training import normalised
from tauguard.detectors.calibration.nominal import nominal_design
from tauguard.detectors.evaluation.matching import Matching
from tauguard.detectors.thresholds.free_scores import FreeScores
from tauguard.detectors.thresholds.tail_model import tail_level, threshold_for_rate
from tauguard.envs import simulate
from tauguard.traces import Collision, Trace

#: The current-predicting network, whose specificity sets every detector's first two thresholds.
NETWORK = "current-network"
#: The dissertation's thresholds on the network's residual current [A].
AMPERES = (1.6, 2.0)
#: The third operating point: a rate of false alarms.
HOURLY = "hourly"
#: Fraction of the cases whose scores are the tail, which is extrapolated to rarer cases.
CASE_TAIL = 0.1

#: Collision-free scores by detector, one entry per episode.
Free = Mapping[str, Sequence[FreeScores]]


@dataclass(frozen=True)
class Operated:
    """A trained detector of one arm and its alarm at every operating point."""

    detector: FittedMethod
    alarms: Mapping[str, CollisionAlarm]

    @property
    def thresholds(self) -> dict[str, float]:
        """The alarm's threshold at each operating point."""
        return {point: alarm.threshold for point, alarm in self.alarms.items()}

    def sustained(self, trace: Trace) -> dict[str, Array]:
        """The score that each alarm compares with its threshold, (T,); -inf before it settles."""
        score, early = self.detector.scores(trace), trace.t - trace.t[0] < BEGIN
        known: dict[int, Array] = {}  # most points have the same score
        for alarm in self.alarms.values():
            if id(alarm.normalisation) not in known:
                level = known[id(alarm.normalisation)] = alarm.sustained(trace, score)
                level[early] = -np.inf
        return {point: known[id(alarm.normalisation)] for point, alarm in self.alarms.items()}


Fleet = Mapping[str, Operated]


def trained(
    traces: Sequence[Trace], names: Sequence[str], under: Conditions
) -> dict[str, FittedMethod]:
    """The detectors of one arm, trained on its slices."""
    robot = nominal_design(under.robot)
    return {name: make_detector(name).fit(traces, robot) for name in names}


def free_scores(detectors: Mapping[str, FittedMethod], trace: Trace) -> Free:
    """Every detector's scores over a collision-free trace."""
    plain = {name: CollisionAlarm(detector, np.inf) for name, detector in detectors.items()}
    return {name: [alarm.free_scores(trace)] for name, alarm in plain.items()}


def joined(parts: Sequence[Free]) -> Free:
    """Scores of all episodes of several traces, by detector."""
    return {name: [one for part in parts for one in part[name]] for name in parts[0]}


def calibration(job: tuple[int, int, Mapping[str, FittedMethod], float, float]) -> Free:
    """Scores of an arm's collision-free motion with the training payloads, at one speed [%]."""
    seed, arm, detectors, speed, hours = job
    under = Conditions(payloads=tuple(sorted(map(float, set(TRAINING_PAYLOADS)))))
    pool = free_pool(stream(seed, CALIBRATE), speed, (arm,), hours, under)
    return joined([free_scores(detectors, simulate(episode)) for _, episode in pool])


def expected(scores: Sequence[FreeScores], threshold: float) -> float:
    """Expected fraction of cases above ``threshold``, from the counts and Jeffreys' prior."""
    cases = np.concatenate([one.cases() for one in scores])
    return (float(np.sum(cases > threshold)) + 0.5) / (len(cases) + 1)


def at_fraction(scores: Sequence[FreeScores], fraction: float) -> float:
    """The threshold that a ``fraction`` of the cases is expected to exceed, by a tail model."""
    ordered = np.sort(np.concatenate([one.cases() for one in scores]))[::-1]
    return tail_level(ordered, fraction * len(ordered), max(2, round(CASE_TAIL * len(ordered))))


def operated(
    detectors: Mapping[str, FittedMethod],
    free: Mapping[float, Free],
    network: str | None,
    per_hour: float,
) -> dict[str, Operated]:
    """Detectors with their alarms at the operating points.

    There are three points. At the first two, the network's threshold is its residual current. Every
    other detector gets the lowest threshold at which it is expected to be as specific as the
    network at every speed, so that rows compare speed by speed. The third point is a rate of false
    alarms over all speeds; normalised scores give a similar rate at each speed. Its threshold
    limits those of the first two, so at one speed a detector may be less specific than the network.
    ``free`` is by speed [%], then by detector. Without a ``network`` there is the third point only.
    """
    found = {}
    for name, detector in detectors.items():
        alarm, scores = normalised(detector, [one for own in free.values() for one in own[name]])
        rest = iter(scores)
        normal = {speed: [*islice(rest, len(own[name]))] for speed, own in free.items()}
        hourly, alarms = threshold_for_rate(scores, per_hour), {}
        for amperes in AMPERES if network else ():
            if name == network:
                alarms[str(amperes)] = CollisionAlarm(detector, amperes)
                continue
            matched = (
                at_fraction(own, expected(free[speed][str(network)], amperes))
                for speed, own in normal.items()
            )
            threshold = min(max(matched), hourly)
            alarms[str(amperes)] = replace(alarm, threshold=threshold)
        alarms[HOURLY] = replace(alarm, threshold=hourly)
        found[name] = Operated(detector, alarms)
    return found


@dataclass(frozen=True)
class Outcome:
    """One collision and its delay [s], ``None`` where it was missed."""

    collision: Collision
    delay: float | None


@dataclass
class Tally:
    """Results of one detector at one operating point over some episodes."""

    outcomes: list[Outcome] = field(default_factory=list)
    cases: int = 0
    false_cases: int = 0
    false_alarms: int = 0
    free_seconds: float = 0.0

    def add(self, other: Tally) -> None:
        """Add the episodes of the other tally."""
        self.outcomes += other.outcomes
        self.cases += other.cases
        self.false_cases += other.false_cases
        self.false_alarms += other.false_alarms
        self.free_seconds += other.free_seconds


#: Tallies by detector and operating point.
Tallies = dict[tuple[str, str], Tally]


def on_free(fleet: Fleet, trace: Trace) -> Tallies:
    """False alarms and false cases of every detector at every point over a free trace."""
    return {
        key: Tally([], m.cases, m.false_cases, len(m.false_alarms), m.free_seconds)
        for key, m in _matched(fleet, trace, ())
    }


def on_struck(fleet: Fleet, struck: Struck) -> Tallies:
    """Delays of the collisions that count; false alarms are counted on free motion only."""
    assert struck.trace.truth is not None
    true = struck.trace.truth.collisions
    counted = {one.onset: kept for one, kept in zip(true, struck.kept, strict=True)}
    found = {}
    for key, m in _matched(fleet, struck.trace, true):
        pairs = zip(m.collisions, m.delays, strict=True)
        found[key] = Tally([Outcome(c, d) for c, d in pairs if counted[c.onset]])
    return found


def _matched(
    fleet: Fleet, trace: Trace, true: Sequence[Collision]
) -> Iterator[tuple[tuple[str, str], Matching]]:
    """Every detector's alarms at every point, matched with the collisions ``true``."""
    span = float(trace.t[0]) + BEGIN, float(trace.t[-1])
    for name, own in fleet.items():
        levels = own.sustained(trace)
        for point, threshold in own.thresholds.items():
            alarms = find_alarms(trace.t, levels[point] > threshold)
            yield (name, point), match(alarms, true, span)


def merged(parts: Iterable[Tallies]) -> Tallies:
    """All episodes' tallies together, detector by detector and point by point."""
    total: Tallies = {}
    for part in parts:
        for key, tally in part.items():
            total.setdefault(key, Tally()).add(tally)
    return total
