"""Scenes drawn at random in which something thin is in the way of something fast."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from studies.contacts.draws import built, crowded, moved, rigid, soft
from studies.contacts.draws.world import Thrown

#: Every family: what draws one of its scenes. Seeds go by the order: new ones come last.
FAMILIES: dict[str, Callable[[np.random.Generator], Thrown]] = {
    "plate": rigid.plate,
    "pair": rigid.pair,
    "chain": rigid.chain,
    "cup": rigid.cup,
    "arm": rigid.arm,
    "cloth": soft.cloth,
    "composite": built.composite,
    "stack": built.stack,
    "joined": built.joined,
    "spin": built.spin,
    "soft": soft.soft,
    "mill": crowded.mill,
    "grid": crowded.grid,
    "small": crowded.small,
    "door": moved.door,
    "servo": moved.servo,
    "whips": moved.whips,
    "paddle": moved.paddle,
    "squeeze": moved.squeeze,
    "needles": soft.needles,
}


def scenes(family: str, seed: int, count: int, begin: int = 0) -> Iterator[Thrown]:
    """Scenes ``begin`` to ``begin + count - 1`` of a family (:data:`FAMILIES`) for this seed."""
    number = list(FAMILIES).index(family)
    for k in range(begin, begin + count):
        yield FAMILIES[family](np.random.default_rng([seed, number, k]))


__all__ = ["FAMILIES", "Thrown", "scenes"]
