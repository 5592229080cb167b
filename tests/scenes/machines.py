"""Scenes with what machines have: gears, screws, tendons, belts, wind, breaking welds, crowds."""

from __future__ import annotations

from functools import partial
from typing import Any

import mujoco
import numpy as np

from scenes.drawing import (
    AFTER,
    INTEGRATORS,
    Drawn,
    any_spin,
    any_way,
    at_rest,
    between,
    free_body,
    settle,
    shape,
    slab,
    solid,
    thrown,
    world,
)

#: Kinds of the bodies that are thrown into a machine.
_LOOSE = ("sphere", "box", "capsule", "cylinder", "ellipsoid")


def _loose(rng: np.random.Generator, spec: Any, places: Any, speed: float, h: float) -> Drawn:
    """Free bodies at these places, in all directions, for 0.15 s."""
    for k, place in enumerate(places):
        body = free_body(spec, f"body{k}", place)
        shape(rng, spec, body, f"body{k}", between(rng, 5e-3, 0.2), _LOOSE)
    model = spec.compile()
    qpos, qvel = model.qpos0.copy(), np.zeros(model.nv)
    for k in range(len(places)):
        joint = model.joint(f"body{k}")
        at, dof = int(joint.qposadr[0]), int(joint.dofadr[0])
        qpos[at + 3 : at + 7] = any_way(rng)
        qvel[dof : dof + 3] = -np.asarray(places[k]) / 0.2 * min(speed, 30.0)
        qvel[dof + 3 : dof + 6] = any_spin(rng, h)
    return Drawn(spec, qpos, qvel, h, 0.15)


def _around(rng: np.random.Generator, count: int) -> Any:
    angle = rng.uniform(0, 2 * np.pi) + 2 * np.pi * np.arange(count) / count
    return np.c_[0.2 * np.cos(angle), 0.2 * np.sin(angle), rng.uniform(-0.02, 0.02, count)]


