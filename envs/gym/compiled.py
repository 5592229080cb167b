"""The compiled scene of an environment, and the numbers of the arm that its controller uses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array, in_a_line
from tauguard.envs.gym.placing import Layout, Usual, blocked_ground, carried
from tauguard.envs.gym.randomization import check_names
from tauguard.envs.gym.regions import RegionInfo, fastest, regions_of
from tauguard.envs.gym.second_arm import APART, add_second_arm, both_drives
from tauguard.envs.gym.settings import PERSON, Settings
from tauguard.envs.plant import Gains
from tauguard.models import (
    BODY_REGIONS,
    BodyProxy,
    Drive,
    Mismatch,
    Person,
    Scene,
    SceneSpec,
    compose,
    derive,
    set_payload,
    without_losses,
)
from tauguard.models.obstacles import FLOOR_HEIGHT

#: Least height of a target and its least distance from the base's axis [m].
LOWEST, NEAREST = 0.12, 0.2
#: The same two as fractions of the arm's reach; the smaller of length and fraction applies.
SHORT = (0.25, 0.4)
#: Least reach of an arm [m].
LEAST_REACH = 0.02
#: Tolerance of the conjugate gradient solver for a cloth's edges; it changes forces by 1e-4.
CLOTH_TOLERANCE = 1e-6


@dataclass(frozen=True)
class ForceBound:
    """Largest force F [N] of an arm on a contact of stiffness k: F^2 / (2 k) = E.

    E is the energy that can go into the contact. ``moving`` follows from the arm's kinetic energy
    at its largest speeds, with its load. ``driven`` follows from the work of its drives and the
    kinetic energy of a body region that runs into it. See
    :func:`tauguard.models.derive.largest_energy`.
    """

    moving: float
    driven: float

    @property
    def total(self) -> float:
        """Largest force at the arm's largest speeds [N]."""
        return math.hypot(self.moving, self.driven)


@dataclass(frozen=True)
class CompiledScene:
    """A scene, and the data about it that the controller and the observation use."""

    __repr__ = in_a_line

    settings: Settings
    scene: Scene  #: without visual shapes
    nominal: Drive  #: drive that the controller assumes
    gains: Gains
    nominal_mass: Array  #: of the links [kg], shape (n,)
    nominal_com: Array  #: in the links' frames [m], shape (n, 3)
    joint_range: Array  #: [rad], infinite without a limit, shape (n, 2)
    torque_limit: Array  #: [N m], shape (n,)
    max_speed: Array  #: [rad/s], shape (n,)
    tools: tuple[tuple[int, int, int], ...]  #: for each arm: site or -1, body, first joint
    regions: tuple[RegionInfo, ...]
    people: tuple[Person, ...]
    blocked: Array  #: areas that people avoid: :func:`tauguard.envs.gym.placing.blocked_ground`
    force_bound: ForceBound
    layout: Layout  #: the arm's reach, and how things were placed

    @property
    def arms(self) -> int:
        """Number of arms."""
        return len(self.tools)

    @property
    def person(self) -> Person | None:
        """The first of the people."""
        return self.people[0] if self.people else None

    def shown(self) -> mujoco.MjModel:
        """The scene with visual shapes; bodies, joints and flexes have the same ids."""
        return mujoco.MjModel.from_xml_string(self.scene.xml)

    def ids(self) -> NDArray[np.int64]:
        """MuJoCo ids of the arm's joints, shape (n,)."""
        return np.array([self.scene.model.joint(name).id for name in self.scene.joint_names])


