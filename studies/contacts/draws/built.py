"""Rigid scenes of bodies that are built of parts: several geoms, stacks, joined bodies."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from studies.contacts.draws.world import (
    AFTER,
    FREE,
    Thrown,
    between,
    shape,
    slab,
    thrown,
    world,
)


def composite(rng: np.random.Generator) -> Thrown:
    """A body of two to four geoms onto a thin plate, or onto another such body."""
    spec, timestep, speed = world(rng, FREE)
    half = between(rng, 5e-4, 5e-3)
    if rng.random() < 0.5:
        slab(rng, spec.worldbody.add_body(name="plate"), "plate", (0.4, 0.4, half), 1.0, spec)
        below = half
    else:
        other = spec.worldbody.add_body(name="other")
        other.add_freejoint()
        below = _parts(rng, spec, other, "other")
    body = spec.worldbody.add_body(name="body")
    body.add_freejoint()
    height = below + _parts(rng, spec, body, "body") + 0.005 + rng.random() * speed * timestep
    return thrown("composite", rng, spec, timestep, speed, [0, 0, height], "body0", height)


def _parts(rng: np.random.Generator, spec: Any, body: Any, name: str) -> float:
    """Give a body its geoms; how far they reach [m]."""
    most = 0.0
    for k in range(int(rng.integers(2, 5))):
        reach = shape(rng, spec, body, f"{name}{k}", between(rng, 5e-3, 0.3))
        place = rng.normal(size=3) * 0.03
        body.geoms[k].pos = place
        body.geoms[k].quat = rng.normal(size=4)
        most = max(most, reach + float(np.linalg.norm(place)))
    return most


def stack(rng: np.random.Generator) -> Thrown:
    """Flat boxes and cylinders on one another on a thin plate, hit from above or from the side."""
    spec, timestep, speed = world(rng, FREE, gravity=True)
    half, top = between(rng, 5e-4, 5e-3), 0.0
    slab(rng, spec.worldbody.add_body(name="plate"), "plate", (0.4, 0.4, half), 1.0)
    for k in range(int(rng.integers(2, 7))):
        thin, wide = between(rng, 1e-3, 0.02), between(rng, 0.02, 0.06)
        part = spec.worldbody.add_body(name=f"part{k}", pos=[0, 0, half + top + thin])
        part.add_freejoint()
        kind = str(rng.choice(["BOX", "CYLINDER"]))
        part.add_geom(
            name=f"part{k}",
            type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"),
            size=[wide, wide, thin] if kind == "BOX" else [wide, thin, 0],
            mass=between(rng, 0.02, 0.5),
        )
        top += 2 * thin + 1e-4
    body = spec.worldbody.add_body(name="body")
    body.add_freejoint()
    reach = shape(rng, spec, body, "body", between(rng, 5e-3, 0.5))
    way = reach + 0.005 + rng.random() * speed * timestep
    above = rng.random() < 0.5
    normal = np.array([0, 0, 1.0] if above else [1.0, 0, 0])
    place = [0, 0, half + top + way] if above else [0.06 + way, 0, half + 0.5 * top + reach]
    return thrown("stack", rng, spec, timestep, speed, place, "body", way, normal, slide=0.0)


def joined(rng: np.random.Generator) -> Thrown:
    """Two to four bodies tied by an equality or a tendon, onto a thin plate that may be a door."""
    spec, timestep, speed = world(rng, FREE)
    half = between(rng, 5e-4, 5e-3)
    under = spec.worldbody.add_body(name="plate")
    slab(rng, under, "plate", (0.3, 0.3, half), between(rng, 0.2, 5.0), spec)
    if rng.random() < 1 / 3:
        under.add_joint(name="door", axis=[1, 0, 0], pos=[0, 0.3, 0], stiffness=5, damping=0.1)
    how, reach, count = str(rng.choice(["connect", "weld", "tendon"])), 0.0, int(rng.integers(2, 5))
    for k in range(count):
        body = spec.worldbody.add_body(name=f"body{k}" if k else "body", pos=[0.15 * k, 0, 1.0])
        body.add_freejoint()
        body.add_site(name=f"site{k}")
        reach = max(reach, shape(rng, spec, body, f"geom{k}", between(rng, 5e-3, 0.3)))
        if k:
            _tie(spec, how, k)
    height = half + reach + 0.005 + rng.random() * speed * timestep
    place = np.array([-0.1, 0, height])
    scene = thrown("joined", rng, spec, timestep, speed, place, "geom0", height, slide=0.0)
    model = spec.compile()
    for k in range(1, count):
        joint = int(model.body(f"body{k}").jntadr[0])
        at, dof = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        scene.qpos[at : at + 3] = place + np.array([0.15 * k, 0, 0])
        scene.qvel[dof : dof + 3] = [0, 0, -speed]
    return scene


def _tie(spec: Any, how: str, k: int) -> None:
    """Join body ``k`` to the one before."""
    first, second = f"body{k - 1}" if k > 1 else "body", f"body{k}"
    if how == "tendon":
        tendon = spec.add_tendon(name=f"tie{k}", limited=1, range=[0, 0.16])
        tendon.wrap_site(f"site{k - 1}")
        tendon.wrap_site(f"site{k}")
        return
    equality = spec.add_equality(name=f"tie{k}", name1=first, name2=second)
    equality.objtype = mujoco.mjtObj.mjOBJ_BODY
    equality.type = getattr(mujoco.mjtEq, f"mjEQ_{how.upper()}")
    if how == "connect":
        equality.data[:3] = [0.075, 0, 0]


def spin(rng: np.random.Generator) -> Thrown:
    """A long thin rotor on a hinge, which turns by up to more than one turn a step, near walls."""
    spec, timestep, _ = world(rng, FREE[1:])
    half, length = between(rng, 5e-4, 5e-3), between(rng, 0.05, 0.2)
    rotor = spec.worldbody.add_body(name="rotor")
    rotor.add_joint(name="rotor", axis=[0, 0, 1])
    kind = str(rng.choice(["CAPSULE", "BOX"]))
    thin = between(rng, 2e-3, 0.01)
    rotor.add_geom(
        name="rotor",
        type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"),
        size=[thin, length, 0] if kind == "CAPSULE" else [thin, thin, length],
        quat=[0.7071067811865476, 0, 0.7071067811865476, 0],
        pos=[length * rng.uniform(0, 0.8), 0, 0],
        mass=between(rng, 0.05, 1.0),
    )
    angle = rng.uniform(0.5, 2.5)
    place = 0.6 * length * np.array([np.cos(angle), np.sin(angle), 0])
    other = spec.worldbody.add_body(name="body", pos=place)
    if rng.random() < 0.5:
        other.add_freejoint()
    other.add_geom(
        name="body",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[0.02, half, 0.05],
        quat=[np.cos(angle / 2), 0, 0, np.sin(angle / 2)],
        mass=between(rng, 0.02, 1.0),
    )
    model = spec.compile()
    qvel = np.zeros(model.nv)
    qvel[0] = between(rng, 10, 1000)
    seconds = 10 / float(qvel[0]) + AFTER
    return Thrown("spin", spec, model.qpos0.copy(), qvel, timestep, seconds, "rotor")
