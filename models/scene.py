"""The scene composer: a :class:`SceneSpec` lists what a scene holds; nothing else is compiled."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.models import cura6
from tauguard.models.drive import Drive, cura6_drive
from tauguard.models.mismatch import Mismatch

Array = NDArray[np.float64]

#: Where an obstacle waits until it is needed [m].
PARKED = (0.0, 0.0, 50.0)
#: Length of the payload's lever: its centre of mass in front of the flange [m].
PAYLOAD_REACH = 0.08
#: Mass of an empty payload body [kg]; MuJoCo wants one above its minimum.
_NO_PAYLOAD = 1e-6


@dataclass(frozen=True)
class Striker:
    """A ball that flies freely (weightless) and strikes the arm."""

    radius: float = 0.05  #: [m]
    mass: float = 2.0  #: [kg]: with the arm's inertia it sets the length of a blow
    stiffness: float = 3e4  #: of its contact [N/m]
    damping: float = 60.0  #: of its contact [N s/m]


@dataclass(frozen=True)
class Clamp:
    """A ball that stands still in the arm's way."""

    radius: float = 0.05  #: [m]
    stiffness: float = 2e4  #: of its contact [N/m]
    damping: float = 100.0  #: of its contact [N s/m]


@dataclass(frozen=True)
class SceneSpec:
    """What a scene holds."""

    timestep: float = 1e-3  #: [s]
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)  #: [m/s^2]
    mismatch: Mismatch | None = None  #: how the simulated arm differs from the nominal one
    payload: bool = False  #: a body at the flange whose mass :func:`set_payload` changes
    striker: Striker | None = None
    clamp: Clamp | None = None
    labels: bool = True  #: a contact sensor on every link
    floor: bool = False  #: a plane at height 0

    def __post_init__(self) -> None:
        """Check the values: ``ValueError`` names the one that is out of range."""
        if not 0 < self.timestep <= 0.02:
            raise ValueError(f"timestep {self.timestep}: expected seconds above 0, at most 0.02")


@dataclass(frozen=True)
class Scene:
    """A compiled scene and where its parts are."""

    model: mujoco.MjModel
    xml: str  #: MJCF text of the whole scene, self-contained
    spec: SceneSpec
    arm_xml: str  #: MJCF text of the nominal arm alone: what an observer believes
    joint_names: tuple[str, ...]
    link_bodies: NDArray[np.int64]  #: body ids of link 1..n
    qpos_adr: NDArray[np.int64]  #: of the arm's joints in qpos
    dof_adr: NDArray[np.int64]  #: of the arm's joints in qvel
    obstacle_names: tuple[str, ...]  #: bodies that move by themselves
    payload_body: int  #: its id, -1 where there is none
    drive: Drive  #: what is simulated


def compose(spec: SceneSpec) -> Scene:
    """Compile what ``spec`` lists."""
    arm = mujoco.MjSpec.from_string(cura6.arm_xml())
    arm.option.timestep = spec.timestep
    arm.option.gravity = spec.gravity
    links = [f"link{i}" for i in range(1, len(cura6.JOINTS) + 1)]
    nominal_xml = arm.to_xml()
    if spec.mismatch is not None:
        spec.mismatch.perturb_arm(arm, links)
    obstacles = []
    if spec.payload:
        _add_payload(arm)
    if spec.striker is not None:
        obstacles.append(_add_striker(arm, spec.striker))
    if spec.clamp is not None:
        obstacles.append(_add_clamp(arm, spec.clamp))
    if spec.floor:
        arm.worldbody.add_geom(
            name="floor",
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[0, 0, 0.05],
            contype=2,
            conaffinity=1,
            rgba=[0.75, 0.77, 0.8, 1],
        )
    if spec.labels:
        for name in links:
            _add_label(arm, name)
    if obstacles:
        _add_pairs(arm, links, obstacles)
        _tune_pairs(arm, spec)
    model = arm.compile()
    joints = [model.joint(name) for name in cura6.JOINTS]
    return Scene(
        model=model,
        xml=arm.to_xml(),
        spec=spec,
        arm_xml=nominal_xml,
        joint_names=cura6.JOINTS,
        link_bodies=np.array([model.body(name).id for name in links]),
        qpos_adr=np.array([joint.qposadr[0] for joint in joints]),
        dof_adr=np.array([joint.dofadr[0] for joint in joints]),
        obstacle_names=tuple(obstacles),
        payload_body=model.body("payload").id if spec.payload else -1,
        drive=_drive(spec),
    )


def _drive(spec: SceneSpec) -> Drive:
    drive = cura6_drive()
    return drive if spec.mismatch is None else spec.mismatch.perturb_drive(drive)


