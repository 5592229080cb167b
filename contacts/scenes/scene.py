"""A contact scene: a compiled model with its initial state, and position control of its arms."""

import copy
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.findings import ArgumentError

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
            ArgumentError: a timestep that is not above 0 or not finite.
        """
        model = copy.copy(self.model)
        if timestep is not None:
            if not 0 < timestep < np.inf:
                raise ArgumentError(f"timestep {timestep}: expected seconds above 0")
            model.opt.timestep = timestep
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = self.qpos, self.qvel
        mujoco.mj_forward(model, data)
        return model, data


#: Reference positions and velocities at a time: ``reference(t) -> (q, qd)``, rad and rad/s.
Reference = Callable[[float], tuple[Array, Array]]
#: Natural frequency of every joint's control loop [rad/s].
BANDWIDTH = 25.0


def turn(home: Array, joint: int, speed: float, reach: float) -> Reference:
    """One joint turns at ``speed`` [rad/s] by ``reach`` [rad] and stays there."""

    def reference(t: float) -> tuple[Array, Array]:
        q, qd = home.copy(), np.zeros_like(home)
        moving = abs(speed * t) < abs(reach)
        q[joint] += speed * t if moving else np.copysign(reach, speed)
        qd[joint] = speed if moving else 0.0
        return q, qd

    return reference


def sway(home: Array, joints: NDArray[Any], amplitude: Array, period: float) -> Reference:
    """The chosen joints swing about ``home`` by ``amplitude`` [rad] with ``period`` [s]."""
    rate = 2 * np.pi / period

    def reference(t: float) -> tuple[Array, Array]:
        q, qd = home.copy(), np.zeros_like(home)
        q[joints] += amplitude * np.sin(rate * t)
        qd[joints] = amplitude * rate * np.cos(rate * t)
        return q, qd

    return reference


def driven(
    name: str, model: mujoco.MjModel, seconds: float, moves: list[tuple[tuple[str, ...], Reference]]
) -> ContactScene:
    """The contact scene of ``model`` in which the named joints of each arm follow a reference."""
    qpos, qvel, arms = model.qpos0.copy(), np.zeros(model.nv), []
    for names, reference in moves:
        joints = [model.joint(joint) for joint in names]
        places = np.array([joint.qposadr[0] for joint in joints])
        dofs = np.array([joint.dofadr[0] for joint in joints])
        qpos[places], qvel[dofs] = reference(0.0)
        arms.append((places, dofs, reference))
    return ContactScene(name, model, qpos, qvel, seconds, follow(model, qpos, arms))


def follow(
    model: mujoco.MjModel, qpos: Array, arms: list[tuple[NDArray[Any], NDArray[Any], Reference]]
) -> Control:
    """Position control with gravity compensation, written into ``qfrc_applied``.

    Args:
        model: Model of the whole scene.
        qpos: Pose whose inertia sets the gains, shape (nq,).
        arms: For each arm the indices in qpos and in qvel, and the reference.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    stiffness = BANDWIDTH**2 * np.diag(mass)
    damping = 2 * BANDWIDTH * np.diag(mass)

    def control(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        for places, dofs, reference in arms:
            q, qd = reference(data.time)
            data.qfrc_applied[dofs] = (
                data.qfrc_bias[dofs]
                + stiffness[dofs] * (q - data.qpos[places])
                + damping[dofs] * (qd - data.qvel[dofs])
            )

    return control
