"""Families of rigid scenes: single bodies, built bodies, many bodies, and driven bodies."""

from __future__ import annotations

from functools import partial
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from scenes.drawing import (
    AFTER,
    ALONG_X,
    GYRATION,
    INTEGRATORS,
    Drawn,
    any_spin,
    any_way,
    at_rest,
    between,
    free_body,
    shape,
    slab,
    solid,
    thrown,
    world,
)


def plate(rng: np.random.Generator) -> Drawn:
    """A convex body onto a plate of 1 to 20 mm, fixed or free, at any angle and spin."""
    spec, timestep, speed = world(rng, INTEGRATORS)
    half, mass = between(rng, 5e-4, 1e-2), between(rng, 5e-3, 2.0)
    under = spec.worldbody.add_body(name="plate")
    slab(rng, under, "plate", (0.3, 0.3, half), mass * rng.uniform(0.5, 20), spec)
    if rng.random() < 1 / 3:
        under.add_freejoint()
    body = free_body(spec, "body")
    reach = shape(rng, spec, body, "body", mass)
    height = half + reach + 0.005 + rng.random() * speed * timestep
    place = [*rng.uniform(-0.05, 0.05, 2), height]
    return thrown(rng, spec, timestep, speed, place, height)


def pair(rng: np.random.Generator) -> Drawn:
    """Two convex bodies of any kinds, head on or past each other's middle."""
    spec, timestep, speed = world(rng, INTEGRATORS)
    reaches = [
        shape(rng, spec, free_body(spec, name), name, between(rng, 5e-3, 0.5))
        for name in ("first", "body")
    ]
    distance = sum(reaches) + 0.005 + rng.random() * speed * timestep
    aside = rng.normal(size=2) * 0.2 * min(reaches) * rng.integers(2)
    return thrown(rng, spec, timestep, speed, [*aside, distance], distance, slide=0.0)


def chain(rng: np.random.Generator) -> Drawn:
    """Three to eight capsules on ball joints onto a thin plate, a box or a mesh."""
    spec, timestep, speed = world(rng, INTEGRATORS[:4])
    half = between(rng, 5e-4, 5e-3)
    slab(rng, spec.worldbody.add_body(name="plate"), "plate", (0.4, 0.4, half), 1.0, spec)
    radius, length = between(rng, 3e-3, 1e-2), between(rng, 1e-2, 3e-2)
    body = free_body(spec, "body")
    for k in range(int(rng.integers(3, 9))):
        if k:
            body = body.add_body(name=f"link{k}", pos=[2 * (length + radius), 0, 0])
            body.add_joint(type=mujoco.mjtJoint.mjJNT_BALL, pos=[-length - radius, 0, 0])
        solid(body, f"capsule{k}", "capsule", [radius, length, 0], quat=ALONG_X, mass=0.02)
    height = half + radius + 0.005 + rng.random() * speed * timestep
    return thrown(rng, spec, timestep, speed, [-0.15, 0, height], height, flat=True)


