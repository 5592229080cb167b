"""The pairs of geoms and flexes that MuJoCo tests in a compiled model.

The rules are those of the chapter "Collision detection: selection" of MuJoCo's manual. Explicit
pairs are always tested. Other pairs are tested if their masks agree and their two bodies are not
welded together, not excluded, not both immovable, and not parent and child (unless the parent is
the world).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.contacts.checker import Index, geom_kinds
from tauguard.findings import ArgumentError

#: Kinds that MuJoCo never tests against each other.
_NEVER = ({"plane"}, {"plane", "hfield"}, {"hfield"})


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs that may touch.

    Attributes:
        first: Ids of geoms; of flexes for pairs of two flexes. Shape (P,).
        second: Ids of geoms; of flexes for pairs with a flex. Shape (P,).
        margin: Distance below which a force acts. Shape (P,), m.
        gap: MuJoCo lists contacts at distances up to margin + gap. Shape (P,), m.
    """

    first: Index
    second: Index
    margin: Array
    gap: Array

    def __len__(self) -> int:
        return len(self.first)

    def where(self, rows: NDArray[Any]) -> Pairs:
        """The pairs of ``rows``, a mask or indices."""
        return Pairs(self.first[rows], self.second[rows], self.margin[rows], self.gap[rows])

    def reach(self, threshold: str) -> Array:
        """Largest distance that ``threshold`` (see ``RigidChecker``) counts as a contact [m]."""
        zero = np.zeros(len(self))
        reach = {"surface": zero, "margin": self.margin, "gap": self.margin + self.gap}
        if threshold not in reach:
            raise ArgumentError(f"threshold {threshold!r}: expected one of {', '.join(reach)}")
        return np.asarray(np.maximum(reach[threshold], 0.0), dtype=np.float64)


def geom_pairs(model: Any) -> Pairs:
    """Pairs of geoms; the geom of lower type, then of lower id, is first, as in MuJoCo."""
    if _disabled(model):
        return _pairs(model, [])
    kinds = geom_kinds(model)
    explicit = {}
    for i in range(model.npair):
        key = _ordered(model, int(model.pair_geom1[i]), int(model.pair_geom2[i]))
        explicit[key] = (*key, float(model.pair_margin[i]), float(model.pair_gap[i]))
    first, second = _dynamic(model)
    chosen = dict(explicit)
    for i, j in zip(first.tolist(), second.tolist(), strict=True):
        key = _ordered(model, i, j)
        margin = float(model.geom_margin[i] + model.geom_margin[j])
        gap = float(model.geom_gap[i] + model.geom_gap[j])
        chosen.setdefault(key, (*key, margin, gap))
    rows = [row for row in chosen.values() if {kinds[row[0]], kinds[row[1]]} not in _NEVER]
    return _pairs(model, sorted(rows))


def geom_flex_pairs(model: Any) -> Pairs:
    """Pairs of a geom (``first``) and a flex (``second``)."""
    rows, listed = [], _listed(model)
    for f in range(0 if _disabled(model) else model.nflex):
        for g in np.flatnonzero(listed).tolist():
            body = int(model.geom_bodyid[g])
            if _masks(model.geom_contype, model.geom_conaffinity, g, model, f) and _masks(
                model.body_contype, model.body_conaffinity, body, model, f
            ):
                margin = float(model.geom_margin[g] + model.flex_margin[f])
                rows.append((g, f, margin, float(model.geom_gap[g] + model.flex_gap[f])))
    return _pairs(model, rows)


def flex_pairs(model: Any) -> Pairs:
    """Pairs of flexes, including flexes with themselves (at margin 0)."""
    rows = []
    for f in range(0 if _disabled(model) else model.nflex):
        own = int(model.flex_contype[f]) & int(model.flex_conaffinity[f])
        if own and model.flex_selfcollide[f] and not model.flex_rigid[f]:
            rows.append((f, f, 0.0, 0.0))
        for g in range(f + 1, model.nflex):
            if _masks(model.flex_contype, model.flex_conaffinity, f, model, g):
                margin = float(model.flex_margin[f] + model.flex_margin[g])
                rows.append((f, g, margin, float(model.flex_gap[f] + model.flex_gap[g])))
    pairs = _pairs(model, rows)
    own_rows = pairs.first == pairs.second
    return Pairs(pairs.first, pairs.second, np.where(own_rows, 0.0, pairs.margin), pairs.gap)


def _dynamic(model: Any) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of geoms (i < j) that the rules on bodies and masks allow."""
    i, j = np.triu_indices(model.ngeom, 1)
    body = model.geom_bodyid.astype(np.int64)
    weld = model.body_weldid[body]
    parent = model.body_weldid[model.body_parentid[weld]]
    movable = model.body_dofnum[weld] > 0
    allowed = (weld[i] != weld[j]) & (movable[i] | movable[j])
    if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
        related = (weld[i] == parent[j]) | (weld[j] == parent[i])
        allowed &= ~(related & (weld[i] != 0) & (weld[j] != 0))
    low, high = np.minimum(body[i], body[j]), np.maximum(body[i], body[j])
    allowed &= ~np.isin((low << 16) + high, _excluded(model))
    # MuJoCo first compares the masks of bodies: at compilation, those of their geoms together.
    for contype, conaffinity, a, b in (
        (model.geom_contype, model.geom_conaffinity, i, j),
        (model.body_contype, model.body_conaffinity, body[i], body[j]),
    ):
        allowed &= ((contype[a] & conaffinity[b]) | (contype[b] & conaffinity[a])) != 0
    listed = _listed(model)
    allowed &= listed[i] & listed[j]
    return i[allowed], j[allowed]


def _listed(model: Any) -> NDArray[np.bool_]:
    """Whether MuJoCo tests the geom: its trees of bodies lack geoms compiled with both masks 0."""
    out = np.ones(model.ngeom, dtype=bool)
    if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_MIDPHASE:
        out[model.body_geomnum[model.geom_bodyid] > 1] = False
        for begin, count in zip(model.body_bvhadr, model.body_bvhnum, strict=True):
            nodes = model.bvh_nodeid[begin : begin + count]
            out[nodes[nodes >= 0]] = True
    return out


def _excluded(model: Any) -> NDArray[np.int64]:
    """Signatures that MuJoCo excludes: of an unsorted list, those above all before them.

    MuJoCo reads the list once, beside its sorted pairs of bodies, and stops at the first signature
    that is not below that of the pair.
    """
    listed = model.exclude_signature.astype(np.int64)
    before = np.maximum.accumulate(np.r_[-1, listed])[:-1]
    return np.asarray(listed[listed > before])


def _ordered(model: Any, a: int, b: int) -> tuple[int, int]:
    key = sorted((a, b), key=lambda g: (int(model.geom_type[g]), g))
    return key[0], key[1]


def _masks(contype: Any, conaffinity: Any, i: int, model: Any, flex: int) -> bool:
    return bool(
        int(contype[i]) & int(model.flex_conaffinity[flex])
        or int(model.flex_contype[flex]) & int(conaffinity[i])
    )


def _disabled(model: Any) -> bool:
    off = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    return bool(model.opt.disableflags & off)


def _pairs(model: Any, rows: list[tuple[int, int, float, float]]) -> Pairs:
    table = np.array(rows, dtype=np.float64).reshape(-1, 4)
    margin = np.ascontiguousarray(table[:, 2])
    if model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_OVERRIDE:
        margin = np.full(len(rows), float(model.opt.o_margin))
    return Pairs(table[:, 0].astype(np.int32), table[:, 1].astype(np.int32), margin, table[:, 3])
