"""How much energy did a simulation gain? Measured from its states, without the guard's own account.

The elastic energy of sheets is the one formula shared with the package, because MuJoCo has no
energy of its own for them.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from tauguard.contacts.guard.energy_budget import sheets_of

#: Energy over the unit above which a simulation counts as diverged.
DIVERGED = 1e6


def energies(model: Any, data: Any, scratch: Any = None) -> tuple[float, float]:
    """Potential and elastic energy together, and kinetic energy [J]; ``data`` is not changed.

    Args:
        model: MjModel.
        data: MjData; only positions, velocities and mocap poses are read.
        scratch: MjData to compute in; made where it is not given.
    """
    scratch = mujoco.MjData(model) if scratch is None else scratch
    scratch.qpos[:], scratch.qvel[:] = data.qpos, data.qvel
    scratch.mocap_pos[:], scratch.mocap_quat[:] = data.mocap_pos, data.mocap_quat
    mujoco.mj_kinematics(model, scratch)
    mujoco.mj_comPos(model, scratch)
    if model.nflex:
        mujoco.mj_flex(model, scratch)
    if model.ntendon:
        mujoco.mj_tendon(model, scratch)
    mujoco.mj_makeM(model, scratch)
    mujoco.mj_energyPos(model, scratch)
    mujoco.mj_energyVel(model, scratch)
    elastic = sum(sheet.energy(scratch.flexvert_xpos) for sheet in sheets_of(model))
    return float(scratch.energy[0]) + elastic, float(scratch.energy[1])


class EnergyGain:
    """The largest energy of a simulation so far.

    Attributes:
        most: Largest total energy, less the potential and elastic energy of the first state,
            divided by :attr:`unit`. Infinite once the simulation has diverged. Not measured (1)
            in models with actuators, which may add energy.
        unit: ``unit``, or the kinetic energy of the first state [J].

    Args:
        model: MjModel.
        data: MjData in the first state.
        unit: Energy to divide by [J]; the kinetic energy of the first state where it is not given.
    """

    def __init__(self, model: Any, data: Any, unit: float | None = None) -> None:
        """Measure the first state."""
        self._model, self._scratch = model, mujoco.MjData(model)
        self._start, kinetic = energies(model, data, self._scratch)
        self.unit, self.most = kinetic if unit is None else unit, 1.0

    def observe(self, data: Any) -> None:
        """Measure one more state."""
        if not np.isfinite(data.qpos).all() or self.most > DIVERGED:
            self.most = np.inf
        elif not self._model.nu:
            total = sum(energies(self._model, data, self._scratch)) - self._start
            self.most = max(self.most, total / self.unit)
