"""Bodies attached to mocap bodies: velocities for impact zones, and equality constraints."""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array


class MocapVelocityField:
    """The mean velocity, over a sub-step, of the bodies attached to mocap bodies.

    Args:
        model: MjModel.
        data: MjData with the kinematics of the sub-step's start and the mocap poses of its end.
        length: Length of the sub-step [s].
    """

    def __init__(self, model: Any, data: Any, length: float) -> None:
        """Read both poses of every mocap body."""
        self._carrier = model.body_mocapid[model.body_rootid]
        self._start, self._step = [], []
        self._length = length
        for body in np.flatnonzero(model.body_mocapid >= 0).tolist():
            number = int(model.body_mocapid[body])
            unit, turn = data.mocap_quat[number].copy(), np.zeros(3)
            mujoco.mju_normalize4(unit)
            mujoco.mju_subQuat(turn, unit, data.xquat[body])  # in the frame of the body
            turn = data.xmat[body].reshape(3, 3) @ turn
            self._start.append((number, data.xpos[body].copy()))
            self._step.append((data.mocap_pos[number] - data.xpos[body], turn))

    def velocity(self, body: int, point: Array) -> Array:
        """Linear velocity at a point of a body, then angular velocity, due to mocap. Shape (6,)."""
        carrier = int(self._carrier[body])
        out = np.zeros(6)
        for (number, start), (shift, turn) in zip(self._start, self._step, strict=True):
            if number == carrier:
                arm, turned = point - start, np.zeros(3)
                angle, quat = float(np.linalg.norm(turn)), np.zeros(4)
                axis = turn / angle if angle else np.array([1.0, 0, 0])
                mujoco.mju_axisAngle2Quat(quat, axis, angle)
                mujoco.mju_rotVecQuat(turned, arm, quat)
                out[:3], out[3:] = shift + turned - arm, turn
        return out / self._length


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
