"""A second arm opposite the first, in the same scene."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import TypeVar

import mujoco
import numpy as np

from tauguard.envs.gym.placing import SECOND
from tauguard.models import Scene
from tauguard.models.arm import ARM_BITS, OBSTACLE_BITS
from tauguard.models.left_over import LeftOver
from tauguard.models.mjcf import SpecText
from tauguard.models.obstacles import Springy, add_pairs
from tauguard.models.scene import _add_label, label_region, lean_model, people_parts, region_names

#: Distance of the second arm ahead of the first, which it faces [m].
APART = 1.1
#: Name of the sensor of the force between the arms.
ARMS = "contact_arms"
#: Arrays of a drive's parts that all joints share.
_SHARED = ("cycles", "slope_velocity", "log")
T = TypeVar("T")


def add_second_arm(scene: Scene, place: tuple[float, float, float] = (APART, 0.0, 0.0)) -> Scene:
    """The scene with a second, nominal arm of the same kind; its joints and links come last.

    The two arms can touch each other and all things around them. Visual shapes are only in ``xml``.
    """
    whole = mujoco.MjSpec.from_string(scene.xml)
    other = mujoco.MjSpec.from_string(scene.arm_xml)
    for key in list(other.keys):
        other.delete(key)
    for key in list(whole.keys):
        whole.delete(key)
    frame = whole.worldbody.add_frame(pos=place, quat=[0, 0, 0, 1])
    _set_bits(whole, other)
    whole.attach(other, frame=frame, prefix=SECOND)
    first = {scene.model.body(int(b)).name for b in scene.link_bodies}
    links = [SECOND + scene.model.body(int(b)).name for b in scene.link_bodies]
    shapes = []
    for link in links:
        shapes += [g for g in whole.body(link).geoms if g.contype or g.conaffinity]
    for i, geom in enumerate(shapes):
        geom.name = geom.name or f"{SECOND}collision{i}"
    if scene.spec.labels:
        # The sensors of all links must be in sequence, so other bodies' sensors are added again.
        for sensor in [s for s in whole.sensors if s.name.startswith("contact_")]:
            if sensor.objname not in first:
                whole.delete(sensor)
        for i, link in enumerate(links, start=len(first) + 1):
            _add_label(whole, link, f"contact_link{i}")
        for name in region_names(scene.spec):
            label_region(whole, scene.spec, name)
        base = scene.model.body(int(scene.link_bodies[0])).name
        _add_label(whole, SECOND + base, ARMS, subtree=True, against=base)
    parts: dict[str, Springy] = {proxy.region: proxy for proxy in scene.spec.proxies}
    parts |= {part.name: part for part in people_parts(scene.spec)}
    parts |= {
        geom.name: obj
        for obj in scene.spec.objects
        if obj.touchable
        for geom in whole.geoms
        if geom.name.startswith(f"{obj.name}_")
    }
    if parts:
        add_pairs(whole, shapes, parts)
    return _located(scene, whole, links)


def _set_bits(whole: mujoco.MjSpec, other: mujoco.MjSpec) -> None:
    """Set the contact bits: the arms touch each other, and other things touch both arms.

    The second arm's base is part of the world. With the first arm's bits it would touch its own
    first link. That link cannot move away, and the contact force would reach 1e13 N.
    """
    for geom in whole.geoms:
        if geom.contype == OBSTACLE_BITS:
            geom.contype = geom.conaffinity = ARM_BITS | OBSTACLE_BITS
    for i, geom in enumerate(other.geoms):
        if geom.contype or geom.conaffinity:
            geom.contype, geom.conaffinity = OBSTACLE_BITS, ARM_BITS
            if geom.parent.name == "world":
                geom.name = geom.name or f"base{i}"


def _located(scene: Scene, whole: mujoco.MjSpec, links: list[str]) -> Scene:
    text = SpecText(whole)
    model = lean_model(whole)
    names = (*scene.joint_names, *(SECOND + name for name in scene.joint_names))
    joints = [model.joint(name) for name in names]
    bodies = [scene.model.body(int(b)).name for b in scene.link_bodies] + links
    return replace(
        scene,
        model=model,
        text=text,
        joint_names=names,
        link_bodies=np.array([model.body(name).id for name in bodies]),
        qpos_adr=np.array([joint.qposadr[0] for joint in joints]),
        dof_adr=np.array([joint.dofadr[0] for joint in joints]),
        payload_body=model.body("payload").id if scene.payload_body >= 0 else -1,
        drive=both_drives(scene.drive),
        home=np.tile(scene.home, 2),
    )


def both_drives(part: T) -> T:
    """The drives (or a part of them) of two equal arms, one after the other."""
    both: dict[str, object] = {}
    for field in fields(part):  # type: ignore[arg-type]
        value = getattr(part, field.name)
        if is_dataclass(value):
            both[field.name] = both_drives(value)
        elif isinstance(value, np.ndarray) and field.name not in _SHARED:
            both[field.name] = np.concatenate([value, value], int(isinstance(part, LeftOver)))
    return replace(part, **both)  # type: ignore[type-var]
