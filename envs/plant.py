"""The native plant of a scene: MuJoCo's step, drives and servo."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.envs import _plant
from tauguard.findings import ArgumentError
from tauguard.models import Drive, Scene, derive
from tauguard.models.mujoco_library import function_address, variable_address


@dataclass(frozen=True)
class Gains:
    """Stiffness and damping of the position control, joint by joint."""

    kp: Array  #: [N m/rad], shape (n,)
    kd: Array  #: [N m s/rad], shape (n,)

    @classmethod
    def for_scene(cls, scene: Scene) -> Gains:
        """Critically damped gains for the largest inertia that each joint has over its range.

        The natural frequency is the arm's ``bandwidth``. A default bandwidth is lowered if the time
        step is too long for it. (For the CURA6-like arm, the inertia is that of the home pose.)

        Raises:
            ArgumentError: the time step is too long for the stated bandwidth; the message names the
                joint and what would work.
        """
        facts, model = scene.facts, scene.model
        inertia = facts.servo_inertia
        if inertia is None:
            inertia = _home_inertia(scene)
            return cls(facts.bandwidth**2 * inertia, 2 * facts.bandwidth * inertia)
        w, names = facts.bandwidth, scene.joint_names[: len(facts.joints)]
        mode, joint = derive.stiffest_mode(model, names, w**2 * inertia, 2 * w * inertia)
        if facts.sources.get("bandwidth") == "default":
            w = w * min(1.0, derive.MOST_PER_STEP / mode)
        elif mode > derive.LIMIT_PER_STEP:
            dt, fraction = float(model.opt.timestep), derive.MOST_PER_STEP / mode
            raise ArgumentError(
                f"timestep {dt} s: too long for the servo of joint {names[joint]!r} at a bandwidth "
                f"of {w[joint]:g} rad/s; expected a timestep of at most {dt * fraction:.1g} s, or "
                f"a bandwidth of at most {w[joint] * fraction:.2g} rad/s"
            )
        return cls(w**2 * inertia, 2 * w * inertia)


def _home_inertia(scene: Scene) -> Array:
    """Inertia of each joint in the model's first keyframe [kg m^2], shape (n,)."""
    data = mujoco.MjData(scene.model)
    if scene.model.nkey:
        mujoco.mj_resetDataKeyframe(scene.model, data, 0)
    mujoco.mj_forward(scene.model, data)
    mass = np.zeros((scene.model.nv, scene.model.nv))
    mujoco.mj_fullM(scene.model, data, mass)
    return np.asarray(np.diag(mass)[scene.dof_adr])


# Native code replaces this clock while it steps, because reading a clock takes time.
_plant.set_clock(variable_address("mjcb_time"))


def make_plant(scene: Scene, nominal: Drive, gains: Gains, data: mujoco.MjData) -> _plant.Plant:
    """The plant that steps ``data``; it keeps ``data`` and the scene's model alive.

    Args:
        scene: the composed scene; ``scene.drive`` is simulated.
        nominal: drive that the controller assumes: its gains, and the friction that is compensated.
        gains: of the servo.
        data: data of the scene's model.
    """
    model = scene.model
    dt, constant = float(model.opt.timestep), scene.drive.electrical_time_constant
    physics = make_physics(model, data)
    decay = float(np.exp(-dt / constant)) if constant else 0.0
    plant = _plant.Plant(physics, _joints(scene, nominal, gains), dt=dt, decay=decay)
    for obj in scene.spec.objects:
        if obj.path:
            plant.carry(int(model.body(obj.name).mocapid[0]), np.array(obj.path))
        if obj.belt is not None:
            joint = model.joint(obj.name)
            speed = float(np.linalg.norm(obj.belt))
            plant.belt(int(joint.qposadr[0]), int(joint.dofadr[0]), speed)
    return plant


def make_physics(model: mujoco.MjModel, data: mujoco.MjData) -> _plant.Physics:
    """MuJoCo's functions on ``data`` for native code, which keeps model and data alive."""
    return _plant.Physics(
        model,
        data,
        step=function_address("mj_step"),
        kinematics=function_address("mj_kinematics"),
        distance=function_address("mj_geomDistance"),
    )


def _joints(scene: Scene, nominal: Drive, gains: Gains) -> list[_plant.Joint]:
    drive = scene.drive
    friction, ripple = drive.friction, drive.ripple
    warm = 0.0 if friction is None else friction.temperature - friction.reference_temperature
    level = 0.0 if friction is None else 1 + friction.coulomb_per_kelvin * warm
    thick = 0.0 if friction is None else 1 + friction.viscous_per_kelvin * warm
    slope = np.zeros((len(drive.gain), 0))
    widths = np.zeros(0)
    if friction is not None and friction.slope is not None and friction.slope_velocity is not None:
        slope, widths = level * friction.slope, friction.slope_velocity
    known, compensated = nominal.friction, scene.facts.compensation
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
            slope=slope[i].tolist(),
            slope_velocity=widths.tolist(),
            kp=gains.kp[i],
            kd=gains.kd[i],
            rated_speed=0.0 if drive.rated_speed is None else drive.rated_speed[i],
            no_load_speed=0.0 if drive.no_load_speed is None else drive.no_load_speed[i],
            known_coulomb=0.0 if known is None else compensated * float(known.coulomb[i]),
            known_viscous=0.0 if known is None else compensated * float(known.viscous[i]),
            cycles=[] if ripple is None else ripple.cycles.tolist(),
            amplitude=[] if ripple is None else ripple.amplitude[i].tolist(),
            phase=[] if ripple is None else ripple.phase[i].tolist(),
        )
        for i in range(len(drive.gain))
    ]
