"""Scenes drawn at random in which something thin is in the way of something fast."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tauguard.contacts.scenes.impacts import STIFF
from tauguard.models.cloth import Cloth, add_cloth

Array = NDArray[np.float64]

#: Timesteps that scenes are drawn with [s].
TIMESTEPS = (1e-3, 2e-3, 5e-3)
#: Speeds [m/s].
SPEEDS = (1.0, 60.0)
#: What follows the touch [s].
AFTER = 0.03
_KINDS = ("sphere", "capsule", "cylinder", "box", "ellipsoid", "mesh")
_FREE = ("implicitfast", "implicitfast", "implicit", "discrete")


@dataclass(frozen=True)
class Thrown:
    """One scene; :mod:`tauguard.benchmarks.contacts.referee` says whether something passed."""

    family: str
    spec: Any  #: MjSpec
    qpos: Array  #: where it starts, shape (nq,)
    qvel: Array  #: how fast, shape (nv,)
    timestep: float  #: [s]
    seconds: float
    skeletons: dict[
        str, Array
    ]  #: of moving geoms by name: points that must not pass, own frame [m]
    ctrl: Array  #: of the actuators, shape (nu,)

    @property
    def speed(self) -> float:
        """Of the thrown body at the start [m/s]; 0 where nothing is thrown."""
        model = self.spec.compile()
        free = [
            int(model.jnt_dofadr[j])
            for j in range(model.njnt)
            if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE
        ]
        return max((float(np.linalg.norm(self.qvel[d : d + 3])) for d in free), default=0.0)

    def start(self, timestep: float, flags: int = 0, stiff: bool = False) -> tuple[Any, Any]:
        """Model and data in the first state; ``stiff`` makes all contacts stiff."""
        model = self.spec.compile()
        model.opt.timestep = timestep
        model.opt.enableflags |= flags
        if stiff:
            for kind in ("geom", "flex"):
                getattr(model, f"{kind}_solref")[:] = STIFF[0]
                getattr(model, f"{kind}_solimp")[:] = STIFF[1]
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:], data.ctrl[:] = self.qpos, self.qvel, self.ctrl
        mujoco.mj_forward(model, data)
        return model, data


def scenes(family: str, seed: int, count: int) -> Iterator[Thrown]:
    """The first ``count`` scenes of a family (:data:`FAMILIES`) for this seed."""
    number = list(FAMILIES).index(family)
    for k in range(count):
        yield FAMILIES[family](np.random.default_rng([seed, number, k]))


def _plate(rng: np.random.Generator) -> Thrown:
    """A convex body onto a plate of 1 to 20 mm, fixed or free, at any angle and spin."""
    spec, timestep, speed = _world(rng, _FREE)
    half = _between(rng, 5e-4, 1e-2)
    mass = _between(rng, 5e-3, 2.0)
    plate = spec.worldbody.add_body(name="plate")
    _slab(rng, plate, "plate", (0.3, 0.3, half), mass * rng.uniform(0.5, 20))
    if rng.random() < 1 / 3:
        plate.add_freejoint()
    body = spec.worldbody.add_body(name="body")
    body.add_freejoint()
    points, reach = _shape(rng, spec, body, "body", mass)
    height = half + reach + 0.005 + rng.random() * speed * timestep
    place = [*rng.uniform(-0.05, 0.05, 2), height]
    return _thrown("plate", rng, spec, timestep, speed, place, {"body": points}, height)


def _pair(rng: np.random.Generator) -> Thrown:
    """Two spheres head on."""
    spec, timestep, speed = _world(rng, _FREE)
    reaches, skeletons = [], {}
    for name in ("first", "body"):
        body = spec.worldbody.add_body(name=name)
        body.add_freejoint()
        points, reach = _shape(rng, spec, body, name, _between(rng, 5e-3, 0.5), _KINDS[:1])
        reaches.append(reach)
        skeletons[name] = points[:1] * 0
    gap = sum(reaches) + 0.005 + rng.random() * speed * timestep
    return _thrown("pair", rng, spec, timestep, speed, [0, 0, gap], skeletons, gap, slide=0.0)


def _chain(rng: np.random.Generator) -> Thrown:
    """Three to eight capsules on ball joints onto a thin plate, a box or a mesh."""
    spec, timestep, speed = _world(rng, _FREE[:3])
    half = _between(rng, 5e-4, 5e-3)
    _slab(rng, spec.worldbody.add_body(name="plate"), "plate", (0.4, 0.4, half), 1.0, spec)
    radius, length = _between(rng, 3e-3, 1e-2), _between(rng, 1e-2, 3e-2)
    body, skeletons = spec.worldbody.add_body(name="body"), {}
    body.add_freejoint()
    for k in range(int(rng.integers(3, 9))):
        if k:
            body = body.add_body(name=f"link{k}", pos=[2 * (length + radius), 0, 0])
            body.add_joint(type=mujoco.mjtJoint.mjJNT_BALL, pos=[-length - radius, 0, 0])
        name = f"capsule{k}"
        body.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[radius, length, 0],
            quat=[0.7071067811865476, 0, 0.7071067811865476, 0],
            mass=0.02,
        )
        skeletons[name] = np.linspace(-1, 1, 9)[:, None] * np.array([[0, 0, length]])
    height = half + radius + 0.005 + rng.random() * speed * timestep
    place = [-0.15, 0, height]
    return _thrown("chain", rng, spec, timestep, speed, place, skeletons, height, flat=True)


def _cup(rng: np.random.Generator) -> Thrown:
    """Balls in a thin cup that is jerked sideways."""
    spec, timestep, speed = _world(rng, _FREE, gravity=True)
    half, wall = _between(rng, 5e-4, 3e-3), 0.05
    cup = spec.worldbody.add_body(name="cup")
    cup.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0], name="body")
    sides: list[tuple[tuple[float, ...], tuple[float, ...]]] = [
        ((wall, wall, half), (0, 0, -half)),
        *(((half, wall, wall), (s * (wall + half), 0, wall)) for s in (-1, 1)),
        *(((wall, half, wall), (0, s * (wall + half), wall)) for s in (-1, 1)),
    ]
    for k, (size, place) in enumerate(sides):
        _slab(rng, cup, f"wall{k}", size, 1.0, pos=place)
    skeletons, radius = {}, _between(rng, 4e-3, 8e-3)
    for k in range(int(rng.integers(4, 25))):
        ball = spec.worldbody.add_body(
            name=f"ball{k}",
            pos=[(k % 3 - 1) * 0.03, (k // 3 % 3 - 1) * 0.03, radius + 0.0171 * (k // 9) + 1e-3],
        )
        ball.add_freejoint()
        ball.add_geom(name=f"ball{k}", size=[radius, 0, 0], mass=0.005)
        skeletons[f"ball{k}"] = np.zeros((1, 3))
    model = spec.compile()
    qvel = np.zeros(model.nv)
    qvel[model.joint("body").dofadr[0]] = min(speed, 20.0)
    seconds = 0.2 / min(speed, 20.0) + AFTER
    return Thrown("cup", spec, model.qpos0.copy(), qvel, timestep, seconds, skeletons, np.zeros(0))


def _cloth(rng: np.random.Generator) -> Thrown:
    """A body into pinned cloth or a hanging flag: flat, corner first or any way, spinning."""
    spec, timestep, speed = _world(rng, ("discrete",))
    pinned = str(rng.choice(["frame", "corners", "edge"]))
    hangs, turn = pinned == "edge", np.sqrt(0.5)
    cloth = Cloth(
        count=int(rng.choice([9, 13, 15])),
        size=0.3,
        mass=_between(rng, 0.02, 0.2),
        position=(0.0, 0.0, 0.0),
        quat_wxyz=(turn, turn, 0.0, 0.0) if hangs else (1.0, 0.0, 0.0, 0.0),
        pinned=pinned,
        young=_between(rng, 1e6, 1e7),
        solref=STIFF[0] if rng.random() < 0.5 else (0.003, 1.0),
    )
    add_cloth(spec, cloth)
    body = spec.worldbody.add_body(name="body")
    body.add_freejoint()
    points, reach = _shape(rng, spec, body, "body", _between(rng, 5e-3, 0.1), _KINDS[:5], 0.008)
    body.geoms[0].conaffinity = 2
    gap = reach + cloth.radius + 0.003 + rng.random() * speed * timestep
    data = mujoco.MjData(model := spec.compile())
    mujoco.mj_forward(model, data)
    normal = np.array([0, 1.0, 0]) if hangs else np.array([0, 0, 1.0])
    aside = rng.uniform(-0.06, 0.06, 3)
    place = data.flexvert_xpos.mean(axis=0) + aside - aside @ normal * normal + gap * normal
    skeletons = {"body": points[:1] * 0}
    return _thrown("cloth", rng, spec, timestep, speed, place, skeletons, gap, normal, slide=0.0)


def _arm(rng: np.random.Generator) -> Thrown:
    """An arm of capsules, driven by its motors against a thin fixed plate."""
    spec, timestep, _ = _world(rng, _FREE, gravity=True)
    half, links = _between(rng, 5e-4, 5e-3), int(rng.integers(2, 5))
    plate = spec.worldbody.add_body(name="plate")
    _slab(rng, plate, "plate", (0.6, 0.6, half), 1.0)
    body, skeletons = spec.worldbody, {}
    for k in range(links):
        body = body.add_body(name=f"link{k}", pos=[0.3, 0, 0] if k else [-0.3, 0, 0.4])
        body.add_joint(name=f"joint{k}", axis=[0, 1, 0], damping=rng.uniform(0, 0.5), armature=0.01)
        body.add_geom(
            name=f"link{k}",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[0, 0, 0, 0.3, 0, 0],
            size=[_between(rng, 0.01, 0.04), 0, 0],
            mass=1.0,
        )
        skeletons[f"link{k}"] = np.linspace(-1, 1, 9)[:, None] * np.array([[0, 0, 0.15]])
        motor = spec.add_actuator(name=f"motor{k}", target=f"joint{k}")
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
    model = spec.compile()
    ctrl = rng.uniform(10, 100, links)
    qvel = rng.uniform(0, 10, model.nv)
    return Thrown("arm", spec, model.qpos0.copy(), qvel, timestep, 0.25, skeletons, ctrl)


#: Every family: what draws one of its scenes.
FAMILIES: dict[str, Callable[[np.random.Generator], Thrown]] = {
    "plate": _plate,
    "pair": _pair,
    "chain": _chain,
    "cup": _cup,
    "arm": _arm,
    "cloth": _cloth,
}


def _world(
    rng: np.random.Generator, integrators: tuple[str, ...], gravity: bool = False
) -> tuple[Any, float, float]:
    """A spec with its options, a timestep [s] and a speed [m/s]."""
    spec = mujoco.MjSpec()
    option = spec.option
    option.gravity = [0, 0, -9.81 if gravity or rng.random() < 0.5 else 0]
    name = str(rng.choice(integrators)).upper()
    option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{name}")
    option.cone = int(rng.integers(2))
    return spec, float(rng.choice(TIMESTEPS)), _between(rng, *SPEEDS)


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    """Uniform in the logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _slab(
    rng: np.random.Generator,
    body: Any,
    name: str,
    size: tuple[float, ...],
    mass: float,
    spec: Any = None,
    pos: tuple[float, ...] = (0, 0, 0),
) -> None:
    """A box of these half sizes, or a mesh of that form if ``spec`` is given and by chance."""
    geom = body.add_geom(name=name, pos=list(pos), mass=mass)
    if rng.random() < 0.5:
        geom.priority, geom.solref, geom.solimp = 1, STIFF[0], STIFF[1]
    if spec is not None and rng.random() < 0.5:
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        spec.add_mesh(name=f"{name}_mesh", uservert=(corners * size).ravel())
        geom.type, geom.meshname = mujoco.mjtGeom.mjGEOM_MESH, f"{name}_mesh"
    else:
        geom.type, geom.size = mujoco.mjtGeom.mjGEOM_BOX, list(size)


