"""The checker ``mujoco``: MuJoCo's own contacts at the end of the step."""

from typing import Any

import mujoco
import numpy as np

from tauguard.contacts.checker import KINDS, Contacts, State, pair_kind


class MujocoChecker:
    """The contacts that MuJoCo's collision detection lists at the end of the step (``time`` 1).

    The next ``mj_step`` would start with these contacts. Distances are those that MuJoCo lists;
    with speculative contacts they are predictions.

    Args:
        model: MjModel.
    """

    name = "mujoco"

    def __init__(self, model: Any) -> None:
        """Allocate an MjData."""
        self._model = model
        self._data = mujoco.MjData(model)
        self._mocap = np.flatnonzero(model.body_mocapid >= 0)
        self._speculative = bool(
            model.opt.enableflags & getattr(mujoco.mjtEnableBit, "mjENBL_SPECULATIVE", 0)
        )
        self.covers = frozenset(
            pair_kind(a, b) for a in KINDS for b in KINDS if {a, b} - {"plane", "hfield"}
        )

    def check(self, before: State, after: State) -> Contacts:
        """The contacts at ``after``; ``before`` is ignored."""
        model, data = self._model, self._data
        data.qpos[:], data.qvel[:] = after.qpos, after.qvel
        for body in self._mocap:
            mocap = model.body_mocapid[body]
            data.mocap_pos[mocap] = after.xpos[body]
            mujoco.mju_mat2Quat(data.mocap_quat[mocap], after.xmat[body])
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_flex(model, data)
        if self._speculative:
            mujoco.mj_comVel(model, data)
        mujoco.mj_collision(model, data)
        return contacts_of(data)


def contacts_of(data: Any) -> Contacts:
    """The list ``data.contact`` as :class:`Contacts`, at time 1."""
    contact = data.contact
    element, vertex = contact.elem, contact.vert
    return Contacts(
        time=np.ones(len(contact.dist)),
        geom=contact.geom.copy(),
        flex=contact.flex.copy(),
        feature=np.where(element >= 0, element, vertex),
        point=contact.pos.copy(),
        normal=contact.frame[:, :3].copy(),
        distance=contact.dist.copy(),
    )
