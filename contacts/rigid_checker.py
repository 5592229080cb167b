"""The checker ``rigid``: geoms against geoms, swept over the step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tauguard.contacts.checker import Contacts, State, geom_kinds, pair_kind
from tauguard.contacts.geoms import CONVEX, native_scene
from tauguard.contacts.pairs import Pairs, geom_pairs


@dataclass(frozen=True)
class Work:
    """What the last call had to do.

    Attributes:
        moved: Bodies whose motion changed since the call before.
        reused: Pairs answered from the call before, neither body having moved.
        candidates: Pairs whose swept boxes met.
    """

    moved: int
    reused: int
    candidates: int


class RigidChecker:
    """Times of impact of geoms on rigidly moving bodies (linear and angular motion).

    Boxes and meshes (their convex hulls) go through the kernel of :mod:`tauguard.rigid`; planes,
    spheres, capsules, cylinders and ellipsoids through conservative advancement on their support
    functions: never late, early by at most 1e-10 of the shapes' size in distance.

    Args:
        model: MjModel.
        threshold: ``"surface"``: contacts are surfaces that touch; ``"margin"``: or that come
            within MuJoCo's margin, where a force acts; ``"gap"``: within margin + gap, as MuJoCo
            lists them. A row whose surfaces do not touch has a positive distance.
        skip: Kinds of geoms to leave out.

    Raises:
        ValueError: a geom that may touch something and is of a kind that cannot be handled
            (named), an unknown threshold.
    """

    name = "rigid"

    def __init__(self, model: Any, threshold: str = "margin", skip: Sequence[str] = ()) -> None:
        """Choose the pairs and copy the shapes."""
        kinds = np.array(geom_kinds(model))
        pairs = geom_pairs(model)
        keep = ~(np.isin(kinds[pairs.first], skip) | np.isin(kinds[pairs.second], skip))
        self.pairs = Pairs(*(getattr(pairs, f)[keep] for f in ("first", "second", "margin", "gap")))
        geoms, index = np.unique([self.pairs.first, self.pairs.second], return_inverse=True)
        self._geoms = geoms.astype(np.int32)
        self._scene = native_scene(model, self._geoms, self.name)
        numbered = index.reshape(2, -1).T.astype(np.int32)
        self._scene.pairs(np.ascontiguousarray(numbered), self.pairs.reach(threshold))
        self.covers = frozenset(
            pair_kind(a, b) for a in CONVEX for b in CONVEX if not a == b == "plane"
        )
        self.work = Work(0, 0, 0)

    def check(self, before: State, after: State) -> Contacts:
        """What touches on the way; at most one contact a pair, the first."""
        ids, values, work = self._scene.find(before.xpos, before.xmat, after.xpos, after.xmat)
        self.work = Work(*work)
        return Contacts(
            time=values[:, 0],
            geom=self._geoms[ids[:, :2]],
            flex=np.full((len(ids), 2), -1, dtype=np.int32),
            feature=np.full((len(ids), 2), -1, dtype=np.int32),
            point=values[:, 2:5],
            normal=values[:, 5:8],
            distance=values[:, 1],
        )
