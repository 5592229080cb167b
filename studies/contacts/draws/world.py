"""What draws of scenes share: options, shapes, thin slabs, and a body on its way."""

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
#: Of a thrown body, a component's standard deviation [rad/s].
SPINS = (0, 20, 100, 400)
#: Most that a free body turns in a step by an integrator that is explicit in gyroscopic forces,
#: and so gives it energy in free flight [rad].
GYRATION = 0.2
#: What follows the touch [s].
AFTER = 0.03
KINDS = ("sphere", "capsule", "cylinder", "box", "ellipsoid", "mesh")
FREE = ("euler", "implicit", "implicitfast", "implicitfast", "discrete")
_SOLVERS = ("newton", "newton", "newton", "cg", "pgs")


@dataclass(frozen=True)
class Thrown:
    """One scene; :mod:`studies.contacts.referee` says whether something passed."""

    family: str
    spec: Any  #: MjSpec
    qpos: Array  #: where it starts, shape (nq,)
    qvel: Array  #: how fast, shape (nv,)
    timestep: float  #: [s]
    seconds: float
    geom: str  #: name of the one whose velocity at the end is compared
    ctrl: Array = field(default_factory=lambda: np.zeros(0))  #: of the actuators, shape (nu,)
    #: Writes the mocap poses for this time [s] into the data, before each step.
    move: Callable[[Any, float], None] | None = None
    given: float | None = None  #: what energy is measured by, if not the kinetic one at first [J]

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
        data.qpos[:], data.qvel[:] = self.qpos, self.qvel
        data.ctrl[: len(self.ctrl)] = self.ctrl
        mujoco.mj_forward(model, data)
        return model, data


def world(
    rng: np.random.Generator, integrators: tuple[str, ...], gravity: bool = False
) -> tuple[Any, float, float]:
    """A spec with its options, a timestep [s] and a speed [m/s]."""
    spec = mujoco.MjSpec()
    timestep = settle(spec, rng, integrators, gravity)
    return spec, timestep, between(rng, *SPEEDS)


def settle(
    spec: Any, rng: np.random.Generator, integrators: tuple[str, ...], gravity: bool = False
) -> float:
    """Choose the options of a spec; a timestep [s]."""
    option = spec.option
    option.gravity = [0, 0, -9.81 if gravity or rng.random() < 0.5 else 0]
    integrator = str(rng.choice(integrators)).upper()
    option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    solver = "NEWTON" if integrator == "DISCRETE" else str(rng.choice(_SOLVERS)).upper()
    option.solver = getattr(mujoco.mjtSolver, f"mjSOL_{solver}")
    option.cone = int(rng.integers(2))
    return float(rng.choice(TIMESTEPS))


def any_way(rng: np.random.Generator) -> Array:
    """A random orientation, w first."""
    return np.roll(Rotation.from_quat(rng.normal(size=4)).as_quat(), 1)


def any_spin(rng: np.random.Generator, timestep: float) -> Array:
    """A random angular velocity that turns some :data:`GYRATION` a step at the most [rad/s]."""
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


def shape(
    rng: np.random.Generator,
    spec: Any,
    body: Any,
    name: str,
    mass: float,
    kinds: tuple[str, ...] = KINDS,
    least: float = 3e-3,
) -> float:
    """Add a geom of a random kind; its reach [m]."""
    kind, radius = str(rng.choice(kinds)), between(rng, least, 0.03)
    geom = body.add_geom(name=name, mass=mass)
    geom.type = getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}")
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
    family: str,
    rng: np.random.Generator,
    spec: Any,
    timestep: float,
    speed: float,
    place: Any,
    geom: str,
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
    spin = rng.normal(size=3) * rng.choice(SPINS)
    if model.opt.integrator != mujoco.mjtIntegrator.mjINT_IMPLICIT:
        spin *= min(1.0, GYRATION / max(float(np.linalg.norm(spin)) * timestep, 1e-9))
    qvel[dof + 3 : dof + 6] = 0 if flat else spin
    seconds = way / speed + AFTER
    return Thrown(family, spec, qpos, qvel, timestep, seconds, geom)
