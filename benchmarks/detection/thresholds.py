"""Thresholds of one arm's detectors, from that arm's collision-free calibration motion.

First every score is levelled (see :mod:`tauguard.detectors.thresholds.speed_levels`), so that
one threshold of a detector serves all speeds of its arm; then it is chosen at each operating point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.datasets.plans import BEGIN
from tauguard.detectors.detector import Detector
from tauguard.detectors.evaluation.events import CASE_SECONDS, MERGE_GAP
from tauguard.detectors.thresholds.confirmation import CONFIRMATION, confirmation_samples
from tauguard.detectors.thresholds.rates import block_maxima, sustained, tail_level
from tauguard.detectors.thresholds.speed_levels import SpeedLevels, recent_speed
from tauguard.traces import Trace

Array = NDArray[np.float64]

#: The dissertation's thresholds on the network's residual current [A].
AMPERES = (1.6, 2.0)
#: The third operating point: false alarms per hour.
HOURLY = "hourly"
#: Names of the operating points, in the order of the tables.
POINTS = ("1.6", "2.0", HOURLY)
#: Motion is kept as the peaks of pieces this long [s].
PIECE = 0.02
#: Share of the blocks whose peaks are the tail that is followed to rarer alarms.
TAIL = 0.02
#: The same of the cases, which are fewer.
CASE_TAIL = 0.1


@dataclass(frozen=True)
class Peaks:
    """Collision-free scores of one detector, reduced: how high they stayed for t_c."""

    cases: Array  #: peak of every non-collision case
    blocks: Array  #: peak of every merge gap
    hours: float

    @classmethod
    def joined(cls, parts: Sequence[Peaks]) -> Peaks:
        """All parts together."""
        return cls(
            np.concatenate([p.cases for p in parts]),
            np.concatenate([p.blocks for p in parts]),
            sum(p.hours for p in parts),
        )

    def expected(self, threshold: float) -> float:
        """The share of cases expected above ``threshold``: that of N seen, Jeffreys' prior.

        None of N says that fewer than about one in 2 N are.
        """
        return (float(np.sum(self.cases > threshold)) + 0.5) / (len(self.cases) + 1)

    def at_share(self, share: float) -> float:
        """The threshold that a ``share`` of the cases is expected to exceed, along their tail."""
        ordered = np.sort(self.cases)[::-1]
        return tail_level(ordered, share * len(ordered), max(2, round(CASE_TAIL * len(ordered))))

    def at_rate(self, per_hour: float) -> float:
        """The threshold that ``per_hour`` blocks an hour exceed, along the tail of the blocks."""
        ordered = np.sort(self.blocks)[::-1]
        return tail_level(ordered, per_hour * self.hours, max(2, round(TAIL * len(ordered))))


@dataclass(frozen=True)
class Pieces:
    """Collision-free scores of one detector, settled: the peak of every piece of every episode."""

    level: tuple[Array, ...]  #: of an episode, shape (pieces,)
    speed: tuple[Array, ...]  #: recent speed at those peaks [rad/s], shape (pieces,)
    seconds: float

    @classmethod
    def of(cls, level: Array, speed: Array, dt: float) -> Pieces:
        """From sustained scores of one episode and the recent speed, both of shape (T,)."""
        high, where = block_maxima(level, max(1, round(PIECE / dt)))
        return cls((high,), (speed[where],), len(level) * dt)

    @classmethod
    def joined(cls, parts: Sequence[Pieces]) -> Pieces:
        """All parts together."""
        return cls(
            tuple(level for p in parts for level in p.level),
            tuple(speed for p in parts for speed in p.speed),
            sum(p.seconds for p in parts),
        )

    def levels(self) -> SpeedLevels:
        """What its blocks' peaks reach at each speed."""
        rows = round(MERGE_GAP / PIECE)
        found = [block_maxima(level, rows) for level in self.level]
        speeds = [speed[where] for speed, (_, where) in zip(self.speed, found, strict=True)]
        return SpeedLevels.fit(np.concatenate([high for high, _ in found]), np.concatenate(speeds))

    def peaks(self, levels: SpeedLevels | None = None) -> Peaks:
        """Peaks of the levelled score, or of the score itself.

        Levelled is what a piece's highest score becomes: the recent speed hardly changes within a
        piece, so that this is nearly the piece's highest levelled score.
        """
        cases, blocks = [], []
        for level, speed in zip(self.level, self.speed, strict=True):
            score = levels(level, speed) if levels else level
            rows = round(CASE_SECONDS / PIECE)
            whole = len(score) // rows * rows
            cases.append(score[:whole].reshape(-1, rows).max(axis=1))
            blocks.append(block_maxima(score, round(MERGE_GAP / PIECE))[0])
        return Peaks(np.concatenate(cases), np.concatenate(blocks), self.seconds / 3600)


