"""Energy while a guard is at work: what nothing but contacts can have added."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.contacts.guard.balance import Sheet, sheets_of

Array = NDArray[np.float64]

#: Of the kinetic energy at the first guarded contact: so much more than they took may contacts
#: give back.
ALLOWED = 0.01


@dataclass(frozen=True)
class Entry:
    """Energy at the end of a piece of a step [J]."""

    gain: float  #: of all energy in the piece, less the work of drives and applied forces
    kinetic: float  #: at its end


class Account:
    """What contacts gave and took since the guard began to act [J].

    Kinetic energy, gravity, springs and the stretch of flexes are added up; the work of actuators
    and applied forces is not the contacts'. Losses in joints and materials count as taken.

    Args:
        model: MjModel.
        data: MjData that is stepped: after a step with the kinematics of its start.
        end: MjData with the kinematics of the step's end.
    """

    def __init__(self, model: Any, data: Any, end: Any) -> None:
        """Closed, until :meth:`open`."""
        self._model, self._data, self._end = model, data, end
        self._sheets: list[Sheet] = sheets_of(model)
        self.balance, self.allowed = 0.0, 0.0

    def open(self, velocity: Array) -> None:
        """Start anew, from this velocity (nv,) at the start of the step that was just made."""
        self.balance, self.allowed = 0.0, ALLOWED * self._kinetic(self._data, velocity)

    def entry(self, velocity: Array, length: float, x_t1: Array) -> Entry:
        """Of the last piece, which began at ``velocity`` (nv,) and ended at vertices ``x_t1``."""
        model, data, end = self._model, self._data, self._end
        mujoco.mj_comPos(model, end)
        if model.ntendon:
            mujoco.mj_tendon(model, end)
        mujoco.mj_makeM(model, end)
        kinetic = self._kinetic(end, data.qvel)
        before = self._kinetic(data, velocity) + self._potential(data, data.flexvert_xpos)
        mean = 0.5 * (velocity + data.qvel)
        driven = length * float((data.qfrc_actuator + data.qfrc_applied) @ mean)
        driven += length * self._pushed(mean)
        return Entry(kinetic + self._potential(end, x_t1) - before - driven, kinetic)

    def overdrawn(self, entry: Entry) -> bool:
        """Whether that piece gives back more than was taken."""
        return entry.gain > 0 and self.balance + entry.gain > self.allowed

    def book(self, entry: Entry) -> None:
        """Enter a piece that stands."""
        self.balance += entry.gain

    def _kinetic(self, data: Any, velocity: Array) -> float:
        momentum = np.zeros_like(velocity)
        mujoco.mj_mulM(self._model, data, momentum, velocity)
        return 0.5 * float(velocity @ momentum)

    def _potential(self, data: Any, vertices: Array) -> float:
        mujoco.mj_energyPos(self._model, data)
        return float(data.energy[0]) + sum(sheet.energy(vertices) for sheet in self._sheets)

    def _pushed(self, velocity: Array) -> float:
        """Power of forces applied to bodies."""
        data = self._data
        power = 0.0
        jacobian = np.zeros((6, self._model.nv))
        for body in np.flatnonzero(data.xfrc_applied.any(axis=1)).tolist():
            mujoco.mj_jacBodyCom(self._model, data, jacobian[:3], jacobian[3:], body)
            power += float(data.xfrc_applied[body] @ (jacobian @ velocity))
        return power
