"""The checker ``cloth``: two-dimensional flexes against geoms, each other and themselves."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.cloth import Groups, MeshCCD
from tauguard.contacts._contacts import simplices
from tauguard.contacts.checker import Contacts, Index, State, checked, geom_kinds, pair_kind
from tauguard.contacts.geoms import CONVEX, native_scene
from tauguard.contacts.pairs import Pairs, flex_pairs, geom_flex_pairs
from tauguard.findings import ArgumentError
from tauguard.models.cloth import flex_elements


class ClothChecker:
    """Times of impact of cloth with linearly moving vertices.

    A flex is the union of its triangles, thickened by its radius, as in MuJoCo. Triangles are
    tested against geoms by conservative advancement on support functions. For cloth against cloth
    or itself, :class:`tauguard.cloth.MeshCCD` finds vertices, edges and faces that come near each
    other, and then the triangles around them are tested. Reported times are never later than the
    impact. At a time of impact the surfaces are at most 1e-10 of the shapes' size apart.

    Args:
        model: MjModel.
        threshold: As for :class:`tauguard.contacts.RigidChecker`.
        skip: Kinds of geoms to leave out.
        self_collision: Whether to test cloth against cloth (the pairs that MuJoCo would test).

    Raises:
        ArgumentError: a flex that can collide but is not two-dimensional, a geom of an unsupported
            kind that can touch a flex (the message names it), or an unknown threshold.
    """

    name = "cloth"

    def __init__(
        self,
        model: Any,
        threshold: str = "margin",
        skip: Sequence[str] = (),
        self_collision: bool = True,
    ) -> None:
        """Choose the pairs, copy the shapes and number the triangles."""
        kinds = np.array(geom_kinds(model))
        pairs = geom_flex_pairs(model)
        keep = ~np.isin(kinds[pairs.first], skip)
        pairs = pairs.where(keep)
        between = flex_pairs(model)
        used = {*pairs.second.tolist()}
        if self_collision:
            used |= {*between.first.tolist(), *between.second.tolist()}
        self._flexes = {f: _Flex(model, f) for f in sorted(used)}
        self._geoms = np.unique(pairs.first)
        self._scene = native_scene(model, self._geoms, self.name)
        reach = pairs.reach(threshold)
        self._against = []
        for flex in self._flexes.values():
            rows = pairs.second == flex.number
            geoms = pairs.first[rows]
            if len(geoms):
                skipped = [flex.hangs_on(int(model.geom_bodyid[g])) for g in geoms]
                index = np.searchsorted(self._geoms, geoms).astype(np.int32)
                self._against.append((flex, index, reach[rows], np.array(skipped, dtype=np.uint8)))
        self._cloths = None
        if self_collision and len(between):
            self._cloths = _Cloths(model, self._flexes, between, between.reach(threshold))
        self.covers = frozenset(pair_kind("flex", kind) for kind in (*CONVEX, "flex"))
        self._size = (int(model.nbody), int(model.nflexvert))
        self._last: tuple[State, State, Contacts] | None = None

    def check(self, before: State, after: State) -> Contacts:
        """The contacts on the path, at most one per pair of a triangle with a geom or triangle.

        Raises:
            ArgumentError: a state of another model, or that is not finite.
        """
        if not self._against and self._cloths is None:
            return Contacts.empty()
        before, after = (
            checked(name, state, *self._size)
            for name, state in (("before", before), ("after", after))
        )
        if self._last is not None and _same(self._last[0], before) and _same(self._last[1], after):
            return self._last[2]
        parts = []
        for flex, geoms, reach, skip in self._against:
            ids, values, _ = self._scene.find_flex(
                before.xpos,
                before.xmat,
                after.xpos,
                after.xmat,
                before.flexvert_xpos,
                after.flexvert_xpos,
                flex.elements,
                flex.radius,
                geoms,
                reach,
                skip,
            )
            if not len(ids):
                continue
            none = np.full(len(ids), -1, dtype=np.int32)
            geom = np.stack([self._geoms[ids[:, 0]], none], axis=1)
            number = np.stack([none, np.full(len(ids), flex.number, dtype=np.int32)], axis=1)
            feature = np.stack([none, ids[:, 2]], axis=1)
            parts.append(_contacts(geom, number, feature, values))
        if self._cloths is not None:
            parts += self._cloths.check(before.flexvert_xpos, after.flexvert_xpos)
        found = Contacts.concatenate(parts)
        self._last = (before, after, found)
        return found


class _Flex:
    """The triangles of one flex.

    ``elements`` are the corners as indices into the vertices of all flexes, shape (E, 3);
    ``bodies`` are the bodies to which the corners are attached, shape (E, 3).
    """

    def __init__(self, model: Any, number: int) -> None:
        dim = int(model.flex_dim[number])
        if dim != 2:
            name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, number)
            raise ArgumentError(
                f"cloth: flex {name!r} has dimension {dim}; this checker handles 2 "
                '(contype="0" conaffinity="0" excludes the flex)'
            )
        self.number = number
        self.radius = float(model.flex_radius[number])
        self.elements: Index = flex_elements(model, number)
        self.bodies = model.flex_vertbodyid[self.elements]

    def hangs_on(self, body: int) -> NDArray[np.bool_]:
        """Mask of triangles attached to ``body`` by a corner; MuJoCo does not test them with it."""
        return np.asarray((self.bodies == body).any(axis=1), dtype=bool)


class _Cloths:
    """Cloth against cloth: finds candidate features, then tests pairs of triangles."""

    def __init__(
        self, model: Any, flexes: dict[int, _Flex], pairs: Pairs, reach: NDArray[np.float64]
    ) -> None:
        meets = np.zeros((model.nflex, model.nflex), dtype=bool)
        self._distance = {}
        for a, b, more in zip(pairs.first.tolist(), pairs.second.tolist(), reach, strict=True):
            meets[a, b] = meets[b, a] = True
            self._distance[a, b] = (flexes[a].radius + flexes[b].radius, float(more))
        chosen = sorted({*pairs.first.tolist(), *pairs.second.tolist()})
        self._elements = np.concatenate([flexes[f].elements for f in chosen])
        self._bodies = np.concatenate([flexes[f].bodies for f in chosen])
        self._flex = np.repeat(chosen, [len(flexes[f].elements) for f in chosen])
        self._first = {f: int(np.argmax(self._flex == f)) for f in chosen}
        ids = np.repeat(np.arange(model.nflex), model.flex_vertnum)
        self._mesh = MeshCCD(self._elements, groups=Groups(ids, meets))
        self._widest = max(sum(d) for d in self._distance.values())
        self._of_vertex = _incidence(self._elements.ravel(), np.arange(len(self._elements)), 3)
        keys = {tuple(edge): i for i, edge in enumerate(np.sort(self._mesh.edges).tolist())}
        sides = np.sort(self._elements[:, [[0, 1], [1, 2], [2, 0]]]).reshape(-1, 2)
        numbers = np.array([keys[tuple(side)] for side in sides.tolist()])
        self._of_edge = _incidence(numbers, np.arange(len(self._elements)), 3)

    def check(self, x_t0: NDArray[np.float64], x_t1: NDArray[np.float64]) -> list[Contacts]:
        frame = self._mesh.find(x_t0, x_t1, self._widest)
        rows = self._triangle_pairs(frame.vf, frame.ee)
        out = []
        for (a, b), (touching, more) in self._distance.items():
            mine = rows[(self._flex[rows[:, 0]] == a) & (self._flex[rows[:, 1]] == b)]
            if not len(mine):
                continue
            ids, values, _ = simplices(x_t0, x_t1, self._elements, self._elements, mine, touching)
            parts = [(ids, values)]
            if more > 0:
                far = mine[~(mine[:, None] == ids[None, :, :2]).all(axis=2).any(axis=1)]
                ids, values, _ = simplices(
                    x_t0, x_t1, self._elements, self._elements, far, touching + more
                )
                values[:, 1] += more
                parts.append((ids, values))
            for ids, values in parts:
                feature = ids[:, :2] - np.array([self._first[a], self._first[b]], dtype=np.int32)
                none = np.full((len(ids), 2), -1, dtype=np.int32)
                number = np.broadcast_to(np.array([a, b], dtype=np.int32), (len(ids), 2))
                out.append(_contacts(none, number, feature, values))
        return out

    def _triangle_pairs(self, vf: Index, ee: Index) -> Index:
        """Pairs of triangles around the vertex-face and edge-edge pairs, without a common body."""
        of_vertex, faces = _expand(self._of_vertex, vf[:, 0], vf[:, 1])
        one, rest = _expand(self._of_edge, ee[:, 0], ee[:, 1])
        other, one = _expand(self._of_edge, rest, one)
        rows = np.concatenate([np.stack([of_vertex, faces], 1), np.stack([one, other], 1)])
        rows = np.unique(np.sort(rows, axis=1), axis=0)  # triangles are numbered flex by flex
        a, b = self._bodies[rows[:, 0]], self._bodies[rows[:, 1]]
        joined = (a[:, :, None] == b[:, None, :]).any(axis=(1, 2))
        return np.ascontiguousarray(rows[~joined], dtype=np.int32)


def _incidence(keys: NDArray[Any], values: NDArray[Any], repeat: int) -> tuple[Any, Any]:
    """``start``, and values sorted by key: key k has ``values[start[k]:start[k + 1]]``."""
    order = np.argsort(keys, kind="stable")
    counts = np.bincount(keys)
    start = np.concatenate([[0], np.cumsum(counts)])
    return start, np.repeat(values, repeat)[order]


def _expand(table: tuple[Any, Any], keys: NDArray[Any], beside: NDArray[Any]) -> tuple[Any, Any]:
    """All values of ``keys``, and for each value the entry of ``beside`` for its key."""
    start, values = table
    counts = start[keys + 1] - start[keys]
    offset = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return values[np.repeat(start[keys], counts) + offset], np.repeat(beside, counts)


def _contacts(geom: Any, flex: Any, feature: Any, values: NDArray[np.float64]) -> Contacts:
    return Contacts(values[:, 0], geom, flex, feature, values[:, 2:5], values[:, 5:8], values[:, 1])


def _same(a: State, b: State) -> bool:
    return (
        np.array_equal(a.flexvert_xpos, b.flexvert_xpos)
        and np.array_equal(a.xpos, b.xpos)
        and np.array_equal(a.xmat, b.xmat)
    )
