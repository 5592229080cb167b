"""The pairs that a guard covers, and their eroded shapes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.contacts._contacts import Guard
from tauguard.contacts.checker import geom_kinds
from tauguard.contacts.geoms import CONVEX
from tauguard.contacts.guard.eroded_shapes import ErodedShapes
from tauguard.contacts.guard.report import Pair, Partner
from tauguard.contacts.pairs import flex_pairs, geom_flex_pairs, geom_pairs
from tauguard.findings import ArgumentError
from tauguard.models.cloth import flex_elements

#: Layers eroded from both partners, as fractions of half their thickness. If the eroded shapes of
#: the last level never meet, no part of one partner has passed through the other.
LEVELS = (0.0, 0.5, 0.75, 0.95)
#: Against a flex, a geom has one more level, with a layer of at most NEAR_FLEX / 2 flex radii. The
#: reason is that MuJoCo pushes the triangles of a cloth out of a geom in different directions.
NEAR_FLEX = 4.0

#: Native number of each kind of object that has contact parameters.
_PLACES = {"pair": 0, "geom": 1, "flex": 2}


class Covered:
    """Chooses the pairs and shapes of a native guard.

    Attributes:
        pairs: Covered pairs in the order of their native numbers; pairs of flexes are last.
        sheets: Covered pairs of flexes, by ids.
        uncovered: Pairs that may touch and are not covered.

    Args:
        model: MjModel.
        guard: The native guard.
        rigid: Whether geoms against geoms are covered.
        cloth: Whether flexes are covered, against geoms, each other and themselves.
    """

    def __init__(self, model: Any, guard: Guard, rigid: bool, cloth: bool) -> None:
        """Choose the pairs, and add the shapes of every level to the guard."""
        self._model, self._guard = model, guard
        kinds = geom_kinds(model)
        self._eroded = ErodedShapes(model, kinds, guard)
        self._known = np.isin(kinds, CONVEX)
        self.pairs: list[Pair] = []
        self.uncovered: list[Pair] = []
        self._explicit = {
            tuple(sorted((int(model.pair_geom1[k]), int(model.pair_geom2[k])))): k
            for k in range(model.npair)
        }
        self._add_rigid(rigid)
        self._add_flexes(cloth)
        self.sheets = self._add_sheets(cloth)

    def _add_rigid(self, wanted: bool) -> None:
        pairs, rows = geom_pairs(self._model), []
        for a, b in zip(pairs.first.tolist(), pairs.second.tolist(), strict=True):
            own: Pair = (("geom", min(a, b)), ("geom", max(a, b)))
            if not (wanted and self._known[a] and self._known[b]):
                self.uncovered.append(own)
                continue
            levels = [
                [self._eroded.add(g, level * self._eroded.radius(g)) for level in LEVELS]
                for g in (a, b)
            ]
            self._guard.pair(*(np.array(c, dtype=np.int32) for c in levels))
            self.pairs.append(own)
            number = self._explicit.get((own[0][1], own[1][1]))
            carrier = own[0] if number is None else ("pair", number)
            rows.append(_row(own, carrier, len(LEVELS) - 1))
        self._add_rows(rows)

    def _add_flexes(self, wanted: bool) -> None:
        model, pairs, rows = self._model, geom_flex_pairs(self._model), []
        for geom, flex in zip(pairs.first.tolist(), pairs.second.tolist(), strict=True):
            own: Pair = (("flex", flex), ("geom", geom))
            if not (wanted and self._known[geom]):
                self.uncovered.append(own)
                continue
            radius, thick = float(model.flex_radius[flex]), self._eroded.radius(geom)
            near = min(thick, NEAR_FLEX * radius)
            layers = [0.0, 0.5 * near, *(level * thick for level in LEVELS[1:])]
            radii = [radius * (1 - level) for level in (0.0, 0.5, *LEVELS[1:])]
            simplices = flex_elements(model, flex)
            bodies = model.flex_vertbodyid[simplices]
            hangs = (bodies == int(model.geom_bodyid[geom])).any(axis=1).astype(np.uint8)
            levels = np.array([self._eroded.add(geom, layer) for layer in layers], dtype=np.int32)
            self._guard.flex_pair(levels, np.array(radii), simplices, hangs)
            self.pairs.append(own)
            rows.append(_row(own, own[1], len(LEVELS)))
        self._add_rows(rows)

    def _add_sheets(self, wanted: bool) -> list[tuple[int, int]]:
        model, pairs, rows = self._model, flex_pairs(self._model), []
        chosen = []
        for a, b in zip(pairs.first.tolist(), pairs.second.tolist(), strict=True):
            own: Pair = (("flex", a), ("flex", b))
            if not (wanted and model.flex_dim[a] == model.flex_dim[b] == 2):
                self.uncovered.append(own)
                continue
            self.pairs.append(own)
            chosen.append((a, b))
            rows.append(_row(own, own[0], len(LEVELS)))
        self._add_rows(rows)
        return chosen

    def _add_rows(self, rows: list[NDArray[np.int32]]) -> None:
        if rows:
            self._guard.partners(np.array(rows, dtype=np.int32))


def _row(pair: Pair, carrier: Partner, last: int) -> NDArray[np.int32]:
    places = [(_PLACES[kind], number) for kind, number in (*pair, carrier)]
    return np.array([*np.ravel(places), last], dtype=np.int32)


def names(covers: Sequence[str]) -> tuple[bool, bool]:
    """Whether ``rigid`` is in ``covers``, and whether ``cloth`` is.

    Raises:
        ArgumentError: an unknown name.
    """
    for one in covers:
        if one not in ("rigid", "cloth"):
            raise ArgumentError(f"checker {one!r}: expected rigid or cloth")
    return "rigid" in covers, "cloth" in covers
