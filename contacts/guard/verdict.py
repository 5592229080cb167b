"""What a step would let through: every covered pair, judged by its cores."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.cloth import Groups, MeshCCD
from tauguard.contacts._contacts import Judge, carried
from tauguard.contacts.checker import geom_kinds
from tauguard.contacts.geoms import CONVEX
from tauguard.contacts.guard.cores import Cores
from tauguard.contacts.guard.stiffening import Pair
from tauguard.contacts.pairs import flex_pairs, geom_flex_pairs, geom_pairs

Array = NDArray[np.float64]

#: Layers taken off both partners, as shares of half their thickness. Where the cores of the last
#: level never meet, the pair cannot have passed through itself anywhere.
LEVELS = (0.0, 0.5, 0.75, 0.95)
#: Of geoms against flexes there is one more level, no deeper than this many radii of the flex:
#: MuJoCo pushes a cloth's triangles out of a geom each by its own shortest way.
NEAR_FLEX = 4.0

_POSE = int(
    mujoco.mjtState.mjSTATE_QPOS
    | mujoco.mjtState.mjSTATE_MOCAP_POS
    | mujoco.mjtState.mjSTATE_MOCAP_QUAT
)


@dataclass(frozen=True)
class Hit:
    """A pair that a step would take deeper than it may, or past a contact."""

    pair: Pair
    passed: bool  #: its last cores met: the pair would have passed through itself
    lost: bool  #: they met at the start already, and had been apart: it is followed no longer
    brushed: bool  #: it touched and parted again within the step, no cores met
    time: float  #: when it first touches, as a share of the step; 0 if it did at the start
    way: float  #: no two of its points approach each other further in the step [m]
    vertices: NDArray[np.int32]  #: of flexes, that took part; empty for two geoms


class Verdict:
    """Judges steps of one scene.

    Attributes:
        pairs: Those that are covered, but flexes against flexes.
        end: MjData with the kinematics of the end of the step that was judged last.
        x_t1: Vertices of all flexes then. Shape (nflexvert, 3), m.

    Args:
        model: MjModel.
        data: The MjData that is stepped. After ``mj_step`` its kinematics are still those that the
            step began with; the end's are computed in an MjData of our own.
        rigid: Whether geoms against geoms are covered.
        cloth: Whether flexes are covered, against geoms, one another and themselves.
    """

    def __init__(self, model: Any, data: Any, rigid: bool = True, cloth: bool = True) -> None:
        """Choose the pairs and copy the shapes, at every level."""
        self._model, self._data = model, data
        self.end = mujoco.MjData(model)
        self._still = bool(model.nflex) and not model.flex_interp.any()
        self._x_t0 = data.flexvert_xpos if model.nflex else np.zeros((0, 3))
        self.x_t1 = np.zeros_like(self._x_t0)
        end = self.end
        self._judge = Judge(data.xpos, data.xmat, end.xpos, end.xmat, self._x_t0, self.x_t1)
        kinds = geom_kinds(model)
        self._cores = Cores(model, kinds, self._judge)
        self._known = np.isin(kinds, CONVEX)
        self.pairs: list[Pair] = []
        self._elements: list[NDArray[np.int32]] = []
        if rigid:
            self._add_rigid(kinds)
        self._first_flex = len(self.pairs)
        if cloth:
            self._add_flexes()
        self._sheets = _Sheets(model) if cloth and len(flex_pairs(model)) else None

    def judge(self) -> list[Hit]:
        """What the step that ``data`` has just made lets through."""
        end = self.end
        mujoco.mj_copyState(self._model, self._data, end, _POSE)
        mujoco.mj_kinematics(self._model, end)
        if self._model.nflex:
            self._carry()
        found = self._judge.judge()
        hits = [] if found is None else self._hits(*found)
        if self._sheets is not None:
            hits += self._sheets.crossings(self._x_t0, self.x_t1)
        return hits

    def _carry(self) -> None:
        """The flexes' vertices at the end of the step."""
        model, end = self._model, self.end
        if self._still:
            bodies, local = model.flex_vertbodyid, model.flex_vert
            self.x_t1[:] = carried(end.xpos, end.xmat, bodies, local)
            return
        mujoco.mj_comPos(model, end)
        mujoco.mj_flex(model, end)
        self.x_t1[:] = end.flexvert_xpos

    def _hits(self, ids: NDArray[np.int32], values: Array) -> list[Hit]:
        """One hit a pair: of the simplices of a flex the earliest and the deepest count."""
        hits = []
        for number in np.unique(ids[:, 0]).tolist():
            rows = ids[:, 0] == number
            flex = number >= self._first_flex
            last = len(LEVELS) - (0 if flex else 1)
            corners = np.zeros(0, dtype=np.int32)
            if flex:
                elements = self._elements[number - self._first_flex]
                deep = rows & (ids[:, 3] == ids[rows, 3].max())
                corners = np.unique(elements[ids[deep, 1]])
            hits.append(
                Hit(
                    self.pairs[number],
                    bool((ids[rows, 3] == last).any()),
                    bool((ids[rows, 3] > last).any()),
                    bool((ids[rows, 2] == 0).all()),
                    float(values[rows, 0].min()),
                    float(values[rows, 1].max()),
                    corners,
                )
            )
        return hits

    def _add_rigid(self, kinds: list[str]) -> None:
        pairs = geom_pairs(self._model)
        for a, b in zip(pairs.first.tolist(), pairs.second.tolist(), strict=True):
            if not (self._known[a] and self._known[b]):
                continue
            rows = [
                np.array([self._cores.add(g, level * self._cores.radius(g)) for level in LEVELS])
                for g in (a, b)
            ]
            self._judge.pair(rows[0].astype(np.int32), rows[1].astype(np.int32))
            self.pairs.append((("geom", min(a, b)), ("geom", max(a, b))))

    def _add_flexes(self) -> None:
        model, pairs = self._model, geom_flex_pairs(self._model)
        for geom, flex in zip(pairs.first.tolist(), pairs.second.tolist(), strict=True):
            if not self._known[geom]:
                continue
            own, thick = float(model.flex_radius[flex]), self._cores.radius(geom)
            near = min(thick, NEAR_FLEX * own)
            layers = [0.0, 0.5 * near, *(level * thick for level in LEVELS[1:])]
            radii = [own * (1 - level) for level in (0.0, 0.5, *LEVELS[1:])]
            elements = _elements(model, flex)
            bodies = model.flex_vertbodyid[elements]
            hangs = (bodies == int(model.geom_bodyid[geom])).any(axis=1).astype(np.uint8)
            cores = np.array([self._cores.add(geom, layer) for layer in layers], dtype=np.int32)
            self._judge.flex_pair(cores, np.array(radii), elements, hangs)
            self.pairs.append((("flex", flex), ("geom", geom)))
            self._elements.append(elements)