def compile_scene(
    settings: Settings,
    places: type[Usual] = Usual,
    arms: int = 1,
    moved: Mapping[str, float] = MappingProxyType({}),
    default: frozenset[str] = frozenset(),
) -> CompiledScene:
    """Compile the scene that ``settings`` describe.

    Args:
        settings: the keywords of the environment.
        places: places of body regions and people that are given by name.
        arms: number of arms, 1 or 2.
        moved: see :attr:`tauguard.envs.gym.placing.Layout.moved`.
        default: "table", "cloth" or both, if the task's defaults have them; they are fitted to
            the arm.

    Raises:
        ValueError, FileNotFoundError: the robot cannot be used.
    """
    plain = SceneSpec(
        timestep=settings.timestep,
        integrator=settings.integrator,
        arm=settings.robot,
        table=settings.table,
    )
    bare = compose(replace(plain, labels=False, region_labels=False), visuals=False)
    layout = Layout.of(bare, arm_reach(bare), moved)
    proxies, people = _people(settings, bare, layout, places)
    check_names(settings.randomize or {}, people, settings.checkers)
    spec = replace(
        plain,
        mismatch=settings.mismatch if isinstance(settings.mismatch, Mismatch) else None,
        payload=settings.payload_g > 0 or "payload_g" in (settings.randomize or {}),
        labels=settings.labels,
        region_labels=settings.labels,
        cloth=settings.cloth,
        objects=settings.objects,
        proxies=proxies,
        people=people,
    )
    if settings.table is not None and "table" in default:
        spec = replace(spec, table=layout.table(settings.table))
    if settings.cloth is not None and "cloth" in default:
        spec = replace(spec, cloth=layout.cloth(settings.cloth))
    if settings.floor is not False and any(obj.motion == "free" for obj in settings.objects):
        spec = replace(spec, ground=_ground(settings.floor, spec))
    scene = compose(spec, visuals=False)
    if arms == 2:
        scene = add_second_arm(scene, layout.second_arm(APART))
    if settings.ideal_drive:
        scene = without_losses(scene)
    if settings.payload_g > 0:
        data = mujoco.MjData(scene.model)
        set_payload(scene.model, data, scene.payload_body, settings.payload_g / 1000)
    if settings.cloth is not None and settings.cloth.young is None:
        # MuJoCo's default, Newton's method, factors a matrix of all edges: steps take 4/3 the time.
        scene.model.opt.solver = mujoco.mjtSolver.mjSOL_CG
        scene.model.opt.tolerance = CLOTH_TOLERANCE
    # A diverged state must stay visible; MuJoCo would restart it at the origin.
    scene.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return _with_nominal_numbers(settings, scene, bare, layout, arms)


def _people(
    settings: Settings, bare: Scene, layout: Layout, places: type[Usual]
) -> tuple[tuple[BodyProxy, ...], tuple[Person, ...]]:
    """The body regions and the people of the keyword ``obstacles``, with their places."""
    proxies: list[BodyProxy] = []
    people: list[Person] = []
    for item in settings.obstacles:
        if isinstance(item, Person):
            people.append(item)
        elif item == PERSON:
            people.append(layout.person(places.person(bare, layout)))
        else:
            own = item if isinstance(item, BodyProxy) else places.proxy(item, bare, layout)
            proxies.append(own)
    return tuple(proxies), tuple(people)


def _ground(floor: bool | float, spec: SceneSpec) -> float:
    """Height of the floor [m], see :attr:`tauguard.envs.gym.settings.Settings.floor`."""
    if floor is not True:
        return float(floor)
    if spec.people:
        return spec.people[0].floor
    model = compose(spec, visuals=False).model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    bodies = [model.body(obj.name).id for obj in spec.objects]
    parts = [g for g in range(model.ngeom) if model.body_rootid[model.geom_bodyid[g]] in bodies]
    turned = data.geom_xmat[parts].reshape(-1, 3, 3)[:, 2]
    middle = data.geom_xpos[parts, 2] + (turned * model.geom_aabb[parts, :3]).sum(axis=1)
    low = middle - (np.abs(turned) * model.geom_aabb[parts, 3:]).sum(axis=1)
    return FLOOR_HEIGHT if low.min() > 2 * FLOOR_HEIGHT else min(Person.floor, float(low.min()))


def _with_nominal_numbers(
    settings: Settings, scene: Scene, bare: Scene, layout: Layout, arms: int
) -> CompiledScene:
    model = scene.model
    joints = [model.joint(name).id for name in scene.joint_names]
    limited = model.jnt_limited[joints].astype(bool)[:, None]
    nominal = nominal_drive(settings, bare)
    gains = Gains.for_scene(bare)
    own = bare.facts.max_speed
    speed = own if settings.max_speed is None else np.full(len(own), settings.max_speed)
    # The controller assumes that a moving gripper is rigid.
    rigid = bare.arm_model if bare.facts.gripper else bare.model
    bodies = [rigid.body(bare.model.body(int(b)).name).id for b in bare.link_bodies]
    return CompiledScene(
        settings=settings,
        scene=scene,
        nominal=nominal if arms == 1 else both_drives(nominal),
        gains=Gains(np.tile(gains.kp, arms), np.tile(gains.kd, arms)),
        nominal_mass=np.tile(rigid.body_mass[bodies], arms),
        nominal_com=np.tile(rigid.body_ipos[bodies], (arms, 1)),
        joint_range=np.where(limited, model.jnt_range[joints], [-np.inf, np.inf]),
        torque_limit=np.tile(nominal.torque_limit, arms),
        max_speed=np.tile(speed, arms),
        tools=find_tools(scene, arms),
        regions=regions_of(scene, layout.reach),
        people=scene.spec.people,
        blocked=blocked_ground(scene),
        force_bound=_force_bound(settings, scene, bare, speed, arms),
        layout=layout,
    )


