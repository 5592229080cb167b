"""Scenes in which something goes its own way: mocap paddles, servos, doors, whips."""

from __future__ import annotations

from functools import partial
from typing import Any

import mujoco
import numpy as np

from studies.contacts.draws.world import (
    AFTER,
    FREE,
    GYRATION,
    Thrown,
    any_spin,
    any_way,
    between,
    shape,
    slab,
    world,
)

#: Mass of a paddle, whose own height is no energy of what is studied [kg].
_LIGHT = 1e-9


def paddle(rng: np.random.Generator) -> Thrown:
    """A thin mocap paddle that is pushed or swung into one to three free bodies.

    A wall beyond the place where it is to stop leaves the bodies room.
    """
    if rng.random() < 0.3:
        return _swing(rng)
    return _push(rng, "paddle", wall=rng.random() < 0.5, stop=float(rng.choice([0.1, 0.25])))


def squeeze(rng: np.random.Generator) -> Thrown:
    """A mocap paddle that goes on through a wall; what is in between cannot be held."""
    return _push(rng, "squeeze", wall=True, stop=0.9)


def _push(rng: np.random.Generator, family: str, wall: bool, stop: float) -> Thrown:
    spec, timestep, speed = world(rng, FREE)
    speed = min(speed, 30.0)
    pad = spec.worldbody.add_body(name="pad", mocap=True, pos=[-0.2, 0, 0])
    slab(rng, pad, "pad", (between(rng, 5e-4, 1e-2), 0.2, 0.2), _LIGHT)
    if wall:
        at = spec.worldbody.add_body(name="wall", pos=[0.5, 0, 0])
        slab(rng, at, "wall", (between(rng, 5e-4, 5e-3), 0.4, 0.4), 1.0)
    for k in range(int(rng.integers(1, 4))):
        _free(spec, f"body{k}", [0, (k - 1) * 0.1, 0])
        shape(rng, spec, spec.body(f"body{k}"), f"body{k}", between(rng, 5e-3, 0.5))
    model = spec.compile()
    seconds = (min(stop, 0.5) + 0.2) / speed + AFTER
    return Thrown(
        family,
        spec,
        model.qpos0.copy(),
        np.zeros(model.nv),
        timestep,
        seconds,
        "body0",
        move=partial(_go, speed, stop),
        given=_given(model, speed),
    )


def _go(speed: float, stop: float, data: Any, time: float) -> None:
    data.mocap_pos[0] = [min(-0.2 + speed * time, stop), 0, 0]


def _swing(rng: np.random.Generator) -> Thrown:
    """A paddle that turns about an upright axis, or nearly so, and rises."""
    spec, timestep, speed = world(rng, FREE)
    speed = min(speed, 30.0)
    pad = spec.worldbody.add_body(name="pad", mocap=True)
    slab(rng, pad, "pad", (between(rng, 5e-4, 1e-2), 0.15, 0.15), _LIGHT, pos=(0, 0.2, 0))
    for k in range(int(rng.integers(1, 4))):
        angle, far = rng.uniform(0.5, 1.5), rng.uniform(0.1, 0.3)
        _free(spec, f"body{k}", [-far * np.sin(angle), far * np.cos(angle), (k - 1) * 0.1])
        shape(rng, spec, spec.body(f"body{k}"), f"body{k}", between(rng, 5e-3, 0.5))
    model, axis = spec.compile(), np.array([0, 0, 1.0]) + 0.1 * rng.normal(size=3)
    return Thrown(
        "paddle",
        spec,
        model.qpos0.copy(),
        np.zeros(model.nv),
        timestep,
        1.0 / speed + AFTER,
        "body0",
        move=partial(_turn, axis / np.linalg.norm(axis), speed / 0.3),
        given=_given(model, speed),
    )


def _turn(axis: Any, rate: float, data: Any, time: float) -> None:
    angle = min(rate * time, 2.5)
    data.mocap_pos[0] = [0, 0, 0.1 * angle]
    mujoco.mju_axisAngle2Quat(data.mocap_quat[0], axis, angle)


def _given(model: Any, speed: float) -> float:
    """Energy of all bodies at twice the speed, which an elastic impact gives [J]."""
    return float(2 * speed**2 * model.body_mass[model.body_dofnum > 0].sum())


def _free(spec: Any, name: str, pos: Any) -> Any:
    body = spec.worldbody.add_body(name=name, pos=list(pos))
    body.add_freejoint(name=name)
    return body


