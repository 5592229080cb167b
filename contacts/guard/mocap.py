"""Equality constraints on bodies attached to mocap bodies."""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray


def pulled(model: Any) -> NDArray[np.uint8]:
    """For each equality constraint, whether it acts on a body attached to a mocap body."""
    carried = model.body_mocapid[model.body_rootid] >= 0
    flexes = [bool(carried[_bodies(model, flex)].any()) for flex in range(model.nflex)]
    kinds, objects = mujoco.mjtEq, mujoco.mjtObj
    of_flexes = (kinds.mjEQ_FLEX, kinds.mjEQ_FLEXVERT, kinds.mjEQ_FLEXSTRAIN)
    out = np.zeros(model.neq, dtype=np.uint8)
    for eq in range(model.neq):
        ends = (int(model.eq_obj1id[eq]), int(model.eq_obj2id[eq]))
        if int(model.eq_type[eq]) in of_flexes:
            out[eq] = flexes[ends[0]]
        elif model.eq_objtype[eq] == objects.mjOBJ_BODY:
            out[eq] = carried[list(ends)].any()
        elif model.eq_objtype[eq] == objects.mjOBJ_SITE:
            out[eq] = carried[model.site_bodyid[list(ends)]].any()
    return out


def _bodies(model: Any, flex: int) -> NDArray[np.int32]:
    """Bodies of the vertices and nodes of a flex."""
    vertices = model.flex_vertadr[flex] + np.arange(model.flex_vertnum[flex])
    nodes = model.flex_nodeadr[flex] + np.arange(model.flex_nodenum[flex])
    bodies = np.concatenate([model.flex_vertbodyid[vertices], model.flex_nodebodyid[nodes]])
    return np.asarray(bodies[bodies >= 0], dtype=np.int32)
