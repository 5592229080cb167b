"""Obstacles that the arm may touch, and contacts of a stated stiffness."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from tauguard.findings import ArgumentError
from tauguard.models.body_regions import BodyRegion, body_region
from tauguard.models.checks import above_zero, not_negative
from tauguard.models.scene_objects import GROUND_BIT

Vector = tuple[float, float, float]

#: Height of the floor if nothing is below it [m].
FLOOR_HEIGHT = -0.001
#: Pedestal of an arm above the floor: half extents [m] and colour.
PEDESTAL, PEDESTAL_COLOUR = (0.25, 0.3), (0.62, 0.64, 0.67, 1.0)
#: Half extents [m] and colour of the floor.
FLOOR_SIZE, FLOOR_COLOUR = (8.0, 8.0), (0.80, 0.82, 0.85, 1.0)
#: Position of an obstacle until it is used [m].
PARKED = (0.0, 0.0, 50.0)


@dataclass(frozen=True)
class Striker:
    """A ball that flies freely (weightless) and strikes the arm; parked until it is launched."""

    radius: float = 0.05  #: [m]
    mass: float = 2.0  #: [kg]: with the arm's inertia it sets how long an impact lasts
    stiffness: float = 3e4  #: of its contact [N/m]
    damping: float = 60.0  #: of its contact [N s/m]

    def __post_init__(self) -> None:
        """Check the values: ``ArgumentError`` names the one that is out of range."""
        above_zero(self, "radius", "mass", "stiffness")
        not_negative(self, "damping")


@dataclass(frozen=True)
class Clamp:
    """A ball at rest in the arm's path; parked until it is placed."""

    radius: float = 0.05  #: [m]
    stiffness: float = 2e4  #: of its contact [N/m]
    damping: float = 100.0  #: of its contact [N s/m]

    def __post_init__(self) -> None:
        """Check the values: ``ArgumentError`` names the one that is out of range."""
        above_zero(self, "radius", "stiffness")
        not_negative(self, "damping")


@dataclass(frozen=True)
class BodyProxy:
    """A body region of a person, with its effective mass and contact stiffness.

    It is a ball, because each further contact point would add its stiffness. It slides along
    ``direction``, as in the standard's two-mass model, or is fixed (``clamped``).
    """

    region: str  #: one of :data:`tauguard.models.body_regions.BODY_REGIONS`
    position: Vector  #: of its centre [m]
    direction: Vector = (1.0, 0.0, 0.0)  #: direction of free motion, of any length
    radius: float = 0.07  #: [m]
    damping: float = 0.0  #: damping of its contact [N s/m]; the standard's model has none
    clamped: bool = False  #: fixed in place: the quasi-static case

    def __post_init__(self) -> None:
        """Check the values: ``ArgumentError`` names the one that is out of range."""
        body_region(self.region)
        above_zero(self, "radius")
        not_negative(self, "damping")
        for name in ("position", "direction"):
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != (3,) or not np.isfinite(value).all():
                raise ArgumentError(
                    f"BodyProxy.{name} {getattr(self, name)}: expected three numbers"
                )
        if not np.any(self.direction):
            raise ArgumentError("BodyProxy.direction: zero; expected a direction to slide along")

    @property
    def limits(self) -> BodyRegion:
        """The region's numbers."""
        return body_region(self.region)

    @property
    def stiffness(self) -> float:
        """Stiffness of the contact [N/m]."""
        return self.limits.stiffness


@dataclass(frozen=True)
class Table:
    """A fixed board that the arm can touch, with MuJoCo's default contacts."""

    position: Vector = (0.75, 0.0, 0.1)  #: of its centre [m]
    half_extents: Vector = (0.35, 0.6, 0.02)  #: [m]

    def __post_init__(self) -> None:
        """Check the values: ``ArgumentError`` names the one that is out of range."""
        if np.shape(self.half_extents) != (3,) or np.shape(self.position) != (3,):
            raise ArgumentError("Table: position and half_extents are three numbers each [m]")
        above_zero(self, "half_extents")


Obstacle = Striker | Clamp | BodyProxy


class Springy(Protocol):
    """An object that states the stiffness and damping of its contacts."""

    @property
    def stiffness(self) -> float:
        """[N/m]."""
        ...

    @property
    def damping(self) -> float:
        """[N s/m]."""
        ...