def _force_bound(
    settings: Settings, scene: Scene, bare: Scene, speed: Array, arms: int
) -> ForceBound:
    """The force bound of the scene at its stiffest contact."""
    limit = bare.facts.drive.torque_limit
    moving, driven = derive.largest_energy(bare.model, bare.facts.joints, speed, limit)
    moving, driven = arms * moving, arms * driven
    grams = (settings.randomize or {}).get("payload_g")
    load = max(settings.payload_g, 0.0 if grams is None else grams.ends()[1]) / 1000
    load += max((obj.mass for obj in settings.objects if obj.graspable), default=0.0)
    reach = arm_reach(bare) + 0.2
    moving += 0.5 * load * float((np.abs(speed) * reach).sum()) ** 2
    regions = regions_of(scene, 1.0)
    if regions:
        masses = scene.model.body_mass[[r.body for r in regions]]
        speeds = [fastest(r, scene.spec.people) for r in regions]
        driven += float((0.5 * masses * np.square(speeds)).max())
    stiffness = max([BODY_REGIONS["skull"].stiffness, *(r.stiffness for r in regions)])
    return ForceBound(math.sqrt(2 * stiffness * moving), math.sqrt(2 * stiffness * driven))


def nominal_drive(settings: Settings, bare: Scene) -> Drive:
    """The drive that the controller assumes; ``ideal_drive``: without the robot file's friction."""
    return bare.facts.drive if settings.ideal_drive else bare.facts.nominal


def find_tools(scene: Scene, arms: int) -> tuple[tuple[int, int, int], ...]:
    """The tool of each arm: the flange's site if its file has one, else the last link."""
    model, each = scene.model, len(scene.joint_names) // arms
    found = []
    for a in range(arms):
        body = int(scene.link_bodies[(a + 1) * each - 1])
        names = (scene.facts.tool,)
        sites = [s for s in range(model.nsite) if carried(model, int(model.site_bodyid[s]), body)]
        named = [s for s in sites if model.site(s).name.removeprefix("arm2_") in names]
        found.append((named[0] if named else -1, body, a * each))
    return tuple(found)


def tool_position(compiled: CompiledScene, data: mujoco.MjData, arm: int = 0) -> Array:
    """Where a tool is [m], shape (3,); kinematics must be up to date."""
    site, body, _ = compiled.tools[arm]
    return np.array(data.site_xpos[site] if site >= 0 else data.xpos[body])


def arm_reach(scene: Scene) -> float:
    """Largest distance [m] from the first joint to the last link over 200 fixed random poses.

    If the last link only turns in place, the reach is the size of its shapes.
    """
    model, data = scene.model, mujoco.MjData(scene.model)
    rng = np.random.default_rng(0)
    low, high = pose_box(scene)
    first = scene.model.joint(scene.joint_names[0]).id
    best = 0.0
    for _ in range(200):
        data.qpos[scene.qpos_adr] = rng.uniform(low, high)
        mujoco.mj_kinematics(model, data)
        span = data.xpos[scene.link_bodies[-1]] - data.xanchor[first]
        best = max(best, float(np.linalg.norm(span)))
    if best > LEAST_REACH:
        return best
    own = np.flatnonzero(model.geom_bodyid == scene.link_bodies[-1])
    sizes = np.linalg.norm(model.geom_pos[own], axis=1) + model.geom_rbound[own]
    return max(LEAST_REACH, float(sizes.max(initial=0.0)))


def pose_box(scene: Scene) -> tuple[Array, Array]:
    """Bounds of the random poses: around home, within the joints' ranges [rad], shapes (n,)."""
    model = scene.model
    joints = [model.joint(name).id for name in scene.joint_names]
    spread = np.resize(scene.facts.spread, len(joints))
    limited = model.jnt_limited[joints].astype(bool)
    low = np.where(limited, model.jnt_range[joints, 0], -np.inf)
    high = np.where(limited, model.jnt_range[joints, 1], np.inf)
    return np.maximum(low, scene.home - spread), np.minimum(high, scene.home + spread)
