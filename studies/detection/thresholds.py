"""Thresholds of one arm's detectors at the study's operating points, by the product's law.

Scores of the arm's collision-free calibration motion are reduced, normalised over the speed and
followed along their tail by :mod:`tauguard.detectors.thresholds`; what the study adds is the
dissertation's operating points, which are shares of non-collision cases.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tauguard.arrays import Array
from tauguard.datasets.plans import BEGIN
from tauguard.detectors import CollisionAlarm, FittedDetector, FreeScores
from tauguard.detectors.thresholds.free_scores import speed_levels
from tauguard.detectors.thresholds.law import threshold_for_rate
from tauguard.detectors.thresholds.rates import tail_level
from tauguard.traces import Trace

#: The dissertation's thresholds on the network's residual current [A].
AMPERES = (1.6, 2.0)
#: The third operating point: false alarms per hour.
HOURLY = "hourly"
#: Names of the operating points, in the order of the tables.
POINTS = ("1.6", "2.0", HOURLY)
#: A fourth point beside them: one false alarm an hour.
ONCE = "once an hour"
#: Share of the cases that are the tail, which is extrapolated to rarer ones.
CASE_TAIL = 0.1

#: Collision-free scores of one speed: by detector, an episode each.
Free = Mapping[str, Sequence[FreeScores]]


@dataclass(frozen=True)
class Operated:
    """A trained detector of one arm and its alarm at every operating point."""

    detector: FittedDetector
    alarms: Mapping[str, CollisionAlarm]

    @property
    def thresholds(self) -> dict[str, float]:
        """By operating point."""
        return {point: alarm.threshold for point, alarm in self.alarms.items()}

    def sustained(self, trace: Trace) -> tuple[Array, dict[str, Array]]:
        """Scores that lasted for t_c, as they are, and as every point's alarm compares them.

        All are of shape (T,), and -inf until every detector of the study has settled.
        """
        score, early = self.detector.scores(trace), trace.t - trace.t[0] < BEGIN
        plain = _plain(self.detector).sustained(trace, score)
        levels = {point: alarm.sustained(trace, score) for point, alarm in self.alarms.items()}
        for level in (plain, *levels.values()):
            level[early] = -np.inf
        return plain, levels


Fleet = Mapping[str, Operated]


def _plain(detector: FittedDetector) -> CollisionAlarm:
    return CollisionAlarm(detector, np.inf)


def free_scores(
    detectors: Mapping[str, FittedDetector], trace: Trace
) -> dict[str, list[FreeScores]]:
    """Every detector's scores over a collision-free trace."""
    return {name: [FreeScores.of(_plain(d), trace)] for name, d in detectors.items()}


def joined(parts: Sequence[Free]) -> dict[str, list[FreeScores]]:
    """All episodes of several traces, by detector."""
    return {name: [one for part in parts for one in part[name]] for name in parts[0]}


def expected(scores: Sequence[FreeScores], threshold: float) -> float:
    """The share of cases expected above ``threshold``: that of N seen, Jeffreys' prior.

    None of N says that fewer than about one in 2 N are.
    """
    cases = np.concatenate([one.cases() for one in scores])
    return (float(np.sum(cases > threshold)) + 0.5) / (len(cases) + 1)


def at_share(scores: Sequence[FreeScores], share: float) -> float:
    """The threshold that a ``share`` of the cases is expected to exceed, along their tail."""
    ordered = np.sort(np.concatenate([one.cases() for one in scores]))[::-1]
    return tail_level(ordered, share * len(ordered), max(2, round(CASE_TAIL * len(ordered))))


def operated(
    detectors: Mapping[str, FittedDetector],
    free: Mapping[float, Free],
    network: str | None,
    per_hour: float,
) -> dict[str, Operated]:
    """Detectors with their alarms at the operating points.

    The network's first two thresholds are its residual current. Every other detector gets at each
    the lowest threshold with which it is expected, at every speed, to be as specific as the
    network: rows then compare speed by speed. Where the network raises none in N cases, the others
    may raise one in 2 N. The third is for a rate over all speeds, which the normalised score
    spreads evenly. It bounds the other two, which ask for more alarms over all speeds; at a single
    one that can leave a detector less specific than the network. A fourth is for one false alarm an
    hour.

    Args:
        detectors: trained, by name.
        free: scores of collision-free motion of their arm, by speed [%], then by detector.
        network: the name whose specificity is matched; ``None``: the third point alone.
        per_hour: false alarms that the third point aims at.
    """
    found = {}
    matched = {
        (amperes, speed): expected(own[network], amperes)
        for amperes in AMPERES
        for speed, own in free.items()
        if network
    }
    for name, detector in detectors.items():
        levels = speed_levels([one for own in free.values() for one in own[name]])
        normal = {speed: [one.over(levels) for one in own[name]] for speed, own in free.items()}
        together = [one for own in normal.values() for one in own]
        hourly = threshold_for_rate(together, per_hour)
        once = threshold_for_rate(together, 1.0)
        alarms = {}
        for amperes in AMPERES if network else ():
            if name == network:
                alarms[str(amperes)] = CollisionAlarm(detector, amperes)
                continue
            shares = (at_share(own, matched[amperes, s]) for s, own in normal.items())
            threshold = min(max(shares), hourly)
            alarms[str(amperes)] = CollisionAlarm(detector, threshold, levels=levels)
        alarms[HOURLY] = CollisionAlarm(detector, hourly, levels=levels)
        alarms[ONCE] = CollisionAlarm(detector, once, levels=levels)
        found[name] = Operated(detector, alarms)
    return found
