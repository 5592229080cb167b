"""Energy and momentum of a scene, before and after."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array


@dataclass(frozen=True)
class EnergyBalance:
    """Energy and momentum of all moving bodies before and after a step."""

    energy: Array
    """Before and after (rows): of position as MuJoCo counts it (gravity, springs), kinetic, and of
    the stretch of elastic flexes, which MuJoCo leaves out. Shape (2, 3), J."""
    momentum: Array  #: linear, before and after, shape (2, 3) [N s]


class EnergyMeter:
    """Computes :class:`EnergyBalance` on data of its own.

    Args:
        model: the scene's.
    """

    def __init__(self, model: Any) -> None:
        """Make an MjData to work in, and the sheets' stiffness."""
        self._model, self._data = model, mujoco.MjData(model)
        self._sheets = sheets_of(model)

    def between(self, first: Array, last: Array) -> EnergyBalance:
        """From one state (``mjSTATE_INTEGRATION``) to another."""
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
    """The elastic flexes of triangles."""
    return [
        Sheet(model, flex)
        for flex in range(model.nflex)
        if model.flex_dim[flex] == 2 and model.flex_stiffnessadr[flex] >= 0
    ]


class Sheet:
    """The stretch energy of one elastic flex of triangles (St. Venant-Kirchhoff).

    With e the change of an element's three squared edge lengths and K its stiffness, the energy is
    e K e / 4, whose gradient is MuJoCo's spring force.
    """

    def __init__(self, model: Any, flex: int) -> None:
        """Copy the elements' edges and stiffness."""
        elements, edges = int(model.flex_elemnum[flex]), int(model.flex_edgeadr[flex])
        begin, place = int(model.flex_elemedgeadr[flex]), int(model.flex_stiffnessadr[flex])
        own = model.flex_elemedge[begin : begin + 3 * elements].reshape(-1, 3) + edges
        self._ends = model.flex_edge[own] + int(model.flex_vertadr[flex])
        self._rest = model.flexedge_length0[own] ** 2
        packed = model.flex_stiffness[place : place + 21 * elements].reshape(-1, 21)
        upper = np.triu_indices(3)
        self._stiffness = np.zeros((elements, 3, 3))
        self._stiffness[:, upper[0], upper[1]] = packed[:, :6]
        self._stiffness[:, upper[1], upper[0]] = packed[:, :6]

    def rows(self) -> tuple[NDArray[np.int32], Array, Array]:
        """Ends of each element's edges, their squares at rest and the stiffness, all flat."""
        ends = np.ascontiguousarray(self._ends, dtype=np.int32).ravel()
        return ends, np.ascontiguousarray(self._rest).ravel(), self._stiffness.ravel()

    def energy(self, vertices: Array) -> float:
        """At these positions [J]."""
        edges = vertices[self._ends[..., 0]] - vertices[self._ends[..., 1]]
        change = (edges**2).sum(axis=-1) - self._rest
        return float(np.einsum("ki,kij,kj->", change, self._stiffness, change)) / 4