def _add_payload(arm: mujoco.MjSpec) -> None:
    flange = next(site for site in arm.sites if site.name == "flange")
    body = arm.body("link6").add_body(name="payload", pos=flange.pos, quat=flange.quat)
    body.explicitinertial = True
    body.mass = _NO_PAYLOAD
    body.ipos = [0, 0, PAYLOAD_REACH]
    body.inertia = [1e-9, 1e-9, 1e-9]
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        pos=[0, 0, PAYLOAD_REACH],
        size=[0.045, 0.05, 0],
        group=2,
        contype=0,
        conaffinity=0,
        density=0,
        rgba=[0.85, 0.5, 0.15, 1],
    )


def _ball(body: mujoco.MjsBody, radius: float, mass: float, rgba: list[float]) -> None:
    """An obstacle's geom; it meets the arm by contact pairs alone."""
    body.add_geom(
        name=body.name,
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[radius, 0, 0],
        mass=mass,
        contype=0,
        conaffinity=0,
        rgba=rgba,
    )


def _add_striker(arm: mujoco.MjSpec, striker: Striker) -> str:
    body = arm.worldbody.add_body(name="striker", pos=PARKED, gravcomp=1)
    body.add_freejoint()
    _ball(body, striker.radius, striker.mass, [0.85, 0.25, 0.2, 1])
    return "striker"


def _add_clamp(arm: mujoco.MjSpec, clamp: Clamp) -> str:
    body = arm.worldbody.add_body(name="clamp", pos=[0, 0, -PARKED[2]], mocap=True)
    _ball(body, clamp.radius, 1.0, [0.75, 0.3, 0.55, 1])
    return "clamp"


def _add_label(arm: mujoco.MjSpec, link: str) -> None:
    """A sensor of the net external contact wrench on a link.

    ``netforce`` gives force and torque in the world frame at the force-weighted centroid; the arm's
    geoms cannot touch one another (contype 1, conaffinity 2), so all of it is external.
    """
    fields = [
        mujoco.mjtConDataField.mjCONDATA_FOUND,
        mujoco.mjtConDataField.mjCONDATA_FORCE,
        mujoco.mjtConDataField.mjCONDATA_TORQUE,
        mujoco.mjtConDataField.mjCONDATA_POS,
    ]
    sensor = arm.add_sensor(
        name=f"contact_{link}",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_BODY,
        objname=link,
    )
    sensor.intprm = [sum(1 << int(field) for field in fields), 3, 1]


def _add_pairs(arm: mujoco.MjSpec, links: list[str], obstacles: list[str]) -> None:
    """One contact pair for every collision geom of a link and every obstacle."""
    for link in links:
        shapes = [g for g in arm.body(link).geoms if g.group == 3]
        for i, geom in enumerate(shapes):
            geom.name = geom.name or f"{link}_collision{i}"
            for obstacle in obstacles:
                arm.add_pair(
                    name=f"{geom.name}_{obstacle}",
                    geomname1=geom.name,
                    geomname2=obstacle,
                    condim=1,
                    solimp=[0.001, 0.001, 0.001, 0.5, 2],
                )


def _tune_pairs(arm: mujoco.MjSpec, spec: SceneSpec) -> None:
    """Write the pairs' contact stiffness so that it holds whatever the arm's pose.

    With d = solimp's dmin small, MuJoCo's direct solref format gives f = (K pen + B v) / A for a
    ``solref`` of (-K, -B), A being the sum of both bodies' translational ``body_invweight0``,
    which only a compiled model tells.
    """
    model = arm.compile()
    for pair in arm.pairs:
        body = model.geom_bodyid[model.geom(pair.geomname1).id]
        obstacle = model.geom_bodyid[model.geom(pair.geomname2).id]
        weight = float(model.body_invweight0[body, 0] + model.body_invweight0[obstacle, 0])
        part = spec.striker if pair.geomname2 == "striker" else spec.clamp
        assert part is not None
        pair.solref = [-part.stiffness * weight, -part.damping * weight]


def set_payload(model: mujoco.MjModel, data: mujoco.MjData, body: int, mass: float) -> None:
    """Give the payload body a mass [kg], from now on; a compact load in front of the flange.

    Raises:
        ValueError: a negative mass, or a scene without a payload body.
    """
    if body < 0:
        raise ValueError("the scene has no payload: compose it with SceneSpec(payload=True)")
    if mass < 0:
        raise ValueError(f"payload {mass} kg: expected 0 or more")
    load = max(mass, _NO_PAYLOAD)
    model.body_mass[body] = load
    model.body_inertia[body] = max(load * 0.4 * 0.05**2, 1e-9)
    state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)


def with_drive(scene: Scene, drive: Drive) -> Scene:
    """The same scene with other drives."""
    return replace(scene, drive=drive)
