"""The native plant of a scene: MuJoCo's step, the drives and the servo in one."""

from __future__ import annotations

import ctypes
import functools
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.envs import _plant
from tauguard.models import Drive, Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Gains:
    """Stiffness and damping of the position control, joint by joint."""

    kp: Array  #: [N m/rad], shape (n,)
    kd: Array  #: [N m s/rad], shape (n,)

    @classmethod
    def for_scene(cls, scene: Scene, bandwidth: float = 30.0) -> Gains:
        """Critically damped gains for the arm's inertia in its first pose.

        Args:
            scene: the composed scene.
            bandwidth: natural frequency of every joint's loop [rad/s].
        """
        data = mujoco.MjData(scene.model)
        if scene.model.nkey:
            mujoco.mj_resetDataKeyframe(scene.model, data, 0)
        mujoco.mj_forward(scene.model, data)
        mass = np.zeros((scene.model.nv, scene.model.nv))
        mujoco.mj_fullM(scene.model, data, mass)
        inertia = np.diag(mass)[scene.dof_adr]
        return cls(bandwidth**2 * inertia, 2 * bandwidth * inertia)


@functools.cache
def _library() -> ctypes.CDLL:
    """The MuJoCo library that the Python binding has loaded."""
    folder = Path(mujoco.__file__).parent
    names = [*folder.glob("libmujoco.so*"), *folder.glob("libmujoco*.dylib")]
    if not names:
        raise OSError(f"no MuJoCo library beside its Python binding in {folder.name}")
    return ctypes.CDLL(str(names[0]))


def _address(function: str) -> int:
    address = ctypes.cast(getattr(_library(), function), ctypes.c_void_p).value
    assert address is not None
    return address


def make_plant(scene: Scene, nominal: Drive, gains: Gains, data: mujoco.MjData) -> _plant.Plant:
    """The plant that steps ``data``, which it keeps alive, as well as the scene's model.

    Args:
        scene: the composed scene; ``scene.drive`` is what is simulated.
        nominal: what the controller believes about the drive (its gains).
        gains: of the servo.
        data: of the scene's model.
    """
    model = scene.model
    dt, constant = float(model.opt.timestep), scene.drive.electrical_time_constant
    physics = _plant.Physics(
        model, data, step=_address("mj_step"), kinematics=_address("mj_kinematics")
    )
    decay = float(np.exp(-dt / constant)) if constant else 0.0
    return _plant.Plant(physics, _joints(scene, nominal, gains), dt=dt, decay=decay)


def _joints(scene: Scene, nominal: Drive, gains: Gains) -> list[_plant.Joint]:
    drive = scene.drive
    friction, ripple = drive.friction, drive.ripple
    warm = 0.0 if friction is None else friction.temperature - friction.reference_temperature
    level = 0.0 if friction is None else 1 + friction.coulomb_per_kelvin * warm
    thick = 0.0 if friction is None else 1 + friction.viscous_per_kelvin * warm
    return [
        _plant.Joint(
            qpos=int(scene.qpos_adr[i]),
            dof=int(scene.dof_adr[i]),
            gain=drive.gain[i],
            nominal_gain=nominal.gain[i],
            current_limit=drive.current_limit[i],
            gear=drive.gear[i],
            coulomb=0.0 if friction is None else friction.coulomb[i] * level,
            breakaway=0.0 if friction is None else friction.static[i] * level,
            stribeck_velocity=1.0 if friction is None else friction.stribeck_velocity[i],
            viscous=0.0 if friction is None else friction.viscous[i] * thick,
            bristle_stiffness=0.0 if friction is None else friction.bristle_stiffness[i],
            load=0.0 if friction is None else friction.load[i],
            kp=gains.kp[i],
            kd=gains.kd[i],
            cycles=[] if ripple is None else ripple.cycles.tolist(),
            amplitude=[] if ripple is None else ripple.amplitude[i].tolist(),
            phase=[] if ripple is None else ripple.phase[i].tolist(),
        )
        for i in range(len(drive.gain))
    ]
