"""The scene composer: a :class:`SceneSpec` lists the parts of a scene, and only these are added."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array, in_a_line
from tauguard.findings import ArgumentError
from tauguard.models.arm import NAMED, Arm, Facts, described_robot, load_arm
from tauguard.models.checks import rigid_pose
from tauguard.models.cloth import Cloth, add_cloth
from tauguard.models.drive import Drive
from tauguard.models.drive_text import drive_text
from tauguard.models.mismatch import Mismatch
from tauguard.models.mjcf import SpecText, without_shapes
from tauguard.models.mujoco_defects import choose_jacobian
from tauguard.models.obstacles import (
    BodyProxy,
    Clamp,
    Obstacle,
    Springy,
    Striker,
    Table,
    add_floor,
    add_ground,
    add_obstacle,
    add_pairs,
    add_table,
)
from tauguard.models.payload import add_payload_body
from tauguard.models.person import Person, PersonPart, add_person
from tauguard.models.robot import Robot
from tauguard.models.scene_objects import SceneObject, add_grasp, add_object, check_apart, hold

#: Integrators by MuJoCo's names.
INTEGRATORS = {
    name.removeprefix("mjINT_").lower(): value
    for name, value in mujoco.mjtIntegrator.__members__.items()
}


@dataclass(frozen=True)
class SceneSpec:
    """The parts of a scene, and the settings of its simulation."""

    timestep: float = 1e-3
    """[s]. At 1 ms the peak force of an impact is within 2 % of the two-mass model; at 2 ms it is
    7 % off at half the cost. ``tauguard bench simulation`` is the source of this choice, of the
    integrator and of the contact parameters."""
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)  #: [m/s^2]
    mismatch: Mismatch | None = None  #: how the simulated arm differs from the nominal one
    payload: bool = False  #: a body at the flange whose mass ``set_payload`` changes
    striker: Striker | None = None
    clamp: Clamp | None = None
    labels: bool = True  #: a contact sensor on every link
    floor: bool = False  #: a plane at height 0
    ground: float | None = None  #: height of a floor that only free objects touch [m]
    arm: str | Robot = "cura6"  #: a name, a file or a robot, see :func:`load_arm`
    base_pose: tuple[tuple[float, ...], ...] | None = (
        None  #: pose of the file's world frame, (4, 4)
    )
    integrator: str = "implicitfast"  #: one of :data:`INTEGRATORS`
    proxies: tuple[BodyProxy, ...] = ()  #: body regions of a person
    people: tuple[Person, ...] = ()
    region_labels: bool = False  #: a contact sensor on every body region, after the links
    table: Table | None = None
    cloth: Cloth | None = None
    objects: tuple[SceneObject, ...] = ()  #: your own objects
    drive: Drive | None = field(default=None, compare=False)
    """The nominal drive; default: the arm's own, see :class:`tauguard.models.arm.Facts`."""

    def __post_init__(self) -> None:
        """Check the values: ``ArgumentError`` names the one that is out of range."""
        if not 0 < self.timestep <= 0.02:
            raise ArgumentError(f"timestep {self.timestep}: expected seconds above 0, at most 0.02")
        if np.shape(self.gravity) != (3,) or not np.isfinite(self.gravity).all():
            raise ArgumentError(f"gravity {self.gravity}: expected three numbers [m/s^2]")
        if self.integrator not in INTEGRATORS:
            raise ArgumentError(
                f"integrator {self.integrator!r}: expected one of {', '.join(INTEGRATORS)}"
            )
        elastic = self.cloth is not None and self.cloth.young is not None
        if elastic and self.integrator != "discrete":
            raise ArgumentError(
                f"integrator {self.integrator!r}: a cloth with young= needs 'discrete'"
            )
        if self.base_pose is not None:
            pose = rigid_pose(self.base_pose)
            object.__setattr__(self, "base_pose", tuple(map(tuple, pose.tolist())))


@dataclass(frozen=True)
class Scene:
    """A compiled scene, with ids and addresses of its parts."""

    __repr__ = in_a_line

    model: mujoco.MjModel
    text: SpecText  #: text of the scene, see :attr:`xml`
    spec: SceneSpec
    arm_text: SpecText  #: text of the nominal arm alone, see :attr:`arm_xml`
    joint_names: tuple[str, ...]
    link_bodies: NDArray[np.int64]  #: body ids of link 1..n
    qpos_adr: NDArray[np.int64]  #: addresses of the arm's joints in qpos
    dof_adr: NDArray[np.int64]  #: addresses of the arm's joints in qvel
    obstacle_names: tuple[str, ...]  #: obstacles and moving objects
    payload_body: int  #: id of the payload body, -1 if there is none
    drive: Drive  #: the simulated drives
    home: Array  #: home pose [rad], shape (n,)
    facts: Facts  #: known and assumed numbers of the arm (of the first, if there are two)

    @property
    def xml(self) -> str:
        """MJCF text of the scene, self-contained."""
        return str(self.text)

    @property
    def arm_xml(self) -> str:
        """MJCF text of the nominal arm alone, which an observer assumes."""
        return str(self.arm_text)

    @property
    def nominal_texts(self) -> dict[str, str]:
        """Names and texts of the attachments that describe the arm of a recording.

        ``arm.xml`` is :attr:`arm_xml`; ``drive.json`` holds the nominal drive
        (:func:`tauguard.models.drive_of`) of an arm that is not the package's own.
        """
        own = self.facts.name in NAMED and self.spec.drive is None
        drive = {} if own else {"drive.json": drive_text(self.facts.drive)}
        return {"arm.xml": self.arm_xml, **drive}

    @property
    def arm_model(self) -> mujoco.MjModel:
        """The compiled nominal arm alone; without shapes if it is not part of the package."""
        if self.facts.name in NAMED:
            return mujoco.MjModel.from_xml_string(self.arm_xml)
        return self.arm_text.dynamics()


