"""Frames of geoms on the bodies that move them.

A body without joints moves rigidly with its parent. So a geom's path in a step is that of the
nearest body above it that has joints, is a mocap body, or is a child of the world: its `mover`. A
straight line between the origins of the geom's own body would leave the arc of a rotating mover.
"""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array


def movers(model: Any) -> NDArray[np.int32]:
    """The mover of each body. Shape (nbody,)."""
    out = np.arange(model.nbody, dtype=np.int32)
    parents = model.body_parentid
    carried = (model.body_jntnum == 0) & (model.body_mocapid < 0) & (parents > 0)
    for body in np.flatnonzero(carried).tolist():  # a parent's number is below its child's
        out[body] = out[parents[body]]
    return out


def frame_on_mover(model: Any, geom: int) -> tuple[int, Array, Array]:
    """The geom's mover, and position (3,) [m] and rotation (9,) of the geom relative to it.

    They are those of MuJoCo's kinematics: if the compiled geom has the frame of its body or of the
    body's inertia (``geom_sameframe``), MuJoCo ignores ``geom_pos`` and ``geom_quat``.
    """
    kinds, same = mujoco.mjtSameFrame, int(model.geom_sameframe[geom])
    body = int(model.geom_bodyid[geom])
    pos, quat = model.geom_pos[geom], model.geom_quat[geom]
    if same == kinds.mjSAMEFRAME_BODY:
        pos = np.zeros(3)
    elif same == kinds.mjSAMEFRAME_INERTIA:
        pos = model.body_ipos[body]
    if same in (kinds.mjSAMEFRAME_BODY, kinds.mjSAMEFRAME_BODYROT):
        quat = np.array([1.0, 0, 0, 0])
    elif same in (kinds.mjSAMEFRAME_INERTIA, kinds.mjSAMEFRAME_INERTIAROT):
        quat = model.body_iquat[body]
    mat, mover = _matrix(quat), int(movers(model)[body])
    while body != mover:
        unit = model.body_quat[body].copy()
        mujoco.mju_normalize4(unit)  # as MuJoCo's kinematics do; compiled ones may lack unit length
        turn = _matrix(unit)
        pos, mat = model.body_pos[body] + turn @ pos, turn @ mat
        body = int(model.body_parentid[body])
    return mover, np.ascontiguousarray(pos, dtype=np.float64), mat.ravel()


def _matrix(quat: Array) -> Array:
    mat = np.zeros(9)
    mujoco.mju_quat2Mat(mat, np.asarray(quat, dtype=np.float64))
    return mat.reshape(3, 3)
