"""The checker ``rigid``: geoms against geoms, swept over the step."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tauguard.arrays import Array
from tauguard.contacts.checker import Contacts, Index, State, checked, geom_kinds, pair_kind
from tauguard.contacts.geoms import CONVEX, native_scene
from tauguard.contacts.pairs import geom_pairs


@dataclass(frozen=True)
class Work:
    """Counts of work in the last call.

    Attributes:
        moved: Bodies whose motion changed since the previous call.
        reused: Pairs whose result was copied from the previous call because neither body moved.
        candidates: Pairs whose swept boxes overlap.
    """

    moved: int
    reused: int
    candidates: int


class RigidChecker:
    """Times of impact of geoms on rigidly moving bodies (linear and angular motion).

    Boxes and meshes (their convex hulls) are tested by the kernel of :mod:`tauguard.rigid`; planes,
    spheres, capsules, cylinders and ellipsoids by conservative advancement on support functions.
    Reported times are never later than the impact. At a time of impact the surfaces are at most
    1e-10 of the shapes' size apart.

    Args:
        model: MjModel.
        threshold: Largest distance of two surfaces that counts as a contact. ``"surface"``: 0 (they
            touch). ``"margin"``: MuJoCo's margin, below which a force acts. ``"gap"``: margin +
            gap, below which MuJoCo lists contacts. If the surfaces do not touch, ``distance`` is
            positive.
        skip: Kinds of geoms to leave out.

    Raises:
        ValueError: a geom of an unsupported kind that can touch another geom (the message names
            it), or an unknown ``threshold``.
    """

    name = "rigid"

    def __init__(self, model: Any, threshold: str = "margin", skip: Sequence[str] = ()) -> None:
        """Choose the pairs and copy the shapes."""
        kinds = np.array(geom_kinds(model))
        pairs = geom_pairs(model)
        keep = ~(np.isin(kinds[pairs.first], skip) | np.isin(kinds[pairs.second], skip))
        self.pairs = pairs.where(keep)
        geoms, index = np.unique([self.pairs.first, self.pairs.second], return_inverse=True)
        self._geoms = geoms.astype(np.int32)
        self._scene = native_scene(model, self._geoms, self.name)
        numbered = index.reshape(2, -1).T.astype(np.int32)
        self._scene.pairs(np.ascontiguousarray(numbered), self.pairs.reach(threshold))
        self.covers = frozenset(
            pair_kind(a, b) for a in CONVEX for b in CONVEX if not a == b == "plane"
        )
        self.work = Work(0, 0, 0)
        self._bodies = int(model.nbody)

    def check(self, before: State, after: State) -> Contacts:
        """The first contact of each pair on the path.

        Raises:
            ValueError: a state of another model, or that is not finite.
        """
        if not len(self.pairs):
            return Contacts.empty()
        before, after = (
            checked(name, state, self._bodies)
            for name, state in (("before", before), ("after", after))
        )
        ids, values, work = self._scene.find(before.xpos, before.xmat, after.xpos, after.xmat)
        self.work = Work(*work)
        return self._rows(ids, values) if len(ids) else Contacts.empty()

    def _rows(self, ids: Index, values: Array) -> Contacts:
        none = np.full((len(ids), 2), -1, dtype=np.int32)
        return Contacts(
            time=values[:, 0],
            geom=self._geoms[ids[:, :2]],
            flex=none,
            feature=none.copy(),
            point=values[:, 2:5],
            normal=values[:, 5:8],
            distance=values[:, 1],
        )