def compose(spec: SceneSpec, visuals: bool = True) -> Scene:
    """Compile the scene that ``spec`` describes.

    Args:
        spec: parts and settings of the scene.
        visuals: keep visual shapes. Without them a physics step is a fifth cheaper, with the same
            bits; ``Scene.xml`` always has them.

    Raises:
        ArgumentError: an arm that cannot be used, see :func:`tauguard.models.arm.load_arm`.
        FileNotFoundError: no such arm.
    """
    arm = load_arm(spec.arm)
    facts = arm.facts if spec.drive is None else replace(arm.facts, drive=spec.drive)
    whole = arm.spec
    whole.option.timestep = spec.timestep
    whole.option.gravity = spec.gravity
    whole.option.integrator = INTEGRATORS[spec.integrator]
    if spec.base_pose is not None:
        arm.place(np.array(spec.base_pose))
    nominal = _nominal_text(arm, spec, whole)
    if spec.mismatch is not None:
        spec.mismatch.perturb_arm(whole, list(arm.links))
    obstacles = _add_parts(arm, spec)
    choose_jacobian(whole)
    text = SpecText(whole)
    model = whole.compile() if visuals else lean_model(whole)
    check_apart(model, spec.objects)
    if not model.nflex and not masks_match(model):
        # MuJoCo then looks only at pairs: 9 % of a step with an obstacle, with the same bits.
        model.body_contype[:], model.body_conaffinity[:] = 0, 0
    joints = [model.joint(name) for name in arm.joints]
    return Scene(
        model=model,
        text=text,
        spec=spec,
        arm_text=nominal,
        joint_names=arm.joints,
        link_bodies=np.array([model.body(name).id for name in arm.links]),
        qpos_adr=np.array([joint.qposadr[0] for joint in joints]),
        dof_adr=np.array([joint.dofadr[0] for joint in joints]),
        obstacle_names=obstacles,
        payload_body=model.body("payload").id if spec.payload else -1,
        drive=_drive(spec, arm),
        home=arm.home,
        facts=facts,
    )


def masks_match(model: mujoco.MjModel) -> bool:
    """Whether the bits of two geoms let them touch; geoms of pairs can touch without this."""
    makes, takes = model.geom_contype[:, None], model.geom_conaffinity
    return bool((makes & takes).any())


def _nominal_text(arm: Arm, spec: SceneSpec, whole: mujoco.MjSpec) -> SpecText:
    """MJCF of the arm that an observer assumes, with a rigid gripper."""
    robot = described_robot(spec.arm)
    if not (arm.facts.gripper and robot.gripper == "passive"):
        return SpecText(whole)
    rigid = compose(replace(spec, arm=replace(robot, gripper="weld")))
    return rigid.arm_text


