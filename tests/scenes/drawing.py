"""What the families of random scenes share: options, shapes, thin slabs, and a thrown body."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from tauguard.arrays import Array
from tauguard.contacts.scenes.impacts import STIFF

#: Timesteps that scenes are drawn with [s].
TIMESTEPS = (5e-4, 1e-3, 2e-3, 5e-3, 1e-2)
#: Speeds [m/s].
SPEEDS = (1.0, 60.0)
#: Standard deviation of each component of a thrown body's angular velocity [rad/s].
SPINS = (0, 20, 100, 400)
#: Largest rotation of a free body in a step [rad], for integrators that are explicit in gyroscopic
#: forces: they add energy to a body that spins faster.
GYRATION = 0.2
#: Time that is simulated after the expected contact [s].
AFTER = 0.03
#: Kinds of geoms that are drawn, and the type of each.
KINDS = ("sphere", "capsule", "cylinder", "box", "ellipsoid", "mesh")
GEOM = {kind: getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}") for kind in KINDS}
#: Turns the z axis of a capsule or cylinder along x; w first.
ALONG_X = (0.7071067811865476, 0.0, 0.7071067811865476, 0.0)
#: Integrators to draw from, one of them twice as often.
INTEGRATORS = ("euler", "implicit", "implicitfast", "implicitfast", "discrete")
_SOLVERS = ("newton", "newton", "newton", "cg", "pgs")


@dataclass(frozen=True)
class Drawn:
    """One random scene."""

    spec: Any  #: MjSpec
    qpos: Array  #: where it starts, shape (nq,)
    qvel: Array  #: how fast, shape (nv,)
    timestep: float  #: [s]
    seconds: float
    ctrl: Array = field(default_factory=lambda: np.zeros(0))  #: of the actuators, shape (nu,)
    #: Writes the mocap poses at this time [s] into the data, before each step.
    move: Callable[[Any, float], None] | None = None
    energy_unit: float | None = None  #: divides energies [J]; default: the first kinetic energy

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
        data.qpos[:], data.qvel[:] = self.qpos, self.qvel
        data.ctrl[: len(self.ctrl)] = self.ctrl
        mujoco.mj_forward(model, data)
        return model, data


def world(
    rng: np.random.Generator, integrators: tuple[str, ...], gravity: bool = False
) -> tuple[Any, float, float]:
    """A spec with random options, a time step [s] and a speed [m/s]."""
    spec = mujoco.MjSpec()
    timestep = settle(spec, rng, integrators, gravity)
    return spec, timestep, between(rng, *SPEEDS)


def settle(
    spec: Any, rng: np.random.Generator, integrators: tuple[str, ...], gravity: bool = False
) -> float:
    """Choose the options of a spec; returns a time step [s]."""
    option = spec.option
    option.gravity = [0, 0, -9.81 if gravity or rng.random() < 0.5 else 0]
    integrator = str(rng.choice(integrators)).upper()
    option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    solver = "NEWTON" if integrator == "DISCRETE" else str(rng.choice(_SOLVERS)).upper()
    option.solver = getattr(mujoco.mjtSolver, f"mjSOL_{solver}")
    option.cone = int(rng.integers(2))
    return float(rng.choice(TIMESTEPS))


def free_body(spec: Any, name: str, pos: Any = (0, 0, 0)) -> Any:
    """A body at ``pos`` with a free joint of its name."""
    body = spec.worldbody.add_body(name=name, pos=list(pos))
    body.add_freejoint(name=name)
    return body


def solid(body: Any, name: str, kind: str, size: Any, **more: Any) -> None:
    """Add a geom of this kind (:data:`KINDS`) and size to a body."""
    body.add_geom(name=name, type=GEOM[kind], size=size, **more)


def at_rest(model: Any, joint: str = "body") -> tuple[Array, Array, int, int]:
    """First qpos and qvel, and the joint's addresses in them."""
    found = model.joint(joint)
    return model.qpos0.copy(), np.zeros(model.nv), int(found.qposadr[0]), int(found.dofadr[0])


