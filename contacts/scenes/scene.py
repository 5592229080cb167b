"""A contact scene: a compiled model with its initial state and its control."""

import copy
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from tauguard.arrays import Array

#: Called before every step. Sets ``data.ctrl`` or ``data.qfrc_applied`` as a function of the state.
Control = Callable[[mujoco.MjModel, mujoco.MjData], None]


@dataclass(frozen=True)
class ContactScene:
    """One contact scene. A builder that is called with the same arguments gives the same bits."""

    name: str
    model: mujoco.MjModel
    qpos: Array  #: initial positions, shape (nq,)
    qvel: Array  #: initial velocities, shape (nv,)
    seconds: float = 1.0  #: duration until all contacts of interest have happened [s]
    control: Control | None = None

    def start(self, timestep: float | None = None) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """A copy of the model, with ``timestep`` [s] if given, and data in the initial state.

        Raises:
            ValueError: a timestep that is not above 0 or not finite.
        """
        model = copy.copy(self.model)
        if timestep is not None:
            if not 0 < timestep < np.inf:
                raise ValueError(f"timestep {timestep}: expected seconds above 0")
            model.opt.timestep = timestep
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = self.qpos, self.qvel
        mujoco.mj_forward(model, data)
        return model, data
