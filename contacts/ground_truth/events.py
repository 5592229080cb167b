"""Join the contacts of single steps to events."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from tauguard.contacts.ground_truth.touches import Touches
from tauguard.findings import ArgumentError

#: Longest time without contact within one event [s]; up to two steps are always allowed.
GAP = 5e-3

#: Two partners, sorted: ("body", id) or ("flex", id).
Pair = tuple[tuple[str, int], tuple[str, int]]


@dataclass(frozen=True)
class Event:
    """One contact of two partners, from touch to separation."""

    pair: Pair
    onset: float  #: first touch [s]
    end: float  #: end of the last step in which the partners touch [s]
    depth: float  #: largest penetration depth [m]
    counts: bool  #: whether the event is scored, as its depth exceeds the tolerance

    def seen(self, times: Sequence[float], timestep: float) -> bool:
        """Whether one of ``times`` [s] is in the event, or at most one timestep outside it."""
        return any(self.onset - timestep <= t <= self.end + timestep for t in times)


def pair_of(model: Any, geom: Any, flex: Any) -> Pair:
    """The partners of one contact, sorted: each is a flex, or the body of a geom."""
    partners = [
        ("flex", int(f)) if g < 0 else ("body", int(model.geom_bodyid[g]))
        for g, f in zip(geom, flex, strict=True)
    ]
    first, second = sorted(partners)
    return first, second


def events(model: Any, times: Sequence[float], touches: Sequence[Touches]) -> list[Event]:
    """The events of a run, by onset.

    Args:
        model: MjModel.
        times: Times of the states [s], one more than ``touches``.
        touches: Contacts of the steps between the states.

    Raises:
        ArgumentError: lengths that do not match.
    """
    if len(times) != len(touches) + 1:
        raise ArgumentError(
            f"times: {len(times)} states, expected {len(touches) + 1}, one more than touches"
        )
    open_: dict[Pair, Event] = {}
    done: list[Event] = []
    for step, touch in enumerate(touches):
        begin, length = times[step], times[step + 1] - times[step]
        for k in range(len(touch)):
            pair = pair_of(model, touch.geom[k], touch.flex[k])
            onset, end = begin + float(touch.time[k]) * length, begin + length
            depth, counts = float(touch.depth[k]), bool(touch.counts[k])
            last = open_.get(pair)
            if last is not None and onset - last.end <= max(GAP, 2 * length):
                onset, depth = min(last.onset, onset), max(last.depth, depth)
                counts = counts or last.counts
            elif last is not None:
                done.append(last)
            open_[pair] = Event(pair, onset, end, depth, counts)
    return sorted([*done, *open_.values()], key=lambda event: (event.onset, event.pair))
