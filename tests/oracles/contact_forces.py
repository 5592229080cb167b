"""Contact forces of a scene as MuJoCo's own solver has them."""

from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray


def contact_forces(model: Any, data: Any) -> Iterator[tuple[Any, NDArray[np.float64]]]:
    """Each contact, and the force on its second geom in the world's frame [N]."""
    local = np.zeros(6)
    for k in range(data.ncon):
        mujoco.mj_contactForce(model, data, k, local)
        contact = data.contact[k]
        yield contact, contact.frame.reshape(3, 3).T @ local[:3]


def contact_torques(model: Any, data: Any) -> NDArray[np.float64]:
    """The sum of J^T f over all contacts and both of their bodies [N m], shape (nv,)."""
    torques, jacobian = np.zeros(model.nv), np.zeros((3, model.nv))
    for contact, force in contact_forces(model, data):
        for geom, sign in zip(contact.geom, (-1, 1), strict=True):
            body = int(model.geom_bodyid[geom])
            mujoco.mj_jac(model, data, jacobian, None, contact.pos, body)
            torques += sign * jacobian.T @ force
    return torques