def gears(rng: np.random.Generator) -> Drawn:
    """Two wheels of thin spokes that a joint equality gears, driven, with loose bodies."""
    spec, h, speed = world(rng, INTEGRATORS)
    ratio, spokes = float(rng.choice([-3, -2, -1, -0.5])), int(rng.integers(3, 7))
    for name, x in (("first", -0.07), ("second", 0.07)):
        wheel = spec.worldbody.add_body(name=name, pos=[x, 0, 0])
        wheel.add_joint(name=name, axis=[0, 0, 1], damping=0.01)
        for k in range(spokes):
            turn = np.pi * (2 * k + (name == "second")) / spokes
            quat, ends = [np.cos(turn / 2), 0, 0, np.sin(turn / 2)], np.zeros(3)
            ends[:2] = 0.035 * np.cos(turn), 0.035 * np.sin(turn)
            size = [0.03, between(rng, 5e-4, 4e-3), 0.03]
            solid(wheel, f"{name}{k}", "box", size, quat=quat, pos=ends, mass=0.05)
    equality = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1="first", name2="second")
    equality.objtype, equality.data[:2] = mujoco.mjtObj.mjOBJ_JOINT, [0, ratio]
    drive = spec.add_actuator(target="first", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    drive.gear[0] = between(rng, 0.1, 10)
    scene = _loose(rng, spec, _around(rng, int(rng.integers(1, 4))), speed, h)
    rate = between(rng, 1, 100)
    scene.qvel[0], scene.qvel[1] = ratio * rate, rate
    return Drawn(spec, scene.qpos, scene.qvel, h, 0.15, np.array([rng.uniform(-1, 1)]))


def screw(rng: np.random.Generator) -> Drawn:
    """A press: a plate on a spindle (slide and hinge, one equality) that goes down onto bodies."""
    spec, h, speed = world(rng, INTEGRATORS, gravity=True)
    slab(rng, spec.worldbody.add_body(name="bed"), "bed", (0.2, 0.2, between(rng, 1e-3, 5e-3)), 1.0)
    spindle = spec.worldbody.add_body(name="spindle", pos=[0, 0, 0.25])
    spindle.add_joint(name="lift", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    spindle.add_joint(name="turn", axis=[0, 0, 1], armature=1e-3)
    slab(rng, spindle, "press", (0.12, 0.12, between(rng, 5e-4, 5e-3)), between(rng, 0.1, 5), spec)
    equality = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1="lift", name2="turn")
    pitch = between(rng, 1e-3, 2e-2)
    equality.objtype, equality.data[:2] = mujoco.mjtObj.mjOBJ_JOINT, [0, pitch]
    for k in range(int(rng.integers(1, 4))):
        body = free_body(spec, f"body{k}", [0.09 * (k - 1), 0, 0.12])
        shape(rng, spec, body, f"body{k}", between(rng, 5e-3, 0.2), _LOOSE)
    drop = -min(speed, 20.0)
    qpos, qvel, *_ = at_rest(model := spec.compile(), "lift")
    lift, turn = (int(model.joint(name).dofadr[0]) for name in ("lift", "turn"))
    qvel[lift], qvel[turn] = drop, drop / pitch
    limit = 1.0 / h  # rad/s
    if abs(qvel[turn]) > limit:
        qvel[[lift, turn]] *= limit / abs(qvel[turn])
    return Drawn(spec, qpos, qvel, h, min(0.3, 0.2 / abs(qvel[lift]) + AFTER))


def tendons(rng: np.random.Generator) -> Drawn:
    """A body on springs or a rope around a post, which fling it at a thin plate."""
    spec, h, speed = world(rng, INTEGRATORS)
    half = between(rng, 5e-4, 5e-3)
    slab(rng, spec.worldbody.add_body(name="plate"), "plate", (0.3, 0.3, half), 1.0, spec)
    post = spec.worldbody.add_body(name="post", pos=[0.1, 0, 0.15])
    solid(post, "post", "cylinder", [0.02, 0.1, 0], quat=(0.5**0.5, 0.5**0.5, 0, 0))
    spec.worldbody.add_site(name="anchor", pos=[0.25, 0, 0.05])
    spec.worldbody.add_site(name="beside", pos=[0.1, 0, 0.25])
    body = free_body(spec, "body")
    body.add_site(name="hook")
    reach = shape(rng, spec, body, "body", between(rng, 5e-3, 0.3), _LOOSE)
    tendon = spec.add_tendon(limited=1, range=[0, between(rng, 0.1, 0.4)])
    tendon.stiffness[:1], tendon.springlength[:2] = between(rng, 1, 2000), [0, 0.05]
    tendon.wrap_site("anchor")
    tendon.wrap_geom("post", "beside")
    tendon.wrap_site("hook")
    gap = half + reach + 0.005 + rng.random() * speed * h
    return thrown(rng, spec, h, speed, [-0.1, 0, gap], gap)


def block(rng: np.random.Generator) -> Drawn:
    """A body into a soft block of tetrahedra, by its vertices or by a few nodes."""
    dof = str(rng.choice(["full", "trilinear", "quadratic"]))
    young = between(rng, 1e4, 1e6)
    pins = '<pin id="0 3 6 9 12"/>' if dof == "full" else '<pin id="0 1 2 3"/>'
    spec = mujoco.MjSpec.from_string(f"""<mujoco><worldbody><body name="frame">
      <flexcomp name="soft" type="grid" dim="3" count="5 5 3" radius="{between(rng, 5e-4, 4e-3)!r}"
        spacing="0.03 0.03 0.03" mass="{between(rng, 0.05, 0.5)!r}" dof="{dof}">
        <elasticity young="{young!r}" poisson="0.2" damping="1e-3"/>{pins}
        <contact selfcollide="none" solref="0.003 1"/></flexcomp></body>
      </worldbody></mujoco>""")
    h, speed = settle(spec, rng, ("discrete", "euler")), between(rng, 1.0, 30.0)
    body = free_body(spec, "body")
    reach = shape(rng, spec, body, "body", between(rng, 5e-3, 0.1), least=0.008)
    gap = reach + 0.04 + rng.random() * speed * h
    data = mujoco.MjData(model := spec.compile())
    mujoco.mj_forward(model, data)
    x = data.flexvert_xpos
    place = [*x.mean(axis=0)[:2] + rng.uniform(-0.02, 0.02, 2), x[:, 2].max() + gap]
    return thrown(rng, spec, h, speed, place, gap, slide=0.0)


def sheets(rng: np.random.Generator) -> Drawn:
    """A body that falls with one sheet of cloth onto another one."""
    young, radius = between(rng, 1e5, 5e6), between(rng, 1e-3, 3e-3)

    def sheet(name: str, height: float, pins: str) -> str:
        return f"""<flexcomp name="{name}" type="grid" dim="2" count="7 7 1" radius="{radius!r}"
          spacing="0.03 0.03 0.03" mass="0.05" pos="0 0 {height!r}">
          <elasticity young="{young!r}" poisson="0.2" thickness="1e-3" elastic2d="stretch"/>{pins}
          <contact selfcollide="none" solref="0.003 1"/></flexcomp>"""

    spec = mujoco.MjSpec.from_string(f"""<mujoco><worldbody>
      {sheet("under", 0.0, '<pin id="0 6 42 48"/>')}{sheet("over", 0.02, "")}
      </worldbody></mujoco>""")
    h, speed = settle(spec, rng, ("discrete",)), between(rng, 1.0, 15.0)
    body = free_body(spec, "body")
    reach = shape(rng, spec, body, "body", between(rng, 5e-3, 0.05), least=0.008)
    gap = reach + radius + 0.003 + rng.random() * speed * h
    return thrown(rng, spec, h, speed, [*rng.uniform(-0.03, 0.03, 2), 0.02 + gap], gap, slide=0.0)


def terrain(rng: np.random.Generator) -> Drawn:
    """Bodies on a height field, which is not covered, and on a thin plate, which is."""
    spec, h, speed = world(rng, INTEGRATORS, gravity=True)
    field = rng.random(64)
    spec.add_hfield(name="hills", nrow=8, ncol=8, size=[0.3, 0.3, 0.03, 0.05], userdata=field)
    ground = spec.worldbody.add_geom(name="hills", pos=[0, 0, -0.3])
    ground.type, ground.hfieldname = mujoco.mjtGeom.mjGEOM_HFIELD, "hills"
    under = spec.worldbody.add_body(name="plate")
    slab(rng, under, "plate", (0.2, 0.2, between(rng, 5e-4, 5e-3)), 1.0, spec)
    places = np.c_[rng.uniform(-0.1, 0.1, (3, 2)), 0.1 + 0.08 * np.arange(3)]
    return _loose(rng, spec, places, speed, h)


def distance_field(rng: np.random.Generator) -> Drawn:
    """Bodies onto a signed distance field, which is not covered, over a thin plate."""
    spec, h, speed = world(rng, INTEGRATORS, gravity=True)
    corners = rng.normal(size=(12, 3))
    corners *= 0.04 / np.linalg.norm(corners, axis=1, keepdims=True)
    spec.add_mesh(name="lump", uservert=corners.ravel(), maxhullvert=12)
    lump = spec.worldbody.add_geom(name="lump", pos=[0.1, 0, 0.05])
    lump.type, lump.meshname = mujoco.mjtGeom.mjGEOM_SDF, "lump"
    under = spec.worldbody.add_body(name="plate")
    slab(rng, under, "plate", (0.2, 0.2, between(rng, 5e-4, 5e-3)), 1.0)
    places = np.c_[[0.1, -0.05], rng.uniform(-0.05, 0.05, 2), [0.15, 0.1]]
    return _loose(rng, spec, places, speed, h)


def crowd(rng: np.random.Generator) -> Drawn:
    """Two hundred balls and boxes in layers, thrown at a thin plate."""
    spec, h, speed = world(rng, INTEGRATORS, gravity=True)
    spec.memory, speed = 1 << 28, min(speed, 20.0)
    under = spec.worldbody.add_body(name="plate")
    slab(rng, under, "plate", (0.3, 0.3, between(rng, 1e-3, 5e-3)), 1.0)
    for k in range(200):
        place = [0.05 * (k % 8) - 0.18, 0.05 * (k // 8 % 5) - 0.1, 0.03 + 0.05 * (k // 40)]
        kind = "sphere" if rng.random() < 0.7 else "box"
        body = free_body(spec, f"body{k}", place)
        solid(body, f"body{k}", kind, between(rng, 3e-3, 0.014) * np.ones(3), mass=0.01)
    model = spec.compile()
    qvel = np.zeros(model.nv)
    qvel[2::6] = -speed
    return Drawn(spec, model.qpos0.copy(), qvel, h, 0.06)


def breaking(rng: np.random.Generator) -> Drawn:
    """Bodies that welds, connections and joint equalities hold until they break in flight."""
    spec, h, speed = world(rng, INTEGRATORS)
    half, count = between(rng, 5e-4, 5e-3), int(rng.integers(2, 5))
    slab(rng, spec.worldbody.add_body(name="plate"), "plate", (0.3, 0.3, half), 1.0, spec)
    reach = 0.0
    for k in range(count):
        body = free_body(spec, f"body{k}" if k else "body")
        reach = max(reach, shape(rng, spec, body, f"geom{k}", between(rng, 5e-3, 0.3), _LOOSE))
        if k:
            kind = mujoco.mjtEq.mjEQ_WELD if rng.random() < 0.5 else mujoco.mjtEq.mjEQ_CONNECT
            names = {"name1": f"body{k - 1}" if k > 1 else "body", "name2": f"body{k}"}
            spec.add_equality(type=kind, objtype=mujoco.mjtObj.mjOBJ_BODY, **names)
    gap = half + reach + 0.005 + rng.random() * speed * h
    scene = thrown(rng, spec, h, speed, [-0.1, 0, gap], gap, slide=0.0)
    model = spec.compile()
    for k in range(1, count):
        *_, at, dof = at_rest(model, f"body{k}")
        scene.qpos[at : at + 3] = [0.1 * k - 0.1, 0, gap]
        scene.qvel[dof : dof + 3] = [0, 0, -speed]
    times = rng.uniform(0, scene.seconds, model.neq)
    move = partial(_break, times)
    return Drawn(spec, scene.qpos, scene.qvel, h, scene.seconds, move=move)


def _break(times: Any, data: Any, time: float) -> None:
    data.eq_active[:] &= time < times


def hand(rng: np.random.Generator) -> Drawn:
    """A plate that a weld drags behind a mocap body, through free bodies towards a wall."""
    spec, h, speed = world(rng, INTEGRATORS)
    speed = min(speed, 20.0)
    spec.worldbody.add_body(name="lead", mocap=True, pos=[-0.2, 0, 0])
    pad = free_body(spec, "pad", [-0.2, 0, 0])
    slab(rng, pad, "pad", (between(rng, 5e-4, 5e-3), 0.15, 0.15), between(rng, 0.05, 1), spec)
    weld = spec.add_equality(type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY)
    weld.name1, weld.name2 = "lead", "pad"
    wall = spec.worldbody.add_body(name="wall", pos=[0.3, 0, 0])
    slab(rng, wall, "wall", (between(rng, 5e-4, 5e-3), 0.3, 0.3), 1.0)
    for k in range(int(rng.integers(1, 4))):
        body = free_body(spec, f"body{k}", [0, (k - 1) * 0.1, 0])
        shape(rng, spec, body, f"body{k}", between(rng, 5e-3, 0.3))
    qpos, qvel, *_ = at_rest(spec.compile(), "pad")
    return Drawn(spec, qpos, qvel, h, 0.4 / speed + AFTER, move=partial(_lead, speed))


def _lead(speed: float, data: Any, time: float) -> None:
    data.mocap_pos[0] = [min(-0.2 + speed * time, 0.1), 0, 0]


def belt(rng: np.random.Generator) -> Drawn:
    """Sticky bodies on a thin belt whose surface moves, between explicit pairs and exclusions."""
    spec, h, speed = world(rng, INTEGRATORS, gravity=True)
    under = spec.worldbody.add_body(name="belt")
    slab(rng, under, "belt", (0.3, 0.1, between(rng, 5e-4, 5e-3)), 1.0)
    under.geoms[0].surfacevel[:3] = [between(rng, 0.5, 20), 0, 0]
    gate = spec.worldbody.add_body(name="gate", pos=[0.2, 0, 0.05])
    slab(rng, gate, "gate", (between(rng, 5e-4, 5e-3), 0.1, 0.05), 1.0)
    places = np.c_[[-0.2, -0.1, 0.0], rng.uniform(-0.05, 0.05, 3), np.full(3, 0.08)]
    scene = _loose(rng, spec, places, speed, h)
    for k in range(3):
        geom = spec.geom(f"body{k}")
        geom.adhesion = rng.uniform(0, 5) * rng.integers(2)
        if rng.random() < 0.5:
            other = str(rng.choice(["belt", "gate"]))
            condim = int(rng.choice([1, 3, 4, 6]))
            spec.add_pair(geomname1=other, geomname2=f"body{k}", condim=condim, margin=1e-3)
    if rng.random() < 0.5:
        spec.add_exclude(bodyname1="body0", bodyname2="body1")
    return scene


def wind(rng: np.random.Generator) -> Drawn:
    """Light plates in a thick, moving medium, blown against a thin net of rods and one another."""
    spec, h, speed = world(rng, INTEGRATORS)
    spec.option.density, spec.option.viscosity = between(rng, 0.1, 100), between(rng, 1e-5, 0.1)
    spec.option.wind = [0, 0, -between(rng, 1, 40)]
    net = spec.worldbody.add_body(name="net")
    for k in range(8):
        ends = [0.03 * (k - 3.5), -0.15, 0, 0.03 * (k - 3.5), 0.15, 0]
        solid(net, f"rod{k}", "capsule", [between(rng, 5e-4, 3e-3), 0, 0], fromto=ends)
    for k in range(3):
        body = free_body(spec, f"body{k}", [0, 0, 0.1 + 0.05 * k])
        size = [0.04, 0.04, between(rng, 3e-4, 2e-3)]
        solid(body, f"body{k}", "box", size, mass=between(rng, 1e-3, 0.05))
    qpos, qvel, *_ = at_rest(spec.compile(), "body0")
    qvel[2::6] = -min(speed, 30.0) * rng.random(3)
    return Drawn(spec, qpos, qvel, h, 0.2)


def piston(rng: np.random.Generator) -> Drawn:
    """A slide with limits that a strong actuator drives through loose bodies, geoms in a tree."""
    spec, h, speed = world(rng, INTEGRATORS)
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT) * int(rng.integers(2))
    wall = spec.worldbody.add_body(name="wall", pos=[0.25, 0, 0])
    slab(rng, wall, "wall", (between(rng, 5e-4, 5e-3), 0.2, 0.2), 1.0)
    rod = spec.worldbody.add_body(name="rod", pos=[-0.25, 0, 0])
    rod.add_joint(name="rod", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0], limited=1)
    rod.joints[0].range = [-0.1, rng.choice([0.4, 0.6])]
    slab(rng, rod, "head", (between(rng, 5e-4, 5e-3), 0.1, 0.1), between(rng, 0.2, 5), spec)
    flap = rod.add_body(name="flap", pos=[0.02, 0, 0.1])
    flap.add_joint(name="flap", axis=[0, 1, 0])
    slab(rng, flap, "flap", (between(rng, 5e-4, 3e-3), 0.08, 0.04), 0.1, pos=(0, 0, 0.045))
    drive = spec.add_actuator(target="rod", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    drive.gear[0] = between(rng, 1, 1000)
    places = [[0.0, 0.08 * (k - 1), 0.0] for k in range(int(rng.integers(1, 4)))]
    scene = _loose(rng, spec, places, speed, h)
    scene.qvel[0] = min(speed, 20.0)
    return Drawn(spec, scene.qpos, scene.qvel, h, 0.15, np.ones(1))


def tools(rng: np.random.Generator) -> Drawn:
    """A rotor with thin tools on bodies without joints, on one another, among posts and bodies."""
    spec, h, speed = world(rng, INTEGRATORS)
    rotor = spec.worldbody.add_body(name="rotor")
    rotor.add_joint(name="rotor", axis=[0, 0, 1], armature=1e-3)
    solid(rotor, "hub", "sphere", [0.02, 0, 0], mass=1.0)
    for k in range(int(rng.integers(1, 4))):
        turn, link = 2 * np.pi * k / 3, rotor
        quat = [np.cos(turn / 2), 0, 0, np.sin(turn / 2)]
        for part in range(int(rng.integers(1, 4))):
            link = link.add_body(pos=[0.06, 0, 0] if part else [0, 0, 0], quat=quat)
            quat = list(any_way(rng)) if rng.random() < 0.3 else [1, 0, 0, 0]
            size = [between(rng, 5e-4, 4e-3), 0.03, 0]
            at = {"pos": [0.06, 0, 0], "quat": any_way(rng), "mass": 1e-3}
            solid(link, f"tool{k}{part}", "capsule", size, **at)
    for k, (x, y, _) in enumerate(_around(rng, 3)):
        post = spec.worldbody.add_body(name=f"post{k}", pos=[0.6 * x, 0.6 * y, 0])
        solid(post, f"post{k}", "capsule", [between(rng, 5e-4, 4e-3), 0.05, 0])
    scene = _loose(rng, spec, _around(rng, int(rng.integers(1, 4))), speed, h)
    scene.qvel[0] = between(rng, 5, 200)
    return scene


def gripper(rng: np.random.Generator) -> Drawn:
    """Two fingers that a joint equality (mimic) or a tendon couples, driven onto loose bodies."""
    spec, h, speed = world(rng, INTEGRATORS)
    palm = spec.worldbody.add_body(name="palm", pos=[0, 0, -0.12])
    palm.add_joint(name="palm", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1], damping=1)
    slab(rng, palm, "palm", (0.1, 0.03, between(rng, 1e-3, 5e-3)), 0.3)
    for name, side in (("left", -1), ("right", 1)):
        finger = palm.add_body(name=name, pos=[0.1 * side, 0, 0.08])
        finger.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[-side, 0, 0], damping=1)
        solid(finger, name, "box", [between(rng, 5e-4, 4e-3), 0.03, 0.06], mass=0.05)
        tip = finger.add_body(pos=[0, 0, 0.07])  # a pad without a joint
        solid(tip, f"{name}_tip", "cylinder", [0.01, 0.01, 0], mass=0.01)
    drive = spec.add_actuator(target="left", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    if rng.random() < 0.5:
        equality = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1="left", name2="right")
        equality.objtype, equality.data[:2] = mujoco.mjtObj.mjOBJ_JOINT, [0, 1]
    else:
        tendon = spec.add_tendon(name="both")
        tendon.wrap_joint("left", 0.5), tendon.wrap_joint("right", 0.5)
        drive.target, drive.trntype = "both", mujoco.mjtTrn.mjTRN_TENDON
    drive.gear[0] = between(rng, 1, 300)
    places = [[0.03 * (k - 1), 0.0, 0.05 * k] for k in range(int(rng.integers(1, 4)))]
    scene = _loose(rng, spec, places, min(speed, 10.0), h)
    return Drawn(spec, scene.qpos, scene.qvel, h, 0.15, np.ones(1))


def solids(rng: np.random.Generator) -> Drawn:
    """A solid flex (of tetrahedra) between loose bodies, over a thin floor."""
    spec, h, speed = world(rng, ("discrete",))
    slab(
        rng, spec.worldbody.add_body(name="floor"), "floor", (0.3, 0.3, between(rng, 1e-3, 5e-3)), 1
    )
    text = f"""<mujoco><worldbody><flexcomp name="jelly" type="grid" dim="3" count="3 3 3"
      spacing=".03 .03 .03" pos="0 0 .06" radius="{between(rng, 5e-4, 3e-3)}" mass=".1">
      <contact selfcollide="none"/><elasticity young="{between(rng, 1e4, 1e6)}" poisson=".2"
      damping=".001"/></flexcomp></worldbody></mujoco>"""
    spec.attach(mujoco.MjSpec.from_string(text), frame=spec.worldbody.add_frame())
    places = np.c_[rng.uniform(-0.05, 0.05, (2, 2)), [0.15, 0.22]]
    scene = _loose(rng, spec, places, min(speed, 20.0), h)
    return Drawn(spec, scene.qpos, scene.qvel, h, 0.06)