def door(rng: np.random.Generator) -> Thrown:
    """A body at a thin door that swings, with a thin frame behind it."""
    spec, timestep, speed = world(rng, FREE)
    leaf = spec.worldbody.add_body(name="door")
    leaf.add_joint(name="door", axis=[0, 0, 1], damping=float(rng.choice([0, 0.1])))
    half, mass = between(rng, 5e-4, 5e-3), between(rng, 0.1, 20)
    slab(rng, leaf, "door", (0.3, half, 0.2), mass, pos=(0.3, 0, 0))
    frame = spec.worldbody.add_body(name="frame", pos=[0.3, -0.06, 0])
    slab(rng, frame, "frame", (0.3, between(rng, 5e-4, 5e-3), 0.2), 1.0)
    body = _free(spec, "body", [rng.uniform(0.1, 0.5), 0, rng.uniform(-0.1, 0.1)])
    reach = shape(rng, spec, body, "body", between(rng, 5e-3, 2))
    model = spec.compile()
    qpos, qvel = model.qpos0.copy(), np.zeros(model.nv)
    at, dof = int(model.joint("body").qposadr[0]), int(model.joint("body").dofadr[0])
    qpos[at + 1], qpos[at + 3 : at + 7] = 0.02 + reach, any_way(rng)
    qvel[dof + 1] = -speed
    qvel[dof + 3 : dof + 6] = any_spin(rng, timestep)
    qvel[model.joint("door").dofadr[0]] = rng.uniform(-1, 1) * min(speed, 20)
    return Thrown("door", spec, qpos, qvel, timestep, (0.1 + reach) / speed + AFTER, "body")


def servo(rng: np.random.Generator) -> Thrown:
    """An arm whose position servos press a thin tool into free bodies on a thin plate."""
    spec, timestep, _ = world(rng, FREE, gravity=True)
    plate = spec.worldbody.add_body(name="plate")
    slab(rng, plate, "plate", (0.8, 0.8, between(rng, 5e-4, 5e-3)), 1.0)
    body, count = spec.worldbody, int(rng.integers(2, 5))
    for k in range(count):
        body = body.add_body(name=f"link{k}", pos=[0.25, 0, 0] if k else [-0.3, 0, 0.3])
        axis = [0, 1, 0] if k % 2 == 0 or rng.random() < 0.5 else [0, 0, 1]
        body.add_joint(name=f"joint{k}", axis=axis, armature=0.05, damping=1.0)
        ends, kind = [0, 0, 0, 0.25, 0, 0], mujoco.mjtGeom.mjGEOM_CAPSULE
        body.add_geom(name=f"link{k}", type=kind, fromto=ends, size=[0.02, 0, 0], mass=1.0)
        drive = spec.add_actuator(target=f"joint{k}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.set_to_position(kp=between(rng, 200, 5000), kv=between(rng, 1, 60))
    tool = body.add_body(name="tool", pos=[0.25, 0, 0])
    slab(rng, tool, "tool", (between(rng, 5e-4, 0.01), 0.05, 0.05), 0.1)
    for k in range(3):
        part = _free(spec, f"part{k}", [rng.uniform(0, 0.6), rng.uniform(-0.2, 0.2), 0.08])
        shape(rng, spec, part, f"part{k}", 0.05, ("box", "sphere", "capsule", "cylinder"))
    model, target = spec.compile(), rng.uniform(-1.5, 1.5, count)
    target[0] = rng.uniform(0.5, 1.5)
    qvel = np.zeros(model.nv)
    return Thrown("servo", spec, model.qpos0.copy(), qvel, timestep, 0.4, "tool", target)


def whips(rng: np.random.Generator) -> Thrown:
    """Two chains on ball joints that lash about one another and a thin post."""
    spec, timestep, speed = world(rng, FREE[:4])
    speed, kinds = min(speed, 20.0), mujoco.mjtJoint
    for whip, height in enumerate((0.0, 0.05)):
        body = spec.worldbody
        for k in range(int(rng.integers(3, 7))):
            body = body.add_body(pos=[0.08, 0, 0] if k else [-0.2, 0, height])
            kind = kinds.mjJNT_BALL if k else kinds.mjJNT_HINGE
            body.add_joint(type=kind, axis=[0, 1, 0] if whip else [0, 0, 1], damping=1e-4)
            thick = [between(rng, 1e-3, 8e-3), between(rng, 1e-3, 8e-3), 0]
            form = mujoco.mjtGeom.mjGEOM_CAPSULE
            if rng.random() < 0.4:
                form = mujoco.mjtGeom.mjGEOM_BOX
            ends = [0.004, 0, 0, 0.076, 0, 0]
            body.add_geom(name=f"whip{whip}{k}", type=form, fromto=ends, size=thick, mass=0.02)
    post = spec.worldbody.add_body(name="post", pos=[0.1, 0.1, 0])
    size = [between(rng, 1e-3, 0.01), 0.2, 0]
    post.add_geom(name="post", type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=size)
    model = spec.compile()
    qvel = rng.normal(size=model.nv) * 2.25 * speed
    qvel *= min(1.0, GYRATION / timestep / max(float(np.abs(qvel).max()), 1e-9))
    return Thrown("whips", spec, model.qpos0.copy(), qvel, timestep, 0.15, "whip00")