def _shape(
    rng: np.random.Generator,
    spec: Any,
    body: Any,
    name: str,
    mass: float,
    kinds: tuple[str, ...] = _KINDS,
    least: float = 3e-3,
) -> tuple[Array, float]:
    """Add a geom of a random kind; points of its skeleton (K, 3) and its reach [m]."""
    kind, radius = str(rng.choice(kinds)), _between(rng, least, 0.03)
    geom = body.add_geom(name=name, mass=mass)
    geom.type = getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}")
    if kind == "mesh":
        corners = rng.normal(size=(12, 3))
        corners /= np.linalg.norm(corners, axis=1, keepdims=True)
        corners *= radius * np.exp(rng.uniform(-0.4, 1.2, 3))
        spec.add_mesh(name=f"{name}_mesh", uservert=corners.ravel())
        geom.meshname = f"{name}_mesh"
        return np.zeros((1, 3)), float(np.linalg.norm(corners, axis=1).max() * 2)
    stretch = np.exp(rng.uniform(-0.7, 1.5, 3))
    size = {
        "sphere": [radius, radius, radius],
        "capsule": [radius, radius, radius * (1 + stretch[0])],
        "cylinder": [radius, radius, radius * stretch[0]],
    }.get(kind, (radius * stretch).tolist())
    geom.size = [size[0], size[2], 0] if kind in ("capsule", "cylinder") else size
    thick = min(size)
    steps = np.linspace(-1, 1, 5)
    grid = np.array([[x, y, z] for x in steps for y in steps for z in steps])
    grid = grid[np.argsort(np.abs(grid).sum(axis=1), kind="stable")]
    if kind == "ellipsoid":
        grid = grid[np.linalg.norm(grid, axis=1) < 1.001]
    elif kind == "cylinder":
        grid = grid[np.linalg.norm(grid[:, :2], axis=1) < 1.001]
    return grid * (np.array(size) - thick), float(np.linalg.norm(size))


