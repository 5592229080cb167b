"""Contact parameters written for as long as a guarded contact lasts, and put back after it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

#: Stiff enough that a fast body does not sink through within its own radius: solref, solimp.
SOLREF = (1e-4, 1.0)
SOLIMP = (0.99, 0.999, 0.001, 0.5, 2.0)

#: A partner of a contact: ("geom", id) or ("flex", id).
Partner = tuple[str, int]
#: Both partners of a contact, sorted.
Pair = tuple[Partner, Partner]


@dataclass
class Stiffening:
    """Which partners are stiff at present, and what they were before."""

    model: Any
    _saved: dict[Partner | tuple[str, int], tuple[Any, ...]] = field(default_factory=dict)
    _users: dict[Partner | tuple[str, int], set[Pair]] = field(default_factory=dict)

    def stiffen(self, pair: Pair) -> bool:
        """Make ``pair`` stiff; False if it was already.

        An explicit contact pair is changed itself; otherwise a flex, or the first geom, gets the
        parameters and a priority above its partner's, so that no averaging softens them.
        """
        place = self.place(pair)
        users = self._users.setdefault(place, set())
        if pair in users:
            return False
        users.add(pair)
        arrays = self._arrays(place)
        if place not in self._saved:
            self._saved[place] = tuple(np.copy(array[place[1]]) for array in arrays)
        arrays[0][place[1]], arrays[1][place[1]] = SOLREF, SOLIMP
        if len(arrays) > 2:
            others = [p for p in pair if p != place] or [place]
            highest = max(int(self._arrays(p)[2][p[1]]) for p in others)
            arrays[2][place[1]] = max(int(arrays[2][place[1]]), highest + 1)
        return True

    def restore(self, pair: Pair) -> bool:
        """Undo :meth:`stiffen`, once no other pair needs it; False if it was not stiff."""
        place = self.place(pair)
        users = self._users.get(place, set())
        if pair not in users:
            return False
        users.discard(pair)
        if not users:
            for array, value in zip(self._arrays(place), self._saved.pop(place), strict=True):
                array[place[1]] = value
        return True

    def pairs(self) -> tuple[Pair, ...]:
        """Those that are stiff."""
        return tuple(sorted({pair for users in self._users.values() for pair in users}))

    def place(self, pair: Pair) -> tuple[str, int]:
        """What carries the parameters of a contact of ``pair``."""
        if pair[0][0] == pair[1][0] == "geom":
            wanted = {pair[0][1], pair[1][1]}
            for k in range(self.model.npair):
                if {int(self.model.pair_geom1[k]), int(self.model.pair_geom2[k])} == wanted:
                    return ("pair", k)
        return pair[0]  # sorted: a flex comes before a geom

    def _arrays(self, place: tuple[str, int]) -> tuple[Any, ...]:
        model = self.model
        if place[0] == "pair":
            return model.pair_solref, model.pair_solimp
        if place[0] == "flex":
            return model.flex_solref, model.flex_solimp, model.flex_priority
        return model.geom_solref, model.geom_solimp, model.geom_priority