@dataclass(frozen=True)
class Watched:
    """A trained detector of one arm and when it alarms there."""

    detector: Detector
    levels: SpeedLevels | None  #: None: the score is taken as it is
    thresholds: Mapping[str, float]  #: by operating point
    amperes: bool = False  #: the first two thresholds are on the score itself

    def levelled(self, point: str) -> bool:
        """Whether a point's threshold is on the levelled score."""
        return self.levels is not None and not (self.amperes and point != HOURLY)

    def curves(self, trace: Trace) -> tuple[Array, Array]:
        """What the last t_c of scores reach, and the same levelled; shape (T,) both.

        Both are -inf until every detector has settled.
        """
        score = self.detector.scores(trace)
        plain = _settled(score, trace)
        if self.levels is None:
            return plain, plain
        return plain, _settled(self.levels(score, recent_speed(trace.qd, trace.dt)), trace)


Fleet = Mapping[str, Watched]


def _settled(score: Array, trace: Trace) -> Array:
    level = sustained(score, confirmation_samples(CONFIRMATION, trace.dt)).copy()
    level[trace.t - trace.t[0] < BEGIN] = -np.inf
    return level


def free_pieces(detectors: Mapping[str, Detector], trace: Trace) -> dict[str, Pieces]:
    """Every detector's pieces over a collision-free trace."""
    settled = trace.t - trace.t[0] >= BEGIN
    speed = recent_speed(trace.qd, trace.dt)[settled]
    return {
        name: Pieces.of(_settled(d.scores(trace), trace)[settled], speed, trace.dt)
        for name, d in detectors.items()
    }


def watched(
    detectors: Mapping[str, Detector],
    pieces: Mapping[float, Mapping[str, Pieces]],
    network: str | None,
    per_hour: float,
) -> dict[str, Watched]:
    """Detectors with their levels and their thresholds at the operating points.

    The network's first two thresholds are its residual current. Every other detector gets at each
    the lowest threshold with which it is expected, at every speed, to be as specific as the
    network: rows then compare speed by speed. Where the network raises none in N cases, the others
    may raise one in 2 N. The third is for a rate over all speeds, which the levelled score spreads
    evenly. It bounds the other two, which ask for more alarms over all speeds; at a single one that
    can leave a detector less specific than the network.

    Args:
        detectors: trained, by name.
        pieces: of collision-free motion of their arm, by speed [%], then by detector.
        network: the name whose specificity is matched; ``None``: the third point alone.
        per_hour: false alarms that the third point aims at.
    """
    found = {}
    quiet = {
        (amperes, speed): own[network].peaks().expected(amperes)
        for amperes in AMPERES
        for speed, own in pieces.items()
        if network
    }
    for name, detector in detectors.items():
        levels = Pieces.joined([own[name] for own in pieces.values()]).levels()
        peaks = {speed: own[name].peaks(levels) for speed, own in pieces.items()}
        thresholds = {}
        hourly = Peaks.joined(list(peaks.values())).at_rate(per_hour)
        for amperes in AMPERES if network else ():
            if name == network:
                thresholds[str(amperes)] = amperes
            else:
                matched = (p.at_share(quiet[amperes, s]) for s, p in peaks.items())
                thresholds[str(amperes)] = min(max(matched), hourly)
        thresholds[HOURLY] = hourly
        found[name] = Watched(detector, levels, thresholds, name == network)
    return found
