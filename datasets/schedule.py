"""The episodes of a configuration, each a pure function of the configuration and its number.

Each property of an episode (arm, individual, speed, payload, collisions or none) and of a
collision (kind, link, severity) has its own list of values. The list is used up in a random order,
then again in a new order, and so on. So each part of a split is balanced to within one pass through
the list, and properties are not correlated.
"""

import hashlib
import math
import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeVar

import numpy as np

from tauguard.datasets.configuration import Configuration, Split
from tauguard.datasets.plans import collision_plans
from tauguard.envs import CollisionPlan, Episode, PayloadPick
from tauguard.models import Mismatch
from tauguard.traces import stratum

T = TypeVar("T")


@dataclass(frozen=True)
class Planned:
    """One episode of a dataset."""

    split: str
    number: int  #: within the split, from 0
    arm: str
    individual: int  #: seed of the arm's differences from the nominal arm; -1: none
    episode: Episode
    source: str = ""  #: name or file from which the arm is read; "": ``arm``

    @property
    def name(self) -> str:
        """``split/number``."""
        return f"{self.split}/{self.number}"

    def key(self, configuration: Configuration, code: str) -> str:
        """SHA-256 of configuration, number and code, which decide the episode's bytes."""
        text = "\n".join((configuration.identity, self.name, self.episode.config_hash, code))
        return hashlib.sha256(text.encode()).hexdigest()


def planned(configuration: Configuration, split: Split, number: int) -> Planned:
    """Episode ``number`` of a split.

    Raises:
        IndexError: the split has no such episode.
    """
    if not 0 <= number < split.episodes:
        raise IndexError(f"{split.name}: no episode {number}; it has {split.episodes}")
    seed = [configuration.seed, zlib.crc32(split.name.encode())]
    draw, struck = _draw(split, seed, number)
    rng = np.random.default_rng([*seed, 0, draw])
    arm = dealt(split.arms, [*seed, 1], draw)
    individual = dealt(split.individuals, [*seed, 2], draw)
    payload = dealt(split.payloads_g, [*seed, 4], draw)
    picked = not struck and payload > 0 and dealt(_fraction(split.picks), [*seed, 6], draw)
    picks = (PayloadPick(split.seconds / 2, payload),) if picked else ()
    widths = dict(configuration.mismatch)
    # Drawing collisions must not change the temperature, which both episodes of a pair have.
    hits = np.random.default_rng([*seed, 10, draw]) if split.paired else rng
    episode = Episode(
        seed=int(rng.integers(2**62)),
        seconds=split.seconds,
        speed=dealt(split.speeds, [*seed, 3], draw),
        payload_g=0.0 if picked else payload,
        collisions=_collisions(split, seed, draw, hits) if struck else (),
        picks=picks,
        mismatch=None if individual < 0 else Mismatch(seed=individual, **widths),
        temperature=float(rng.uniform(*split.temperature)),
        arm=arm,
        objects=configuration.objects,
    )
    source = configuration.source_of(arm)
    return Planned(split.name, number, arm, individual, episode, source)


def _draw(split: Split, seed: list[int], number: int) -> tuple[int, bool]:
    """The number that an episode is drawn with, and whether the episode has collisions.

    Both episodes of a pair are drawn with the pair's number; the second one has collisions.
    """
    if split.paired:
        return number // 2, bool(number % 2)
    return number, dealt(_fraction(split.struck), [*seed, 5], number)


def dealt(values: Sequence[T], seed: list[int], number: int) -> T:
    """Value ``number`` of the sequence that repeats ``values``, each time in a new random order."""
    round_, place = divmod(number, len(values))
    order = np.random.default_rng([*seed, round_]).permutation(len(values))
    return values[int(order[place])]


def _fraction(fraction: float) -> tuple[bool, ...]:
    """A list of at most 20 values for :func:`dealt`, with this fraction of True."""
    part = Fraction(fraction).limit_denominator(20)
    yes, no = part.numerator, part.denominator - part.numerator
    return (True,) * yes + (False,) * no


def _collisions(
    split: Split, seed: list[int], draw: int, rng: np.random.Generator
) -> tuple[CollisionPlan, ...]:
    """The collisions of an episode; their values continue those of the last such episode."""
    before = (
        draw if split.paired else _dealt_counts(_fraction(split.struck), [*seed, 5], draw)[True]
    )
    numbers = range(before * split.collisions, (before + 1) * split.collisions)
    return collision_plans(
        rng,
        split.collisions,
        strata=[dealt(split.severities, [*seed, 9], number) for number in numbers],
        kinds=[dealt(split.kinds, [*seed, 7], number) for number in numbers],
        links=[dealt(split.links, [*seed, 8], number) for number in numbers],
        clamp_seconds=split.clamp_seconds,
    )


#: Counts by property (arm, speed, payload; kind, link and severity of collisions) and value.
Balance = dict[str, dict[str, int]]


def stated_balance(configuration: Configuration) -> dict[str, Balance]:
    """Planned counts of each split, computed without drawing every episode."""
    return {split.name: _stated(configuration, split) for split in configuration.splits}


def _stated(configuration: Configuration, split: Split) -> Balance:
    seed = [configuration.seed, zlib.crc32(split.name.encode())]
    fold = 2 if split.paired else 1
    count = split.episodes // fold
    struck = (
        count if split.paired else _dealt_counts(_fraction(split.struck), [*seed, 5], count)[True]
    )
    found: dict[str, Counter[Any]] = {
        "arm": _dealt_counts(split.arms, [*seed, 1], count),
        "speed": _dealt_counts([f"{v:g}" for v in split.speeds], [*seed, 3], count),
        "payload_g": _dealt_counts([f"{v:g}" for v in split.payloads_g], [*seed, 4], count),
    }
    for counts in found.values():
        counts.update({value: (fold - 1) * n for value, n in counts.items()})
    levels = [stratum(math.sqrt(low * high)) for low, high in split.severities]
    links = [str(link) for link in split.links]
    for name, values, stream in (
        ("kind", split.kinds, 7),
        ("link", links, 8),
        ("severity", levels, 9),
    ):
        found[name] = _dealt_counts(values, [*seed, stream], struck * split.collisions)
    return {
        name: {value: counts[value] for value in sorted(counts, key=class_order)}
        for name, counts in found.items()
    }


def _dealt_counts(values: Sequence[T], seed: list[int], count: int) -> Counter[T]:
    """How often each value is among the first ``count`` values of :func:`dealt`."""
    rounds, rest = divmod(count, len(values))
    found: Counter[T] = Counter()
    for value in values:
        found[value] += rounds
    found.update(dealt(values, seed, rounds * len(values) + i) for i in range(rest))
    return found


def class_order(value: str) -> tuple[float, str]:
    """Sort key: numbers and ranges by size, words by alphabet."""
    head = value.split("-")[0]
    return (float(head), value) if head.replace(".", "").isdigit() else (0.0, value)