def _thrown(
    family: str,
    rng: np.random.Generator,
    spec: Any,
    timestep: float,
    speed: float,
    place: Any,
    skeletons: dict[str, Array],
    way: float,
    normal: Any = (0, 0, 1.0),
    slide: float = 0.3,
    flat: bool = False,
) -> Thrown:
    """The body ``body`` at ``place``, flying against ``normal``: flat, tilted or any way."""
    model = spec.compile()
    qpos, qvel = model.qpos0.copy(), np.zeros(model.nv)
    joint = int(model.body("body").jntadr[0])
    at, dof = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
    how = 0 if flat else int(rng.integers(3))
    turn = Rotation.from_euler("y", rng.choice([0, 90]) * (not flat), degrees=True)
    if how == 1:
        turn = Rotation.from_euler("xy", rng.uniform(-10, 10, 2), degrees=True) * turn
    elif how == 2:
        turn = Rotation.from_quat(rng.normal(size=4))
    qpos[at : at + 3] = place
    qpos[at + 3 : at + 7] = np.roll(turn.as_quat(), 1)
    qvel[dof : dof + 3] = -speed * np.asarray(normal)
    qvel[dof : dof + 2] += slide * speed * rng.normal(size=2) * rng.integers(2)
    qvel[dof + 3 : dof + 6] = 0 if flat else rng.normal(size=3) * rng.choice([0, 20, 100])
    ctrl = np.zeros(model.nu)
    return Thrown(family, spec, qpos, qvel, timestep, way / speed + AFTER, skeletons, ctrl)
