"""The pairs that may touch by MuJoCo's rules, implemented independently of contacts/pairs.py."""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.int32]


def geom_pairs(model: Any) -> Index:
    """Ids of the geoms that may touch, the smaller id first. Shape (P, 2)."""
    explicit = {tuple(sorted(p)) for p in zip(model.pair_geom1, model.pair_geom2, strict=True)}
    excluded = {(int(e) >> 16, int(e) & 0xFFFF) for e in model.exclude_signature}
    weld, parent = model.body_weldid, model.body_parentid
    filter_parents = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    found = []
    for i in range(model.ngeom):
        for j in range(i + 1, model.ngeom):
            if (i, j) in explicit:
                found.append((i, j))
                continue
            bodies = int(model.geom_bodyid[i]), int(model.geom_bodyid[j])
            a, b = int(weld[bodies[0]]), int(weld[bodies[1]])
            above = int(weld[parent[a]]), int(weld[parent[b]])
            related = filter_parents and a and b and (a == above[1] or b == above[0])
            if a == b or related or tuple(sorted(bodies)) in excluded:
                continue
            if meet(model.geom_contype, model.geom_conaffinity, i, j):
                found.append((i, j))
    return np.array(found, dtype=np.int32).reshape(-1, 2)


def meet(contype: Any, conaffinity: Any, i: int, j: int) -> bool:
    """Whether the collision bits of two geoms allow contacts."""
    return bool(contype[i] & conaffinity[j] or contype[j] & conaffinity[i])


def flex_geoms(model: Any, flex: int) -> list[int]:
    """Geoms that the flex may touch."""
    kind, affinity = int(model.flex_contype[flex]), int(model.flex_conaffinity[flex])
    return [
        g
        for g in range(model.ngeom)
        if kind & int(model.geom_conaffinity[g]) or affinity & int(model.geom_contype[g])
    ]