def any_way(rng: np.random.Generator) -> Array:
    """A random orientation, w first."""
    return np.roll(Rotation.from_quat(rng.normal(size=4)).as_quat(), 1)


def any_spin(rng: np.random.Generator, timestep: float) -> Array:
    """A random angular velocity of about :data:`GYRATION` in a step at most [rad/s]."""
    return np.asarray(rng.normal(size=3) * min(GYRATION / timestep, rng.choice(SPINS)))


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """Uniform in the logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def slab(
    rng: np.random.Generator,
    body: Any,
    name: str,
    size: tuple[float, ...],
    mass: float,
    spec: Any = None,
    pos: tuple[float, ...] = (0, 0, 0),
) -> None:
    """A box of these half sizes; with ``spec`` a mesh of the same shape in half of the draws."""
    geom = body.add_geom(name=name, pos=list(pos), mass=mass)
    if rng.random() < 0.5:
        geom.priority, geom.solref, geom.solimp = 1, STIFF[0], STIFF[1]
    if spec is not None and rng.random() < 0.5:
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        spec.add_mesh(name=f"{name}_mesh", uservert=(corners * size).ravel())
        geom.type, geom.meshname = mujoco.mjtGeom.mjGEOM_MESH, f"{name}_mesh"
    else:
        geom.type, geom.size = mujoco.mjtGeom.mjGEOM_BOX, list(size)


def shape(
    rng: np.random.Generator,
    spec: Any,
    body: Any,
    name: str,
    mass: float,
    kinds: tuple[str, ...] = KINDS,
    least: float = 3e-3,
) -> float:
    """Add a geom of a random kind; returns a radius that contains it [m]."""
    kind, radius = str(rng.choice(kinds)), between(rng, least, 0.03)
    geom = body.add_geom(name=name, mass=mass)
    geom.type = GEOM[kind]
    if rng.random() < 0.3:
        geom.margin = rng.uniform(0, 3e-3)
        geom.gap = geom.margin * rng.random() * rng.integers(2)
    if kind == "mesh":
        corners = rng.normal(size=(12, 3))
        corners /= np.linalg.norm(corners, axis=1, keepdims=True)
        corners *= radius * np.exp(rng.uniform(-0.4, 1.2, 3))
        spec.add_mesh(name=f"{name}_mesh", uservert=corners.ravel())
        geom.meshname = f"{name}_mesh"
        return float(np.linalg.norm(corners, axis=1).max() * 2)
    stretch = np.exp(rng.uniform(-0.7, 1.5, 3))
    size = {
        "sphere": [radius, radius, radius],
        "capsule": [radius, radius, radius * (1 + stretch[0])],
        "cylinder": [radius, radius, radius * stretch[0]],
    }.get(kind, (radius * stretch).tolist())
    geom.size = [size[0], size[2], 0] if kind in ("capsule", "cylinder") else size
    return float(np.linalg.norm(size)) + (radius if kind == "capsule" else 0)


def thrown(
    rng: np.random.Generator,
    spec: Any,
    timestep: float,
    speed: float,
    place: Any,
    distance: float,
    normal: Any = (0, 0, 1.0),
    slide: float = 0.3,
    flat: bool = False,
) -> Drawn:
    """The body ``body`` at ``place``, flying against ``normal``: flat, tilted or any way."""
    qpos, qvel, at, dof = at_rest(model := spec.compile())
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
    spin = rng.normal(size=3) * rng.choice(SPINS)
    if model.opt.integrator != mujoco.mjtIntegrator.mjINT_IMPLICIT:
        spin *= min(1.0, GYRATION / max(float(np.linalg.norm(spin)) * timestep, 1e-9))
    qvel[dof + 3 : dof + 6] = 0 if flat else spin
    return Drawn(spec, qpos, qvel, timestep, distance / speed + AFTER)
