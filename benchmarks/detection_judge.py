"""What a detector said of the detection study's pools, reduced episode by episode.

Ten hours are 36 million samples: an episode is simulated, scored by every detector, reduced to
alarms at the operating points and peaks of the score, and forgotten.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tauguard.benchmarks.detection_pool import Struck
from tauguard.datasets.plans import BEGIN
from tauguard.detectors import find_alarms, match
from tauguard.detectors.detector import Detector
from tauguard.detectors.events import CASE_SECONDS, MERGE_GAP, detection_window
from tauguard.detectors.filter import CONFIRMATION, confirmation_samples
from tauguard.detectors.operating_point import block_peaks, sustained
from tauguard.traces import Collision, Trace

Array = NDArray[np.float64]

#: The dissertation's thresholds on the network's residual current [A].
AMPERES = (1.6, 2.0)
#: The third operating point: false alarms per hour.
HOURLY = "hourly"
#: Names of the operating points, in the order of the tables.
POINTS = ("1.6", "2.0", HOURLY)

Detectors = Mapping[str, Detector]
Thresholds = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Outcome:
    """One judged collision and what the alarms said of it."""

    arm: int  #: mismatch seed
    payload_g: float
    collision: Collision
    delay: float | None  #: [s], None where it was missed
    peak: float = 0.0  #: highest level of the score while it could be detected


@dataclass
class Tally:
    """One detector at one operating point over some episodes."""

    outcomes: list[Outcome] = field(default_factory=list)
    cases: int = 0
    false_cases: int = 0
    false_alarms: int = 0
    free_seconds: float = 0.0

    def add(self, other: Tally) -> None:
        """Take the other's episodes in."""
        self.outcomes += other.outcomes
        self.cases += other.cases
        self.false_cases += other.false_cases
        self.false_alarms += other.false_alarms
        self.free_seconds += other.free_seconds


Tallies = dict[tuple[str, str], Tally]


@dataclass(frozen=True)
class Peaks:
    """Collision-free scores of one detector, reduced: how high they stayed for t_c."""

    cases: Array  #: peak of every non-collision case
    blocks: Array  #: peak of every merge gap
    hours: float

    @classmethod
    def of(cls, level: Array, dt: float) -> Peaks:
        """From sustained scores of collision-free motion, settled."""
        rows = round(CASE_SECONDS / dt)
        whole = len(level) // rows * rows
        cases = level[:whole].reshape(-1, rows).max(axis=1)
        blocks = block_peaks(level, max(1, round(MERGE_GAP / dt)))
        return cls(cases, blocks, len(level) * dt / 3600)

    @classmethod
    def joined(cls, parts: Sequence[Peaks]) -> Peaks:
        """All parts together."""
        return cls(
            np.concatenate([p.cases for p in parts]),
            np.concatenate([p.blocks for p in parts]),
            sum(p.hours for p in parts),
        )

    def specificity(self, threshold: float) -> float:
        """Share of the cases that stay at or below ``threshold``."""
        return float(np.mean(self.cases <= threshold))

    def at_specificity(self, share: float) -> float:
        """The lowest threshold at which at least ``share`` of the cases stay quiet."""
        ordered = np.sort(self.cases)
        index = int(np.ceil(share * len(ordered) - 1e-9)) - 1
        return float(ordered[max(index, 0)])

    def at_rate(self, per_hour: float) -> float:
        """The threshold that ``per_hour`` blocks an hour exceed, extrapolated where too few are.

        Where the hours hold fewer than one such block, the tail of the largest fiftieth of the
        blocks is taken as exponential.
        """
        ordered = np.sort(self.blocks)[::-1]
        allowed = per_hour * self.hours
        if allowed >= 1:
            return float(ordered[min(int(allowed), len(ordered) - 1)])
        count = max(2, min(len(ordered) - 1, round(0.02 * len(ordered))))
        excess = float(np.mean(ordered[:count] - ordered[count]))
        followed = float(ordered[count]) + excess * float(np.log(count / allowed))
        return max(followed, float(np.nextafter(ordered[0], np.inf)))