def cup(rng: np.random.Generator) -> Drawn:
    """Balls in a thin cup that is jerked sideways."""
    spec, timestep, speed = world(rng, INTEGRATORS, gravity=True)
    half, wall = between(rng, 5e-4, 3e-3), 0.05
    vessel = spec.worldbody.add_body(name="cup")
    vessel.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0], name="body")
    slab(rng, vessel, "wall0", (wall, wall, half), 1.0, pos=(0, 0, -half))
    for k, at in enumerate((-wall - half, wall + half), 1):
        slab(rng, vessel, f"wall{k}", (half, wall, wall), 1.0, pos=(at, 0, wall))
    for k, at in enumerate((-wall - half, wall + half), 3):
        slab(rng, vessel, f"wall{k}", (wall, half, wall), 1.0, pos=(0, at, wall))
    radius = between(rng, 4e-3, 8e-3)
    for k in range(int(rng.integers(4, 25))):
        height = radius + 0.0171 * (k // 9) + 1e-3
        place = [(k % 3 - 1) * 0.03, (k // 3 % 3 - 1) * 0.03, height]
        solid(free_body(spec, f"ball{k}", place), f"ball{k}", "sphere", [radius, 0, 0], mass=0.005)
    qpos, qvel, _, dof = at_rest(spec.compile())
    qvel[dof] = min(speed, 20.0)
    return Drawn(spec, qpos, qvel, timestep, 0.2 / min(speed, 20.0) + AFTER)


def arm(rng: np.random.Generator) -> Drawn:
    """An arm of capsules, driven by its motors against a thin fixed plate among obstacles."""
    spec, timestep, _ = world(rng, INTEGRATORS, gravity=True)
    half, links = between(rng, 5e-4, 5e-3), int(rng.integers(2, 5))
    slab(rng, spec.worldbody.add_body(name="plate"), "plate", (0.6, 0.6, half), 1.0)
    body = spec.worldbody
    for k in range(links):
        axis = [0, 1, 0] if rng.random() < 0.6 else rng.normal(size=3)
        body = body.add_body(name=f"link{k}", pos=[0.3, 0, 0] if k else [-0.3, 0, 0.4])
        damping, ends = rng.uniform(0, 0.5), [0, 0, 0, 0.3, 0, 0]
        body.add_joint(name=f"joint{k}", axis=axis, damping=damping, armature=0.01)
        radius = between(rng, 0.01, 0.04)
        solid(body, f"link{k}", "capsule", [radius, 0, 0], fromto=ends, mass=1.0)
        spec.add_actuator(target=f"joint{k}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    _obstacles(rng, spec)
    model, ctrl = spec.compile(), rng.uniform(10, 100, links)
    qvel = rng.uniform(0, 10, model.nv)
    return Drawn(spec, model.qpos0.copy(), qvel, timestep, 0.25, ctrl)


def _obstacles(rng: np.random.Generator, spec: Any) -> None:
    """Up to four fixed posts, balls and boxes beside the arm's first pose."""
    for k in range(int(rng.integers(5))):
        place = [rng.uniform(-0.3, 0.6), rng.choice([-1, 1]) * rng.uniform(0.12, 0.4), 0.3]
        body = spec.worldbody.add_body(name=f"obstacle{k}", pos=place)
        kind, thin = str(rng.choice(["sphere", "capsule", "box"])), between(rng, 2e-3, 0.03)
        size = {"sphere": [thin] * 3, "capsule": [thin, 0.2, 0.2], "box": [thin, thin, 0.2]}[kind]
        solid(body, f"obstacle{k}", kind, size)


def composite(rng: np.random.Generator) -> Drawn:
    """A body of two to four geoms onto a thin plate, or onto another such body."""
    spec, timestep, speed = world(rng, INTEGRATORS)
    half = between(rng, 5e-4, 5e-3)
    if rng.random() < 0.5:
        slab(rng, spec.worldbody.add_body(name="plate"), "plate", (0.4, 0.4, half), 1.0, spec)
        below = half
    else:
        below = _parts(rng, spec, free_body(spec, "other"), "other")
    body = free_body(spec, "body")
    height = below + _parts(rng, spec, body, "body") + 0.005 + rng.random() * speed * timestep
    return thrown(rng, spec, timestep, speed, [0, 0, height], height)


def _parts(rng: np.random.Generator, spec: Any, body: Any, name: str) -> float:
    """Give a body its geoms; how far they reach [m]."""
    most = 0.0
    for k in range(int(rng.integers(2, 5))):
        reach = shape(rng, spec, body, f"{name}{k}", between(rng, 5e-3, 0.3))
        place = rng.normal(size=3) * 0.03
        body.geoms[k].pos, body.geoms[k].quat = place, rng.normal(size=4)
        most = max(most, reach + float(np.linalg.norm(place)))
    return most


def stack(rng: np.random.Generator) -> Drawn:
    """Flat boxes and cylinders on one another on a thin plate, hit from above or from the side."""
    spec, timestep, speed = world(rng, INTEGRATORS, gravity=True)
    half, top = between(rng, 5e-4, 5e-3), 0.0
    slab(rng, spec.worldbody.add_body(name="plate"), "plate", (0.4, 0.4, half), 1.0)
    for k in range(int(rng.integers(2, 7))):
        thin, wide = between(rng, 1e-3, 0.02), between(rng, 0.02, 0.06)
        part = free_body(spec, f"part{k}", [0, 0, half + top + thin])
        kind = str(rng.choice(["box", "cylinder"]))
        size = [wide, wide, thin] if kind == "box" else [wide, thin, 0]
        solid(part, f"part{k}", kind, size, mass=between(rng, 0.02, 0.5))
        top += 2 * thin + 1e-4
    body = free_body(spec, "body")
    reach = shape(rng, spec, body, "body", between(rng, 5e-3, 0.5))
    distance = reach + 0.005 + rng.random() * speed * timestep
    normal, place = (0.0, 0.0, 1.0), [0, 0, half + top + distance]
    if rng.random() >= 0.5:
        normal, place = (1.0, 0.0, 0.0), [0.06 + distance, 0, half + 0.5 * top + reach]
    return thrown(rng, spec, timestep, speed, place, distance, normal, slide=0.0)


def joined(rng: np.random.Generator) -> Drawn:
    """Two to four bodies tied by an equality or a tendon, onto a thin plate that may be a door."""
    spec, timestep, speed = world(rng, INTEGRATORS)
    half, under = between(rng, 5e-4, 5e-3), spec.worldbody.add_body(name="plate")
    slab(rng, under, "plate", (0.3, 0.3, half), between(rng, 0.2, 5.0), spec)
    if rng.random() < 1 / 3:
        under.add_joint(name="door", axis=[1, 0, 0], pos=[0, 0.3, 0], stiffness=5, damping=0.1)
    how, reach, count = str(rng.choice(["connect", "weld", "tendon"])), 0.0, int(rng.integers(2, 5))
    for k in range(count):
        body = free_body(spec, f"body{k}" if k else "body", [0.15 * k, 0, 1.0])
        body.add_site(name=f"site{k}")
        reach = max(reach, shape(rng, spec, body, f"geom{k}", between(rng, 5e-3, 0.3)))
        if k:
            _tie(spec, how, k)
    height = half + reach + 0.005 + rng.random() * speed * timestep
    place = np.array([-0.1, 0, height])
    scene = thrown(rng, spec, timestep, speed, place, height, slide=0.0)
    model = spec.compile()
    for k in range(1, count):
        *_, at, dof = at_rest(model, f"body{k}")
        scene.qpos[at : at + 3] = place + np.array([0.15 * k, 0, 0])
        scene.qvel[dof : dof + 3] = [0, 0, -speed]
    return scene


def _tie(spec: Any, how: str, k: int) -> None:
    """Join body ``k`` to the one before."""
    first, second = f"body{k - 1}" if k > 1 else "body", f"body{k}"
    if how == "tendon":
        tendon = spec.add_tendon(limited=1, range=[0, 0.16])
        tendon.wrap_site(f"site{k - 1}")
        tendon.wrap_site(f"site{k}")
        return
    kind, of = getattr(mujoco.mjtEq, f"mjEQ_{how.upper()}"), mujoco.mjtObj.mjOBJ_BODY
    equality = spec.add_equality(type=kind, objtype=of, name1=first, name2=second)
    if how == "connect":
        equality.data[:3] = [0.075, 0, 0]


def spin(rng: np.random.Generator) -> Drawn:
    """A long thin rotor on a hinge, which turns by up to more than one turn a step, near walls."""
    spec, timestep, _ = world(rng, INTEGRATORS[1:])
    half, length = between(rng, 5e-4, 5e-3), between(rng, 0.05, 0.2)
    rotor = spec.worldbody.add_body(name="rotor")
    rotor.add_joint(name="rotor", axis=[0, 0, 1])
    kind, thin = str(rng.choice(["capsule", "box"])), between(rng, 2e-3, 0.01)
    size = [thin, length, 0] if kind == "capsule" else [thin, thin, length]
    offset, mass = [length * rng.uniform(0, 0.8), 0, 0], between(rng, 0.05, 1.0)
    solid(rotor, "rotor", kind, size, quat=ALONG_X, pos=offset, mass=mass)
    angle = rng.uniform(0.5, 2.5)
    place = 0.6 * length * np.array([np.cos(angle), np.sin(angle), 0])
    other = spec.worldbody.add_body(name="body", pos=place)
    if rng.random() < 0.5:
        other.add_freejoint()
    turn = [np.cos(angle / 2), 0, 0, np.sin(angle / 2)]
    solid(other, "body", "box", [0.02, half, 0.05], quat=turn, mass=between(rng, 0.02, 1.0))
    qpos, qvel, *_ = at_rest(spec.compile(), "rotor")
    qvel[0] = between(rng, 10, 1000)
    return Drawn(spec, qpos, qvel, timestep, 10 / float(qvel[0]) + AFTER)


def mill(rng: np.random.Generator) -> Drawn:
    """Four to thirteen bodies in a closed cage of thin walls, in all directions."""
    spec, timestep, speed = world(rng, INTEGRATORS)
    half, wide = between(rng, 5e-4, 5e-3), 0.1
    cage = spec.worldbody.add_body(name="cage")
    if rng.random() < 0.3:
        cage.add_freejoint(name="cage")
    for axis in range(3):
        for side in (-1, 1):
            size, place = [wide] * 3, [0.0] * 3
            size[axis], place[axis] = half, side * (wide + half)
            slab(rng, cage, f"wall{axis}{side}", tuple(size), 1.0, pos=tuple(place))
    count = int(rng.integers(4, 14))
    for k, cell in enumerate(rng.permutation(27)[:count].tolist()):
        place = [0.06 * (cell // 3**axis % 3 - 1) for axis in range(3)]
        body = free_body(spec, f"body{k}", place)
        shape(rng, spec, body, f"body{k}", 0.02, ("sphere", "box", "capsule", "cylinder"))
        body.geoms[0].size = np.minimum(body.geoms[0].size, 0.013)
    model = spec.compile()
    qvel = np.zeros(model.nv)
    for k in range(count):
        dof = int(model.joint(f"body{k}").dofadr[0])
        qvel[dof : dof + 3] = rng.normal(size=3) * min(speed, 30.0)
        qvel[dof + 3 : dof + 6] = rng.normal(size=3) * min(0.1 / timestep, 30.0)
    return Drawn(spec, model.qpos0.copy(), qvel, timestep, 0.1)


def grid(rng: np.random.Generator) -> Drawn:
    """A thin disc, plate or lens onto a grid of thin bars."""
    spec, timestep, speed = world(rng, INTEGRATORS)
    radius, bars = between(rng, 5e-4, 4e-3), spec.worldbody.add_body(name="grid")
    for k in range(6):
        x = (k - 2.5) * 0.03
        for along, ends in enumerate(([x, -0.1, 0, x, 0.1, 0], [-0.1, x, 0, 0.1, x, 0])):
            solid(bars, f"bar{k}{along}", "capsule", [radius, 0, 0], fromto=ends)
    body = free_body(spec, "body")
    wide, thin = rng.uniform(0.025, 0.05), between(rng, 5e-4, 3e-3)
    kind = ("cylinder", "box", "ellipsoid")[int(rng.integers(3))]
    size = [wide, thin, 0] if kind == "cylinder" else [wide, wide, thin]
    size[1] *= 0.8 if kind == "ellipsoid" else 1
    solid(body, "body", kind, size, mass=0.02)
    qpos, qvel, *_ = at_rest(spec.compile())
    height = 0.06 + rng.random() * speed * timestep
    qpos[:3] = [*rng.uniform(-0.02, 0.02, 2), height]
    tilt = Rotation.from_euler("xy", rng.uniform(-60, 60, 2), degrees=True)
    qpos[3:7] = np.roll(tilt.as_quat(), 1)
    qvel[2], qvel[3:6] = -speed, any_spin(rng, timestep)
    return Drawn(spec, qpos, qvel, timestep, height / speed + AFTER)


def small(rng: np.random.Generator) -> Drawn:
    """A body of millimetres, or less, onto a plate that is as much thinner."""
    spec, timestep, speed = world(rng, INTEGRATORS)
    scale = float(10 ** rng.uniform(-2.3, -1))
    speed, spec.stat.meansize, spec.compiler.boundinertia = speed * scale, 0.01 * scale, 1e-12
    plate = spec.worldbody.add_body(name="plate")
    half = between(rng, 1e-3, 1e-2) * scale
    slab(rng, plate, "plate", (0.3 * scale, 0.3 * scale, half), scale**3)
    if rng.random() < 0.4:
        plate.add_freejoint(name="plate")
    body = free_body(spec, "body")
    kind = str(rng.choice(["box", "capsule", "cylinder", "sphere", "ellipsoid"]))
    size = between(rng, 3e-3, 0.03) * scale * np.exp(rng.uniform(-0.5, 1, 3))
    size = np.maximum(size, 6e-5)  # MuJoCo refuses moments of inertia below 1e-15 kg m^2
    if kind in ("capsule", "cylinder"):
        size = np.array([size[0], size[2], 0])
    solid(body, "body", kind, size, mass=max(1e-6, 10 * scale**3))
    qpos, qvel, at, dof = at_rest(spec.compile())
    height = 2 * float(np.linalg.norm(size)) + 0.012 * scale + rng.random() * speed * timestep
    qpos[at + 2], qpos[at + 3 : at + 7] = height, any_way(rng)
    qvel[dof + 2], qvel[dof + 3 : dof + 6] = -speed, any_spin(rng, timestep)
    return Drawn(spec, qpos, qvel, timestep, height / speed + AFTER)


#: Mass of a paddle [kg]: so light that its own height adds no energy.
_LIGHT = 1e-9


def paddle(rng: np.random.Generator) -> Drawn:
    """A thin mocap paddle that is pushed or swung into one to three free bodies.

    A wall beyond the place where it is to stop leaves the bodies room.
    """
    if rng.random() < 0.3:
        return _swing(rng)
    return _push(rng, wall=rng.random() < 0.5, stop=float(rng.choice([0.1, 0.25])))


def squeeze(rng: np.random.Generator) -> Drawn:
    """A mocap paddle that moves on through a wall; nothing holds what is in between."""
    return _push(rng, wall=True, stop=0.9)


def _push(rng: np.random.Generator, wall: bool, stop: float) -> Drawn:
    spec, timestep, speed = world(rng, INTEGRATORS)
    speed = min(speed, 30.0)
    pad = spec.worldbody.add_body(name="pad", mocap=True, pos=[-0.2, 0, 0])
    slab(rng, pad, "pad", (between(rng, 5e-4, 1e-2), 0.2, 0.2), _LIGHT)
    if wall:
        at = spec.worldbody.add_body(name="wall", pos=[0.5, 0, 0])
        slab(rng, at, "wall", (between(rng, 5e-4, 5e-3), 0.4, 0.4), 1.0)
    for k in range(int(rng.integers(1, 4))):
        body = free_body(spec, f"body{k}", [0, (k - 1) * 0.1, 0])
        shape(rng, spec, body, f"body{k}", between(rng, 5e-3, 0.5))
    seconds = (min(stop, 0.5) + 0.2) / speed + AFTER
    return _paddled(spec, timestep, seconds, speed, partial(_go, speed, stop))


def _go(speed: float, stop: float, data: Any, time: float) -> None:
    data.mocap_pos[0] = [min(-0.2 + speed * time, stop), 0, 0]


def _swing(rng: np.random.Generator) -> Drawn:
    """A paddle that turns about an upright axis, or nearly so, and rises."""
    spec, timestep, speed = world(rng, INTEGRATORS)
    speed = min(speed, 30.0)
    pad = spec.worldbody.add_body(name="pad", mocap=True)
    slab(rng, pad, "pad", (between(rng, 5e-4, 1e-2), 0.15, 0.15), _LIGHT, pos=(0, 0.2, 0))
    for k in range(int(rng.integers(1, 4))):
        angle, far = rng.uniform(0.5, 1.5), rng.uniform(0.1, 0.3)
        place = [-far * np.sin(angle), far * np.cos(angle), (k - 1) * 0.1]
        shape(rng, spec, free_body(spec, f"body{k}", place), f"body{k}", between(rng, 5e-3, 0.5))
    axis = np.array([0, 0, 1.0]) + 0.1 * rng.normal(size=3)
    turn = partial(_turn, axis / np.linalg.norm(axis), speed / 0.3)
    return _paddled(spec, timestep, 1.0 / speed + AFTER, speed, turn)


def _turn(axis: Any, rate: float, data: Any, time: float) -> None:
    angle = min(rate * time, 2.5)
    data.mocap_pos[0] = [0, 0, 0.1 * angle]
    mujoco.mju_axisAngle2Quat(data.mocap_quat[0], axis, angle)


def _paddled(spec: Any, timestep: float, seconds: float, speed: float, move: Any) -> Drawn:
    """Energies over that of all bodies at twice the speed, which an elastic impact gives."""
    qpos, qvel, *_ = at_rest(model := spec.compile(), "body0")
    unit = float(2 * speed**2 * model.body_mass[model.body_dofnum > 0].sum())
    return Drawn(spec, qpos, qvel, timestep, seconds, move=move, energy_unit=unit)


def door(rng: np.random.Generator) -> Drawn:
    """A body at a thin door that swings, with a thin frame behind it."""
    spec, timestep, speed = world(rng, INTEGRATORS)
    leaf = spec.worldbody.add_body(name="door")
    leaf.add_joint(name="door", axis=[0, 0, 1], damping=float(rng.choice([0, 0.1])))
    half, mass = between(rng, 5e-4, 5e-3), between(rng, 0.1, 20)
    slab(rng, leaf, "door", (0.3, half, 0.2), mass, pos=(0.3, 0, 0))
    frame = spec.worldbody.add_body(name="frame", pos=[0.3, -0.06, 0])
    slab(rng, frame, "frame", (0.3, between(rng, 5e-4, 5e-3), 0.2), 1.0)
    body = free_body(spec, "body", [rng.uniform(0.1, 0.5), 0, rng.uniform(-0.1, 0.1)])
    reach = shape(rng, spec, body, "body", between(rng, 5e-3, 2))
    qpos, qvel, at, dof = at_rest(model := spec.compile())
    qpos[at + 1], qpos[at + 3 : at + 7] = 0.02 + reach, any_way(rng)
    qvel[dof + 1], qvel[dof + 3 : dof + 6] = -speed, any_spin(rng, timestep)
    qvel[model.joint("door").dofadr[0]] = rng.uniform(-1, 1) * min(speed, 20)
    return Drawn(spec, qpos, qvel, timestep, (0.1 + reach) / speed + AFTER)


def servo(rng: np.random.Generator) -> Drawn:
    """An arm whose position servos press a thin tool into free bodies on a thin plate."""
    spec, timestep, _ = world(rng, INTEGRATORS, gravity=True)
    plate = spec.worldbody.add_body(name="plate")
    slab(rng, plate, "plate", (0.8, 0.8, between(rng, 5e-4, 5e-3)), 1.0)
    body, count = spec.worldbody, int(rng.integers(2, 5))
    for k in range(count):
        body = body.add_body(name=f"link{k}", pos=[0.25, 0, 0] if k else [-0.3, 0, 0.3])
        axis = [0, 1, 0] if k % 2 == 0 or rng.random() < 0.5 else [0, 0, 1]
        body.add_joint(name=f"joint{k}", axis=axis, armature=0.05, damping=1.0)
        solid(body, f"link{k}", "capsule", [0.02, 0, 0], fromto=[0, 0, 0, 0.25, 0, 0], mass=1.0)
        drive = spec.add_actuator(target=f"joint{k}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.set_to_position(kp=between(rng, 200, 5000), kv=between(rng, 1, 60))
    tool = body.add_body(name="tool", pos=[0.25, 0, 0])
    slab(rng, tool, "tool", (between(rng, 5e-4, 0.01), 0.05, 0.05), 0.1)
    for k in range(3):
        part = free_body(spec, f"part{k}", [rng.uniform(0, 0.6), rng.uniform(-0.2, 0.2), 0.08])
        shape(rng, spec, part, f"part{k}", 0.05, ("box", "sphere", "capsule", "cylinder"))
    target = rng.uniform(-1.5, 1.5, count)
    target[0] = rng.uniform(0.5, 1.5)
    qpos, qvel, *_ = at_rest(spec.compile(), "joint0")
    return Drawn(spec, qpos, qvel, timestep, 0.4, target)


def whips(rng: np.random.Generator) -> Drawn:
    """Two chains on ball joints that lash about one another and a thin post."""
    spec, timestep, speed = world(rng, INTEGRATORS[:4])
    speed, kinds = min(speed, 20.0), mujoco.mjtJoint
    for whip, height in enumerate((0.0, 0.05)):
        body = spec.worldbody
        for k in range(int(rng.integers(3, 7))):
            body = body.add_body(pos=[0.08, 0, 0] if k else [-0.2, 0, height])
            kind = kinds.mjJNT_BALL if k else kinds.mjJNT_HINGE
            body.add_joint(type=kind, axis=[0, 1, 0] if whip else [0, 0, 1], damping=1e-4)
            thick = [between(rng, 1e-3, 8e-3), between(rng, 1e-3, 8e-3), 0]
            form, ends = "box" if rng.random() < 0.4 else "capsule", [0.004, 0, 0, 0.076, 0, 0]
            solid(body, f"whip{whip}{k}", form, thick, fromto=ends, mass=0.02)
    post = spec.worldbody.add_body(name="post", pos=[0.1, 0.1, 0])
    solid(post, "post", "cylinder", [between(rng, 1e-3, 0.01), 0.2, 0])
    model = spec.compile()
    qvel = rng.normal(size=model.nv) * 2.25 * speed
    qvel *= min(1.0, GYRATION / timestep / max(float(np.abs(qvel).max()), 1e-9))
    return Drawn(spec, model.qpos0.copy(), qvel, timestep, 0.15)
