"""The checker ``rigid``: geoms against geoms, swept over the step."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tauguard.arrays import Array
from tauguard.contacts.checker import Contacts, Index, State, checked, geom_kinds, pair_kind
from tauguard.contacts.geoms import CONVEX, native_scene
from tauguard.contacts.pairs import geom_pairs
from tauguard.contacts.surface_pairs import SurfacePairs


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
        mesh: ``"hull"``: a mesh is its convex hull, as in MuJoCo. ``"surface"``: a mesh is its
            triangles, without inside; contacts with meshes and boxes then have no margin or depth.

    Raises:
        ValueError: a geom of an unsupported kind that can touch another geom (the message names
            it), or an unknown ``threshold`` or ``mesh``.
    """

    name = "rigid"

    def __init__(
        self, model: Any, threshold: str = "margin", skip: Sequence[str] = (), mesh: str = "hull"
    ) -> None:
        """Choose the pairs and copy the shapes."""
        if mesh not in ("hull", "surface"):
            raise ValueError(f"mesh {mesh!r}: expected hull or surface")
        kinds = np.array(geom_kinds(model))
        pairs = geom_pairs(model)
        keep = ~(np.isin(kinds[pairs.first], skip) | np.isin(kinds[pairs.second], skip))
        self.pairs = pairs.where(keep)
        trees = np.zeros(len(self.pairs), dtype=bool)
        if mesh == "surface":
            flat = np.isin(kinds[self.pairs.first], ("box", "mesh"))
            trees = flat & (kinds[self.pairs.second] == "mesh")
        swept, meshes = self.pairs.where(~trees), self.pairs.where(trees)
        rows = zip(meshes.first.tolist(), meshes.second.tolist(), strict=True)
        self._surfaces = SurfacePairs(model, list(rows)) if len(meshes) else None
        geoms, index = np.unique([swept.first, swept.second], return_inverse=True)
        self._geoms = geoms.astype(np.int32)
        self._scene = native_scene(model, self._geoms, self.name, surfaces=mesh == "surface")
        numbered = index.reshape(2, -1).T.astype(np.int32)
        self._scene.pairs(np.ascontiguousarray(numbered), swept.reach(threshold))
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
        found = self._rows(ids, values) if len(ids) else Contacts.empty()
        if self._surfaces is None:
            return found
        return Contacts.concatenate([found, self._surfaces.check(before, after)])

    def _rows(self, ids: Index, values: Array) -> Contacts:
        none = np.full((len(ids), 2), -1, dtype=np.int32)
        feature = none.copy()
        feature[:, 1] = ids[:, 2]
        return Contacts(
            time=values[:, 0],
            geom=self._geoms[ids[:, :2]],
            flex=none,
            feature=feature,
            point=values[:, 2:5],
            normal=values[:, 5:8],
            distance=values[:, 1],
        )