def levels(detector: Detector, trace: Trace) -> Array:
    """The level that the last t_c of scores reach; -inf until every detector has settled."""
    level = sustained(detector.scores(trace), confirmation_samples(CONFIRMATION, trace.dt)).copy()
    level[trace.t - trace.t[0] < BEGIN] = -np.inf
    return level


def free_peaks(fleet: Detectors, trace: Trace) -> dict[str, Peaks]:
    """Peaks of every detector over a collision-free trace."""
    settled = trace.t - trace.t[0] >= BEGIN
    return {name: Peaks.of(levels(d, trace)[settled], trace.dt) for name, d in fleet.items()}


def set_thresholds(
    peaks: Mapping[float, Mapping[str, Peaks]], network: str, per_hour: float
) -> Thresholds:
    """Thresholds of every detector at the operating points, from collision-free training motion.

    The network's first two are its residual current. Every other detector gets at each the lowest
    threshold with which it is, at every speed, at least as specific on that motion as the network:
    rows then compare speed by speed, and no detector buys sensitivity with alarms that the network
    does not raise. At the third point the rate is asked for at every speed: over all speeds
    together the slow ones would hide what the fastest does.

    Args:
        peaks: by speed [%], then by detector.
        network: the name whose specificity is matched.
        per_hour: false alarms that the third point aims at.
    """
    names = list(next(iter(peaks.values())))
    found: dict[str, dict[str, float]] = {}
    for name in names:
        found[name] = {
            str(a): max(p[name].at_specificity(p[network].specificity(a)) for p in peaks.values())
            for a in AMPERES
        }
        if name == network:
            found[name] = {str(a): a for a in AMPERES}
        found[name][HOURLY] = max(p[name].at_rate(per_hour) for p in peaks.values())
    return found


def judge_free(fleet: Detectors, thresholds: Thresholds, trace: Trace) -> Tallies:
    """False alarms and false cases of every detector at every point over a free trace."""
    span = (float(trace.t[0]) + BEGIN, float(trace.t[-1]))
    found: Tallies = {}
    for name, detector in fleet.items():
        level = levels(detector, trace)
        for point, threshold in thresholds[name].items():
            m = match(find_alarms(trace.t, level > threshold), (), span)
            found[name, point] = Tally(
                [], m.cases, m.false_cases, len(m.false_alarms), m.free_seconds
            )
    return found


def judge_struck(fleet: Detectors, thresholds: Thresholds, struck: Struck) -> Tallies:
    """Delays of the collisions that count; alarms elsewhere are judged on free motion alone."""
    trace = struck.trace
    assert trace.truth is not None
    span = (float(trace.t[0]) + BEGIN, float(trace.t[-1]))
    inside = [span[0] <= c.onset <= span[1] for c in trace.truth.collisions]
    kept = [k for k, within in zip(struck.kept, inside, strict=True) if within]
    windows = [
        detection_window(c) for c, w in zip(trace.truth.collisions, inside, strict=True) if w
    ]
    found: Tallies = {}
    for name, detector in fleet.items():
        level = levels(detector, trace)
        peaks = [float(level[(trace.t >= a) & (trace.t <= b)].max()) for a, b in windows]
        for point, threshold in thresholds[name].items():
            m = match(find_alarms(trace.t, level > threshold), trace.truth.collisions, span)
            outcomes = [
                Outcome(struck.arm, struck.payload_g, c, d, peak)
                for c, d, k, peak in zip(m.collisions, m.delays, kept, peaks, strict=True)
                if k
            ]
            found[name, point] = Tally(outcomes)
    return found


def merged(parts: Iterable[Tallies]) -> Tallies:
    """All episodes' tallies together, detector by detector and point by point."""
    total: Tallies = {}
    for part in parts:
        for key, tally in part.items():
            total.setdefault(key, Tally()).add(tally)
    return total
