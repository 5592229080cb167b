"""What became of a scene, seen from outside the guard: what passed through, and the energy."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from studies.contacts.deep import Deep
from tauguard.contacts.guard.balance import sheets_of


class Referee:
    """Follows a scene from state to state.

    Attributes:
        energy: The most that kinetic, potential and elastic energy have been in all, less the
            potential and elastic one of the start, over :attr:`unit`.
        unit: ``given``, or the kinetic energy of the start [J].

    Args:
        model: MjModel.
        data: MjData in the first state.
        given: What energy is measured by [J]; if not given, the kinetic one of the start.
    """

    def __init__(self, model: Any, data: Any, given: float | None = None) -> None:
        """Look at the first state."""
        self._model, self._data = model, data
        self._scratch = mujoco.MjData(model)
        self._sheets = sheets_of(model)
        self._deep = Deep(model, data)
        self.energy, self.diverged = 1.0, False
        self._start, kinetic = self._energies()
        self.unit = kinetic if given is None else given

    @property
    def passed(self) -> bool:
        """Whether something has passed through so far, or the state is lost."""
        return self.diverged or bool(self._deep.passed)

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """Names of the geoms that did."""
        return self._deep.passed

    def look(self) -> None:
        """Follow the way from the state seen last; afterwards, energy is looked at."""
        if not np.isfinite(self._data.qpos).all() or self.energy > 1e6:
            self.diverged, self.energy = True, np.inf
            return
        self._deep.look(self._data)
        if not self._model.nu:
            total = sum(self._energies()) - self._start
            self.energy = max(self.energy, total / self.unit)

    def _energies(self) -> tuple[float, float]:
        """Potential and elastic, and kinetic energy [J]."""
        model, scratch = self._model, self._scratch
        scratch.qpos[:], scratch.qvel[:] = self._data.qpos, self._data.qvel
        scratch.mocap_pos[:], scratch.mocap_quat[:] = self._data.mocap_pos, self._data.mocap_quat
        mujoco.mj_kinematics(model, scratch)
        mujoco.mj_comPos(model, scratch)
        if model.nflex:
            mujoco.mj_flex(model, scratch)
        if model.ntendon:
            mujoco.mj_tendon(model, scratch)
        mujoco.mj_makeM(model, scratch)
        mujoco.mj_energyPos(model, scratch)
        mujoco.mj_energyVel(model, scratch)
        stretch = sum(sheet.energy(scratch.flexvert_xpos) for sheet in self._sheets)
        return float(scratch.energy[0]) + stretch, float(scratch.energy[1])
