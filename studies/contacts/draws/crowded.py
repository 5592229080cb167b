"""Scenes of many thin things and of small ones: a cage of bodies, a grid, millimetres."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from studies.contacts.draws.world import (
    AFTER,
    FREE,
    Thrown,
    any_spin,
    any_way,
    between,
    shape,
    slab,
    world,
)


def mill(rng: np.random.Generator) -> Thrown:
    """Four to thirteen bodies in a closed cage of thin walls, in all directions."""
    spec, timestep, speed = world(rng, FREE)
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
        body = spec.worldbody.add_body(name=f"body{k}", pos=place)
        body.add_freejoint(name=f"body{k}")
        shape(rng, spec, body, f"body{k}", 0.02, ("sphere", "box", "capsule", "cylinder"))
        body.geoms[0].size = np.minimum(body.geoms[0].size, 0.013)
    model = spec.compile()
    qvel = np.zeros(model.nv)
    for k in range(count):
        dof = int(model.joint(f"body{k}").dofadr[0])
        qvel[dof : dof + 3] = rng.normal(size=3) * min(speed, 30.0)
        qvel[dof + 3 : dof + 6] = rng.normal(size=3) * min(0.1 / timestep, 30.0)
    return Thrown("mill", spec, model.qpos0.copy(), qvel, timestep, 0.1, "body0")


def grid(rng: np.random.Generator) -> Thrown:
    """A thin disc, plate or lens onto a grid of thin bars."""
    spec, timestep, speed = world(rng, FREE)
    radius, bars = between(rng, 5e-4, 4e-3), spec.worldbody.add_body(name="grid")
    for k in range(6):
        x = (k - 2.5) * 0.03
        for along, ends in enumerate(([x, -0.1, 0, x, 0.1, 0], [-0.1, x, 0, 0.1, x, 0])):
            kind = mujoco.mjtGeom.mjGEOM_CAPSULE
            bars.add_geom(name=f"bar{k}{along}", type=kind, fromto=ends, size=[radius, 0, 0])
    body = spec.worldbody.add_body(name="body")
    body.add_freejoint(name="body")
    wide, thin = rng.uniform(0.025, 0.05), between(rng, 5e-4, 3e-3)
    kind, size = [
        ("CYLINDER", [wide, thin, 0]),
        ("BOX", [wide, wide, thin]),
        ("ELLIPSOID", [wide, 0.8 * wide, thin]),
    ][int(rng.integers(3))]
    kinds = mujoco.mjtGeom
    body.add_geom(name="body", type=getattr(kinds, f"mjGEOM_{kind}"), size=size, mass=0.02)
    model = spec.compile()
    qpos, qvel = model.qpos0.copy(), np.zeros(model.nv)
    height = 0.06 + rng.random() * speed * timestep
    qpos[:3] = [*rng.uniform(-0.02, 0.02, 2), height]
    tilt = Rotation.from_euler("xy", rng.uniform(-60, 60, 2), degrees=True)
    qpos[3:7] = np.roll(tilt.as_quat(), 1)
    qvel[2] = -speed
    qvel[3:6] = any_spin(rng, timestep)
    return Thrown("grid", spec, qpos, qvel, timestep, height / speed + AFTER, "body")


def small(rng: np.random.Generator) -> Thrown:
    """A body of millimetres, or less, onto a plate that is as much thinner."""
    spec, timestep, speed = world(rng, FREE)
    scale = float(10 ** rng.uniform(-2.3, -1))
    speed, spec.stat.meansize, spec.compiler.boundinertia = speed * scale, 0.01 * scale, 1e-12
    plate = spec.worldbody.add_body(name="plate")
    half = between(rng, 1e-3, 1e-2) * scale
    slab(rng, plate, "plate", (0.3 * scale, 0.3 * scale, half), scale**3)
    if rng.random() < 0.4:
        plate.add_freejoint(name="plate")
    body = spec.worldbody.add_body(name="body")
    body.add_freejoint(name="body")
    kind = str(rng.choice(["BOX", "CAPSULE", "CYLINDER", "SPHERE", "ELLIPSOID"]))
    size = between(rng, 3e-3, 0.03) * scale * np.exp(rng.uniform(-0.5, 1, 3))
    if kind in ("CAPSULE", "CYLINDER"):
        size = np.array([size[0], size[2], 0])
    mass = max(1e-6, 10 * scale**3)
    kinds = mujoco.mjtGeom
    body.add_geom(name="body", type=getattr(kinds, f"mjGEOM_{kind}"), size=size, mass=mass)
    model = spec.compile()
    qpos, qvel = model.qpos0.copy(), np.zeros(model.nv)
    at, dof = int(model.joint("body").qposadr[0]), int(model.joint("body").dofadr[0])
    height = 2 * float(np.linalg.norm(size)) + 0.012 * scale + rng.random() * speed * timestep
    qpos[at + 2], qpos[at + 3 : at + 7] = height, any_way(rng)
    qvel[dof + 2] = -speed
    qvel[dof + 3 : dof + 6] = any_spin(rng, timestep)
    return Thrown("small", spec, qpos, qvel, timestep, height / speed + AFTER, "body")