def add_obstacle(spec: mujoco.MjSpec, obstacle: Obstacle, name: str) -> None:
    """Add the body ``name`` to the world of ``spec``; its contacts come with :func:`add_pairs`."""
    world = spec.worldbody
    if isinstance(obstacle, Striker):
        body = world.add_body(name=name, pos=PARKED, gravcomp=1)
        body.add_freejoint()
        _ball(body, obstacle.radius, obstacle.mass, [0.85, 0.25, 0.2, 1])
    elif isinstance(obstacle, Clamp):
        body = world.add_body(name=name, pos=[0, 0, -PARKED[2]], mocap=True)
        _ball(body, obstacle.radius, 1.0, [0.75, 0.3, 0.55, 1])
    else:
        body = world.add_body(name=name, pos=obstacle.position, gravcomp=1, mocap=obstacle.clamped)
        if not obstacle.clamped:
            axis = np.asarray(obstacle.direction) / np.linalg.norm(obstacle.direction)
            body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        _ball(body, obstacle.radius, obstacle.limits.mass, [0.87, 0.67, 0.55, 1])


def _ball(body: mujoco.MjsBody, radius: float, mass: float, rgba: list[float]) -> None:
    """An obstacle's geom; it collides with the arm through contact pairs only."""
    body.add_geom(
        name=body.name,
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[radius, 0, 0],
        mass=mass,
        contype=0,
        conaffinity=0,
        rgba=rgba,
    )


def add_table(spec: mujoco.MjSpec, table: Table) -> None:
    """Add the geom ``table`` to the world of ``spec``."""
    spec.worldbody.add_geom(
        name="table",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=table.position,
        size=table.half_extents,
        contype=2 | GROUND_BIT,
        conaffinity=1,
        rgba=[0.72, 0.62, 0.5, 1],
    )


def add_floor(spec: mujoco.MjSpec) -> None:
    """Add the plane ``floor`` at height 0 to the world of ``spec``."""
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0, 0, 0.05],
        contype=2 | GROUND_BIT,
        conaffinity=1,
        rgba=[0.75, 0.77, 0.8, 1],
    )


def add_ground(
    spec: mujoco.MjSpec, height: float, bases: Sequence[ArrayLike], touchable: bool = True
) -> None:
    """Add the plane ``ground`` at a height [m], which only free objects touch.

    Arms at ``bases`` [m] get a pedestal where the floor is below them.
    """
    bit, half = GROUND_BIT * touchable, (FLOOR_HEIGHT - height) / 2
    for base in bases if half > 0 else ():
        x, y, _ = np.asarray(base, dtype=float).tolist()
        spec.worldbody.add_geom(
            name=f"pedestal_{x:g}_{y:g}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[*PEDESTAL, half],
            pos=[x, y, FLOOR_HEIGHT - half],
            rgba=PEDESTAL_COLOUR,
            contype=bit,
            conaffinity=0,
        )
    spec.worldbody.add_geom(
        name="ground",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[*FLOOR_SIZE, 1.0],
        pos=[0, 0, height],
        contype=bit,
        conaffinity=0,
        rgba=FLOOR_COLOUR,
    )


def add_pairs(
    spec: mujoco.MjSpec,
    shapes: list[mujoco.MjsGeom],
    obstacles: Mapping[str, Springy],
    apart: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> None:
    """Add a contact pair for each shape of the arm and each obstacle, of the stated stiffness.

    With a small dmin in ``solimp`` and ``solref`` = (-K, -B), MuJoCo's force in every pose is
    f = (K pen + B v) / A. A is the sum of both bodies' translational ``body_invweight0``, which
    MuJoCo computes when it compiles the model. Two shapes of one link that touch the same obstacle
    are two springs. ``apart`` names, for a link, obstacles that do not touch it.
    """
    for geom in shapes:
        for name in obstacles:
            if name in apart.get(geom.parent.name, ()):
                continue
            spec.add_pair(
                name=f"{geom.name}_{name}",
                geomname1=geom.name,
                geomname2=name,
                condim=1,
                solimp=[0.001, 0.001, 0.001, 0.5, 2],
            )
    model = spec.compile()
    weights = pair_weights(model)
    for pair in spec.pairs:
        part = obstacles.get(pair.geomname2)
        if part is not None:
            weight = weights[model.pair(pair.name).id]
            pair.solref = [-part.stiffness * weight, -part.damping * weight]


def pair_weights(model: mujoco.MjModel) -> np.ndarray:
    """The number A of :func:`add_pairs` for every contact pair, shape (npair,)."""
    inverse = model.body_invweight0[:, 0]
    bodies = model.geom_bodyid
    return np.asarray(inverse[bodies[model.pair_geom1]] + inverse[bodies[model.pair_geom2]])
