"""Energy and momentum of a scene before and after a step."""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.contacts._contacts import Sheet


@dataclass(frozen=True)
class EnergyBalance:
    """Energy and momentum of all moving bodies before and after a step."""

    energy: Array
    """Rows: before and after. Columns: potential energy of MuJoCo (gravity, springs), kinetic
    energy, and the stretch energy of elastic flexes, which MuJoCo leaves out. Shape (2, 3) [J]."""
    momentum: Array  #: linear momentum before and after, shape (2, 3) [N s]


class EnergyMeter:
    """Computes :class:`EnergyBalance` with its own MjData.

    Args:
        model: MjModel.
    """

    def __init__(self, model: Any) -> None:
        """Allocate an MjData, and copy the stiffness of elastic flexes."""
        self._model, self._data = model, mujoco.MjData(model)
        self._sheets = sheets_of(model)

    def between(self, first: Array, last: Array) -> EnergyBalance:
        """The balance between two states, each a vector of ``mjSTATE_INTEGRATION``."""
        rows = [self._read(state) for state in (first, last)]
        return EnergyBalance(np.array([r[0] for r in rows]), np.array([r[1] for r in rows]))

    def _read(self, state: Array) -> tuple[Array, Array]:
        model, data = self._model, self._data
        mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_energyPos(model, data)
        mujoco.mj_energyVel(model, data)
        mujoco.mj_subtreeVel(model, data)
        stretch = sum(sheet.energy(data.flexvert_xpos) for sheet in self._sheets)
        return np.array([*data.energy, stretch]), data.subtree_linvel[0] * model.body_subtreemass[0]


def sheets_of(model: Any) -> list[Sheet]:
    """The elastic two-dimensional flexes, whose stretch energy MuJoCo does not count."""
    return [
        _sheet(model, flex)
        for flex in range(model.nflex)
        if model.flex_dim[flex] == 2 and model.flex_stiffnessadr[flex] >= 0
    ]


def _sheet(model: Any, flex: int) -> Sheet:
    elements, edges = int(model.flex_elemnum[flex]), int(model.flex_edgeadr[flex])
    begin, place = int(model.flex_elemedgeadr[flex]), int(model.flex_stiffnessadr[flex])
    own = model.flex_elemedge[begin : begin + 3 * elements] + edges
    ends = (model.flex_edge[own] + int(model.flex_vertadr[flex])).astype(np.int32).ravel()
    packed = model.flex_stiffness[place : place + 21 * elements].reshape(-1, 21)
    stiffness = packed[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]  # MuJoCo stores the upper triangle
    return Sheet(ends, model.flexedge_length0[own] ** 2, np.ascontiguousarray(stiffness).ravel())
