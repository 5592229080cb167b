"""Conversion of a compiled scene into the arguments of the native plant."""

from __future__ import annotations

import mujoco
import numpy as np

from tauguard.envs import _plant
from tauguard.envs.gym.actions import Entry, action_scale
from tauguard.envs.gym.compiled import CompiledScene
from tauguard.envs.gym.people import anatomy
from tauguard.envs.gym.placing import things_around
from tauguard.envs.gym.regions import RegionInfo
from tauguard.envs.gym.second_arm import ARMS
from tauguard.envs.gym.settings import CONTROLS
from tauguard.models import Person
from tauguard.models.scene import people_parts


def controls(compiled: CompiledScene) -> _plant.Controls:
    """The control mode, and the scale and limits of actions."""
    settings = compiled.settings
    centre, scale = action_scale(compiled)
    return _plant.Controls(
        mode=CONTROLS.index(settings.control),
        period=float(compiled.scene.model.opt.timestep) * settings.substeps,
        scale=scale.tolist(),
        centre=centre.tolist(),
        max_speed=compiled.max_speed.tolist(),
        torque_limit=compiled.torque_limit.tolist(),
        low=compiled.joint_range[:, 0].tolist(),
        high=compiled.joint_range[:, 1].tolist(),
        moving=compiled.force_bound.moving**2,
        driven=compiled.force_bound.driven**2,
    )


def surroundings(
    compiled: CompiledScene, observations: list[Entry], people: tuple[Person, ...]
) -> _plant.Surroundings:
    """Links, tools, people, body regions and sensors around the drives."""
    model, scene = compiled.scene.model, compiled.scene
    each = len(scene.joint_names) // compiled.arms
    links = [
        _plant.Link(
            joint=int(joint),
            body=int(scene.link_bodies[i]),
            first=i // each * each,
            slide=bool(model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE),
            mass=float(compiled.nominal_mass[i]),
            com=compiled.nominal_com[i].tolist(),
        )
        for i, joint in enumerate(compiled.ids())
    ]
    labels, barriers = scene.spec.labels, things_around(scene, model) if people else []
    return _plant.Surroundings(
        arms=_plant.Kinematics(links=links, gravity=model.opt.gravity.tolist()),
        tools=[
            _plant.Tool(site=site, body=body, first=first) for site, body, first in compiled.tools
        ],
        regions=[_region(compiled, region) for region in compiled.regions],
        people_begin=len(scene.spec.proxies),
        people=[anatomy(person, compiled.blocked) for person in people],
        sensor_begin=_sensor(model, "contact_link1") if labels else -1,
        arms_sensor=_sensor(model, ARMS) if labels and compiled.arms == 2 else -1,
        low=[entry.low for entry in observations],
        high=[entry.high for entry in observations],
        people_geoms=[int(model.geom(part.name).id) for part in people_parts(scene.spec)],
        barriers=[_barrier(model, geom) for geom in barriers],
    )


def _barrier(model: mujoco.MjModel, geom: int) -> _plant.Barrier:
    plane = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE
    centre, half = model.geom_aabb[geom].reshape(2, 3)
    half = np.full(3, np.inf) if plane else half
    return _plant.Barrier(geom=geom, centre=centre.tolist(), half=half.tolist())


def _region(compiled: CompiledScene, region: RegionInfo) -> _plant.Region:
    model, joint = compiled.scene.model, region.joint
    return _plant.Region(
        body=region.body,
        joint=joint,
        qpos=int(model.jnt_qposadr[joint]) if joint >= 0 else -1,
        dof=int(model.jnt_dofadr[joint]) if joint >= 0 else -1,
        mocap=region.mocap,
        held=region.held,
        sensor=_sensor(model, f"contact_{region.name}") if compiled.scene.spec.labels else -1,
        quasi_static=region.quasi_static,
        transient=region.transient,
        span=region.span,
        speed=region.speed,
        area=compiled.settings.contact_area or 0.0,
        least_pressure=region.least_pressure,
        stiffness=region.stiffness,
    )


def _sensor(model: mujoco.MjModel, name: str) -> int:
    """Address of a sensor's numbers."""
    return int(model.sensor_adr[model.sensor(name).id])