class _Sheets:
    """Flexes of triangles against one another and themselves: middles that cross."""

    def __init__(self, model: Any) -> None:
        pairs = flex_pairs(model)
        meets = np.zeros((model.nflex, model.nflex), dtype=bool)
        for a, b in zip(pairs.first.tolist(), pairs.second.tolist(), strict=True):
            meets[a, b] = meets[b, a] = model.flex_dim[a] == model.flex_dim[b] == 2
        chosen = np.flatnonzero(meets.any(axis=1))
        self._mesh = None
        if len(chosen):
            elements = np.concatenate([_elements(model, int(f)) for f in chosen])
            ids = np.repeat(np.arange(model.nflex), model.flex_vertnum)
            self._mesh, self._flex = MeshCCD(elements, groups=Groups(ids, meets)), ids

    def crossings(self, x_t0: Array, x_t1: Array) -> list[Hit]:
        """A hit for every vertex and face, and every two edges, that cross in the step."""
        if self._mesh is None:
            return []
        frame = self._mesh.find(x_t0, x_t1)
        faces, edges = self._mesh.faces, self._mesh.edges
        rows = [(np.array([v]), faces[f]) for v, f in frame.vf]
        rows += [(edges[e], edges[g]) for e, g in frame.ee]
        if not rows:
            return []
        travel = 2 * float(np.linalg.norm(x_t1 - x_t0, axis=1).max())
        return [self._hit(np.concatenate(row).astype(np.int32), travel) for row in rows]

    def _hit(self, corners: NDArray[np.int32], travel: float) -> Hit:
        first, second = sorted((int(self._flex[corners[0]]), int(self._flex[corners[-1]])))
        return Hit((("flex", first), ("flex", second)), True, False, False, 0.0, travel, corners)


def _elements(model: Any, flex: int) -> NDArray[np.int32]:
    """The simplices of a flex by the vertices of all flexes. Shape (E, corners)."""
    corners = int(model.flex_dim[flex]) + 1
    start, count = int(model.flex_elemdataadr[flex]), int(model.flex_elemnum[flex])
    local = model.flex_elem[start : start + corners * count].reshape(-1, corners)
    return np.ascontiguousarray(local + model.flex_vertadr[flex], dtype=np.int32)


def names(covers: Sequence[str]) -> tuple[bool, bool]:
    """Whether ``rigid`` and ``cloth`` are among the covered kinds of pairs.

    Raises:
        ValueError: another name.
    """
    for one in covers:
        if one not in ("rigid", "cloth"):
            raise ValueError(f"checker {one!r}: a guard covers rigid and cloth")
    return "rigid" in covers, "cloth" in covers
