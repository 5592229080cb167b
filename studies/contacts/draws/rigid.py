"""Rigid scenes of one thing against another: plates, pairs, chains, cups, arms."""

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


def plate(rng: np.random.Generator) -> Thrown:
    """A convex body onto a plate of 1 to 20 mm, fixed or free, at any angle and spin."""
    spec, timestep, speed = world(rng, FREE)
    half = between(rng, 5e-4, 1e-2)
    mass = between(rng, 5e-3, 2.0)
    under = spec.worldbody.add_body(name="plate")
    slab(rng, under, "plate", (0.3, 0.3, half), mass * rng.uniform(0.5, 20), spec)
    if rng.random() < 1 / 3:
        under.add_freejoint()
    body = spec.worldbody.add_body(name="body")
    body.add_freejoint()
    reach = shape(rng, spec, body, "body", mass)
    height = half + reach + 0.005 + rng.random() * speed * timestep
    place = [*rng.uniform(-0.05, 0.05, 2), height]
    return thrown("plate", rng, spec, timestep, speed, place, "body", height)


def pair(rng: np.random.Generator) -> Thrown:
    """Two convex bodies of any kinds, head on or past each other's middle."""
    spec, timestep, speed = world(rng, FREE)
    reaches = []
    for name in ("first", "body"):
        body = spec.worldbody.add_body(name=name)
        body.add_freejoint()
        reaches.append(shape(rng, spec, body, name, between(rng, 5e-3, 0.5)))
    gap = sum(reaches) + 0.005 + rng.random() * speed * timestep
    aside = rng.normal(size=2) * 0.2 * min(reaches) * rng.integers(2)
    return thrown("pair", rng, spec, timestep, speed, [*aside, gap], "body", gap, slide=0.0)


def chain(rng: np.random.Generator) -> Thrown:
    """Three to eight capsules on ball joints onto a thin plate, a box or a mesh."""
    spec, timestep, speed = world(rng, FREE[:4])
    half = between(rng, 5e-4, 5e-3)
    slab(rng, spec.worldbody.add_body(name="plate"), "plate", (0.4, 0.4, half), 1.0, spec)
    radius, length = between(rng, 3e-3, 1e-2), between(rng, 1e-2, 3e-2)
    body = spec.worldbody.add_body(name="body")
    body.add_freejoint()
    for k in range(int(rng.integers(3, 9))):
        if k:
            body = body.add_body(name=f"link{k}", pos=[2 * (length + radius), 0, 0])
            body.add_joint(type=mujoco.mjtJoint.mjJNT_BALL, pos=[-length - radius, 0, 0])
        body.add_geom(
            name=f"capsule{k}",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[radius, length, 0],
            quat=[0.7071067811865476, 0, 0.7071067811865476, 0],
            mass=0.02,
        )
    height = half + radius + 0.005 + rng.random() * speed * timestep
    place = [-0.15, 0, height]
    return thrown("chain", rng, spec, timestep, speed, place, "capsule0", height, flat=True)


def cup(rng: np.random.Generator) -> Thrown:
    """Balls in a thin cup that is jerked sideways."""
    spec, timestep, speed = world(rng, FREE, gravity=True)
    half, wall = between(rng, 5e-4, 3e-3), 0.05
    vessel = spec.worldbody.add_body(name="cup")
    vessel.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0], name="body")
    sides: list[tuple[tuple[float, ...], tuple[float, ...]]] = [
        ((wall, wall, half), (0, 0, -half)),
        *(((half, wall, wall), (s * (wall + half), 0, wall)) for s in (-1, 1)),
        *(((wall, half, wall), (0, s * (wall + half), wall)) for s in (-1, 1)),
    ]
    for k, (size, place) in enumerate(sides):
        slab(rng, vessel, f"wall{k}", size, 1.0, pos=place)
    radius = between(rng, 4e-3, 8e-3)
    for k in range(int(rng.integers(4, 25))):
        ball = spec.worldbody.add_body(
            name=f"ball{k}",
            pos=[(k % 3 - 1) * 0.03, (k // 3 % 3 - 1) * 0.03, radius + 0.0171 * (k // 9) + 1e-3],
        )
        ball.add_freejoint()
        ball.add_geom(name=f"ball{k}", size=[radius, 0, 0], mass=0.005)
    model = spec.compile()
    qvel = np.zeros(model.nv)
    qvel[model.joint("body").dofadr[0]] = min(speed, 20.0)
    seconds = 0.2 / min(speed, 20.0) + AFTER
    return Thrown("cup", spec, model.qpos0.copy(), qvel, timestep, seconds, "ball0")


def arm(rng: np.random.Generator) -> Thrown:
    """An arm of capsules, driven by its motors against a thin fixed plate among obstacles."""
    spec, timestep, _ = world(rng, FREE, gravity=True)
    half, links = between(rng, 5e-4, 5e-3), int(rng.integers(2, 5))
    slab(rng, spec.worldbody.add_body(name="plate"), "plate", (0.6, 0.6, half), 1.0)
    body = spec.worldbody
    for k in range(links):
        axis = [0, 1, 0] if rng.random() < 0.6 else rng.normal(size=3)
        body = body.add_body(name=f"link{k}", pos=[0.3, 0, 0] if k else [-0.3, 0, 0.4])
        damping = rng.uniform(0, 0.5)
        body.add_joint(name=f"joint{k}", axis=axis, damping=damping, armature=0.01)
        body.add_geom(
            name=f"link{k}",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[0, 0, 0, 0.3, 0, 0],
            size=[between(rng, 0.01, 0.04), 0, 0],
            mass=1.0,
        )
        motor = spec.add_actuator(name=f"motor{k}", target=f"joint{k}")
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
    _obstacles(rng, spec)
    model = spec.compile()
    ctrl = rng.uniform(10, 100, links)
    qvel = rng.uniform(0, 10, model.nv)
    return Thrown("arm", spec, model.qpos0.copy(), qvel, timestep, 0.25, "link0", ctrl)


def _obstacles(rng: np.random.Generator, spec: Any) -> None:
    """Up to four fixed posts, balls and boxes beside the arm's first pose."""
    for k in range(int(rng.integers(5))):
        place = [rng.uniform(-0.3, 0.6), rng.choice([-1, 1]) * rng.uniform(0.12, 0.4), 0.3]
        body = spec.worldbody.add_body(name=f"obstacle{k}", pos=place)
        kind = rng.choice(["sphere", "capsule", "box"])
        thin = between(rng, 2e-3, 0.03)
        body.add_geom(
            name=f"obstacle{k}",
            type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}"),
            size=[thin, 0.2 if kind == "capsule" else thin, thin if kind == "sphere" else 0.2],
        )