def lean_model(whole: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile ``whole`` without the shapes that touch nothing; bodies and joints keep their ids.

    All shapes stay if MuJoCo computes a body's mass from one of them. ``whole`` is changed.
    """
    stated = all(body.explicitinertial for body in whole.bodies if body.name != "world")
    full = None if stated else whole.compile()
    touching = {name for pair in whole.pairs for name in (pair.geomname1, pair.geomname2)}
    shown = [
        geom
        for geom in whole.geoms
        if not (geom.contype or geom.conaffinity or geom.name in touching)
    ]
    without_shapes(whole, shown)
    lean = whole.compile()
    masses = ("body_mass", "body_inertia", "body_ipos", "body_iquat")
    same = full is None or all(
        np.array_equal(getattr(lean, name), getattr(full, name)) for name in masses
    )
    return lean if same or full is None else full


def _add_parts(arm: Arm, spec: SceneSpec) -> tuple[str, ...]:
    """Add all parts other than the arm; returns the names of the obstacles."""
    whole = arm.spec
    obstacles: dict[str, Obstacle] = {}
    if spec.payload:
        add_payload_body(whole, arm.flange())
    if spec.striker is not None:
        obstacles["striker"] = spec.striker
    if spec.clamp is not None:
        obstacles["clamp"] = spec.clamp
    for proxy in spec.proxies:
        if proxy.region in obstacles:
            raise ArgumentError(f"proxies: {proxy.region} twice; expected each body region once")
        obstacles[proxy.region] = proxy
    for name, obstacle in obstacles.items():
        add_obstacle(whole, obstacle, name)
    parts: dict[str, Springy] = {**obstacles}
    taken = {body.name for body in whole.bodies} | set(region_names(replace(spec, objects=())))
    taken |= {f"link{i + 1}" for i in range(len(arm.links))}
    for obj in spec.objects:
        if obj.name in taken:
            raise ArgumentError(
                f"object {obj.name}: the scene has a part of this name; choose another name"
            )
        taken.add(obj.name)
        if obj.touchable:
            parts |= {geom.name: obj for geom in add_object(whole, obj)}
        else:
            hold(whole, whole.body(arm.links[-1]), arm.flange(), obj)
        if obj.graspable:
            add_grasp(whole, arm.links[-1], obj)
    if spec.table is not None:
        add_table(whole, spec.table)
    if spec.floor:
        add_floor(whole)
    if spec.ground is not None:
        add_ground(whole, spec.ground, [_root(whole, arm.links[0]).pos])
    if spec.cloth is not None:
        add_cloth(whole, spec.cloth)
    if spec.labels:
        for i, link in enumerate(arm.links, start=1):
            _add_label(whole, link, f"contact_link{i}")
    for number, person in enumerate(spec.people):
        parts |= add_person(whole, person, number)
    if spec.region_labels:
        for name in region_names(spec):
            label_region(whole, spec, name, arm.links[0])
    if parts:
        held = [geom for geom, part in parts.items() if getattr(part, "graspable", False)]
        add_pairs(whole, arm.shapes(), parts, {arm.links[-1]: held})
    moving = (obj.name for obj in spec.objects if obj.moves)
    return (*obstacles, *moving)


def _root(spec: mujoco.MjSpec, body: str) -> mujoco.MjsBody:
    """The body below the world that carries ``body``."""
    root = spec.body(body)
    while root.parent.name != "world":
        root = root.parent
    return root


def people_parts(spec: SceneSpec) -> Iterator[PersonPart]:
    """The capsules of all people, person after person."""
    for number, person in enumerate(spec.people):
        yield from person.parts(number)


def region_names(spec: SceneSpec) -> tuple[str, ...]:
    """Names of the regions: the proxies, the body parts of people, then touchable objects."""
    people = (part.name for part in people_parts(spec))
    objects = (obj.name for obj in spec.objects if obj.touchable)
    return (*(proxy.region for proxy in spec.proxies), *people, *objects)


def label_region(whole: mujoco.MjSpec, spec: SceneSpec, name: str, arm: str = "") -> None:
    """Add a contact sensor to a region; an object's senses only contacts with the arm."""
    own = any(obj.name == name for obj in spec.objects)
    _add_label(whole, name, f"contact_{name}", subtree=own, against=arm if own else "")


def _drive(spec: SceneSpec, arm: Arm) -> Drive:
    drive = spec.drive
    if drive is None:
        drive = arm.facts.drive
    if len(drive.gain) != len(arm.joints):
        raise ArgumentError(
            f"drive: of {len(drive.gain)} joints, but the arm has {len(arm.joints)}: "
            f"{', '.join(arm.joints)}"
        )
    return drive if spec.mismatch is None else spec.mismatch.perturb_drive(drive)


def _add_label(
    spec: mujoco.MjSpec, link: str, name: str, subtree: bool = False, against: str = ""
) -> None:
    """Add a sensor of the net external contact wrench on a link: found, force, torque, position.

    Its ten numbers are the number of contacts (1), force (3) and torque (3) that the *link* exerts,
    in the world frame, and the position (3) to which the torque refers, the force-weighted centroid
    of the contacts. The wrench on the arm has the opposite sign, because MuJoCo's normal points
    from the sensor's body to the other one. The arm's geoms cannot touch one another (contype 1,
    conaffinity 2), so the whole wrench is external.
    """
    fields = [
        mujoco.mjtConDataField.mjCONDATA_FOUND,
        mujoco.mjtConDataField.mjCONDATA_FORCE,
        mujoco.mjtConDataField.mjCONDATA_TORQUE,
        mujoco.mjtConDataField.mjCONDATA_POS,
    ]
    sensor = spec.add_sensor(
        name=name,
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_XBODY if subtree else mujoco.mjtObj.mjOBJ_BODY,
        objname=link,
    )
    if against:
        sensor.reftype, sensor.refname = mujoco.mjtObj.mjOBJ_XBODY, against
    netforce = 3
    sensor.intprm = [sum(1 << int(field) for field in fields), netforce, 1]


def without_losses(scene: Scene) -> Scene:
    """The scene with ideal drives: no friction (also not the file's), ripple, lag or noise.

    The scene's model is changed.
    """
    scene.model.dof_damping[scene.dof_adr] = 0.0
    scene.model.dof_frictionloss[scene.dof_adr] = 0.0
    none = np.zeros(len(scene.facts.joints))
    known = replace(scene.facts.drive, friction=None)
    facts = replace(scene.facts, drive=known, damping=none, friction_loss=none)
    ideal = replace(
        scene.drive, friction=None, ripple=None, sensors=None, electrical_time_constant=None
    )
    return replace(scene, drive=ideal, facts=facts)
