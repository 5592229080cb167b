"""Load an arm for a scene from a name, a file or a :class:`tauguard.models.Robot`."""

import functools
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from tauguard.arrays import Array, in_a_line
from tauguard.findings import ArgumentError
from tauguard.models import cura6, derive
from tauguard.models.arm_drive import (
    PRESLIDING,
    calibrated,
    level_friction,
    like_cura6,
    stated_drive,
    with_speeds,
)
from tauguard.models.arm_file import (
    ARM_BITS,
    OBSTACLE_BITS,
    STICK_RADIUS,
    TOOL_FRAMES,
    ArmFile,
    read_arm,
)
from tauguard.models.drive import Drive, cura6_drive
from tauguard.models.known_robots import ROBOTS, find_file, known_names
from tauguard.models.robot import Robot, per_joint

__all__ = ["ARM_BITS", "NAMED", "OBSTACLE_BITS", "STICK_RADIUS", "Arm", "Facts", "load_arm"]


#: Arms that need no file.
NAMED = cura6.NAMES


@dataclass(frozen=True)
class Facts:
    """Known and assumed numbers of an arm, per joint, and the source of each."""

    __repr__ = in_a_line

    name: str
    joints: tuple[str, ...]
    drive: Drive  #: nominal: gains, limits, the drive's own friction
    armature: Array  #: rotor inertia at the joint [kg m^2]
    damping: Array  #: the file's damping, simulated by MuJoCo [N m s/rad]
    friction_loss: Array  #: the file's friction loss, simulated by MuJoCo [N m]
    home: Array  #: home pose [rad]
    max_speed: Array  #: [rad/s]
    max_acceleration: Array  #: [rad/s^2]
    spread: Array  #: largest distance of drawn poses from home [rad]
    servo_inertia: (
        Array | None
    )  #: for the servo's gains [kg m^2]; None: use the home pose's inertia
    bandwidth: Array  #: bandwidth of the servo [rad/s]
    compensation: float  #: fraction of the known friction that the servo compensates
    tool: str | None  #: site of the tool; None: the last link's origin
    gripper: tuple[str, ...]  #: joints of the gripper
    sources: dict[str, str] = field(default_factory=dict)  #: source of each part, as text

    @property
    def nominal(self) -> Drive:
        """The drive that controller and observer assume; its friction includes the file's."""
        if not (self.damping.any() or self.friction_loss.any()):
            return self.drive
        own = self.drive.friction or level_friction(np.zeros_like(self.damping), self.damping * 0)
        known = replace(
            own,
            coulomb=own.coulomb + self.friction_loss,
            static=own.static + self.friction_loss,
            viscous=own.viscous + self.damping,
            bristle_stiffness=own.bristle_stiffness + self.friction_loss / PRESLIDING,
        )
        return replace(self.drive, friction=known)


@dataclass(frozen=True)
class Arm:
    """An arm to be put into a scene; ``spec`` contains the arm only."""

    __repr__ = in_a_line

    spec: mujoco.MjSpec
    links: tuple[str, ...]  #: the body of each joint, base to tip
    facts: Facts

    @property
    def joints(self) -> tuple[str, ...]:
        """Names, base to tip."""
        return self.facts.joints

    @property
    def home(self) -> Array:
        """The home pose [rad], shape (n,)."""
        return self.facts.home

    @property
    def torque_limit(self) -> Array:
        """[N m], shape (n,)."""
        return self.facts.drive.torque_limit

    def shapes(self) -> list[mujoco.MjsGeom]:
        """The links' collision geoms; geoms without a name get one."""
        found = []
        for link in self.links:
            colliding = [g for g in self.spec.body(link).geoms if g.contype or g.conaffinity]
            for i, geom in enumerate(colliding):
                geom.name = geom.name or f"{link}_collision{i}"
                found.append(geom)
        return found

    def flange(self) -> mujoco.MjsSite:
        """The site of the tool; the origin of the last link if there is no site."""
        name = self.facts.tool
        if name is not None:
            return self.spec.site(name)
        return self.spec.body(self.links[-1]).add_site(name="flange")

    def place(self, pose: Array) -> None:
        """Move the base: ``pose`` is the pose of the file's world frame in the scene, (4, 4)."""
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(pose[:3, :3]).ravel())
        frame = self.spec.worldbody.add_frame(pos=pose[:3, 3], quat=quat)
        world = self.spec.worldbody
        for part in (*world.bodies, *world.geoms, *world.sites):
            part.set_frame(frame)


def load_arm(source: str | Robot) -> Arm:
    """Load the arm that ``source`` names or describes.

    Args:
        source: "cura6", a name of :data:`tauguard.models.ROBOTS`, an MJCF or URDF file, a TOML file
            (:meth:`Robot.from_toml`), or a robot. A file's name may end in ``#`` and the names of
            the arm's joints (:meth:`Robot.named`). Missing numbers are derived.

    Raises:
        ArgumentError: not a robot that MuJoCo can read, or not one serial chain of hinge and slide
            joints; the message says what would work.
        FileNotFoundError: no such name or file.
    """
    robot = described_robot(source)
    if robot.file in NAMED:
        return _cura6(robot)
    path, sources = Path(robot.file), dict[str, str]()
    if not path.is_file():
        robot, path, sources = _by_name(robot)
    sensors = robot.drive.sensors
    beside = Path(sensors.left_over) if sensors and sensors.left_over else path
    files = [path, beside] if beside.is_file() else [path]
    try:
        modified = max(file.stat().st_mtime_ns for file in files)
        arm = _from_file(robot, path, modified, tuple(sources.items()))
    except ValueError as error:
        raise ArgumentError(f"arm {robot.file}: {' '.join(str(error).split())}") from None
    return replace(arm, spec=arm.spec.copy())


def described_robot(source: str | Robot) -> Robot:
    """The robot that ``source`` of :func:`load_arm` is, with what a TOML file says about it."""
    robot = source if isinstance(source, Robot) else Robot.named(str(source))
    if not (robot.file.lower().endswith(".toml") and Path(robot.file).is_file()):
        return robot
    described = Robot.from_toml(robot.file)
    return described if robot.joints is None else replace(described, joints=robot.joints)


@functools.lru_cache(maxsize=4)
def _from_file(
    robot: Robot, path: Path, modified: int, sources: tuple[tuple[str, str], ...]
) -> Arm:
    """The arm of a file, cached until the file's time changes; do not change its spec."""
    file = read_arm(path, robot.joints, robot.gripper == "weld", robot.tool)
    known = dict(sources)
    if robot.source is not None:
        known["drive"] = robot.source
    return _completed(calibrated(robot, path, file, known), file, known)


def _by_name(robot: Robot) -> tuple[Robot, Path, dict[str, str]]:
    name = robot.file
    row = ROBOTS.get(name)
    if row is None and name not in known_names():
        raise FileNotFoundError(
            f"arm {name!r}: no such file or name; expected {', '.join((*NAMED, *ROBOTS))}, an MJCF "
            "or URDF file, or a TOML file that describes a robot"
        )
    path = find_file(name)
    if row is None:
        return robot, path, {}
    plain = Robot(file=name)
    given = {key: value for key, value in vars(robot).items() if value != getattr(plain, key)}
    sources = {key: text for key, text in row.sources.items() if key not in given}
    return replace(row.robot, **given), path, sources


def _cura6(robot: Robot) -> Arm:
    name = robot.file
    if robot.joints not in (None, cura6.JOINTS):
        raise ArgumentError(f"arm {name}: joints: its own six are used; leave `joints` out")
    spec = mujoco.MjSpec.from_string(cura6.arm_xml(name))
    links = tuple(f"link{i}" for i in range(1, len(cura6.JOINTS) + 1))
    model, n, drive = spec.compile(), len(cura6.JOINTS), cura6_drive(name)
    design = "the arm's design, models/cura6/README.md"
    speed, home = robot.max_speed, robot.home
    facts = Facts(
        name=name,
        joints=cura6.JOINTS,
        drive=drive,
        armature=model.dof_armature.copy(),
        damping=np.zeros(n),
        friction_loss=np.zeros(n),
        home=np.array(cura6.HOME if home is None else home),
        max_speed=per_joint(cura6.max_speed(name) if speed is None else speed, n, "max_speed"),
        max_acceleration=np.array(cura6.MAX_ACCELERATION),
        spread=np.array([1.2, 0.5, 0.6, 0.9, 0.9, 1.5]),
        servo_inertia=None,
        bandwidth=per_joint(robot.bandwidth or derive.BANDWIDTH, n, "bandwidth"),
        compensation=0.0,
        tool="flange",
        gripper=(),
        sources=dict.fromkeys(("drive", "home", "max_speed", "max_acceleration"), design),
    )
    return Arm(spec, links, facts)


def _completed(robot: Robot, file: ArmFile, sources: dict[str, str]) -> Arm:
    """The arm, with derived values for all numbers that the file does not state."""
    spec, joints, n = file.spec, file.joints, len(file.joints)
    model = file.model
    said = _SourceNotes(robot, sources, n)
    limit = said.row("torque_limit", file.torque_limit, "the file's limits")
    if not np.isfinite(limit).all():
        limit = derive.torque_limit(model, joints, limit)
        if np.isfinite(limit).all():
            said.derived("torque_limit", "none in the file: holds and accelerates the arm")
    elif robot.torque_limit is None:
        said.sources["torque_limit"] += derive.implausible_limit(model, joints, limit)
    drive = stated_drive(robot.drive, limit, said.sources)
    armature = _rotor(robot.drive, model, joints, limit, drive, said)
    for name, inertia in zip(joints, armature, strict=True):
        spec.joint(name).armature = inertia
        model.dof_armature[model.joint(name).dofadr[0]] = inertia
    ids = derive.joint_ids(model, joints)
    dofs, slides = model.jnt_dofadr[ids], model.jnt_type[ids] == mujoco.mjtJoint.mjJNT_SLIDE
    speed = np.where(np.isfinite(file.max_speed), file.max_speed, derive.DEFAULT_SPEED)
    words = (
        "the file's limits" if np.isfinite(file.max_speed).all() else "none in the file: 2 rad/s"
    )
    tip = model.body(file.links[-1]).id
    speed = said.row("max_speed", speed, words)
    drive = with_speeds(drive, speed, derive.lightest_inertia(model, joints))
    if robot.drive.like is not None:
        lossy = (model.dof_damping[dofs] > 0) | (model.dof_frictionloss[dofs] > 0)
        drive = like_cura6(drive, speed, lossy)
    facts = Facts(
        name=Path(robot.file).stem,
        joints=joints,
        drive=drive,
        armature=armature,
        damping=model.dof_damping[dofs].copy(),
        friction_loss=model.dof_frictionloss[dofs].copy(),
        home=_home(said, file, model, joints, tip),
        max_speed=speed,
        max_acceleration=said.row(
            "max_acceleration", np.full(n, derive.DEFAULT_ACCELERATION), "default"
        ),
        spread=np.where(slides, 0.3, 0.8),
        servo_inertia=derive.servo_inertia(model, joints),
        bandwidth=said.row("bandwidth", np.full(n, derive.BANDWIDTH), "default"),
        compensation=robot.friction_compensation,
        tool=_tool(robot, spec, file, said),
        gripper=file.gripper,
        sources=said.sources,
    )
    said.changes(file)
    return Arm(spec, file.links, facts)


class _SourceNotes:
    """Reads the user's description and records the source of each number."""

    def __init__(self, robot: Robot, sources: dict[str, str], joints: int) -> None:
        self.robot, self.joints, self.sources = robot, joints, dict(sources)

    def row(self, name: str, otherwise: Array, words: str) -> Array:
        value: Any = getattr(self.robot, name)
        if value is None:
            self.sources[name] = words
            return otherwise
        self.sources.setdefault(name, "given")
        return per_joint(value, self.joints, name)

    def derived(self, name: str, words: str) -> None:
        self.sources[name] = f"derived: {words}"

    def changes(self, file: ArmFile) -> None:
        """Record what of the file was changed or left out."""
        if file.mended:
            names = ", ".join(file.mended[:4]) + (", ..." if len(file.mended) > 4 else "")
            self.sources["inertia"] = (
                f"the file's is impossible for {names}: replaced by the nearest possible one"
            )
        if file.replaced:
            self.sources["shapes"] = "; ".join(
                f"{name}: {what}" for name, what in file.replaced.items()
            )
        if file.gripper:
            kind = "passive" if self.robot.gripper == "passive" else f"{self.robot.gripper}ed"
            self.sources["gripper"] = f"{kind}: {', '.join(file.gripper)}"


def _rotor(
    stated: Any,
    model: mujoco.MjModel,
    joints: tuple[str, ...],
    limit: Array,
    drive: Drive,
    said: _SourceNotes,
) -> Array:
    own = stated.row("rotor_inertia", said.joints)
    if own is not None:
        said.sources["armature"] = "given: gear^2 times the rotor's inertia"
        return np.asarray(own * drive.gear**2)
    given = model.dof_armature[model.jnt_dofadr[derive.joint_ids(model, joints)]] > 0
    if given.all():
        said.sources["armature"] = "the file's"
    else:
        rule = f"{derive.ROTOR_PER_TORQUE:g} kg m^2 per N m of torque limit"
        said.derived(
            "armature", ("the file's where it has one, else " if given.any() else "") + rule
        )
    return derive.rotor_inertia(model, joints, limit)


def _home(
    said: _SourceNotes, file: ArmFile, model: mujoco.MjModel, joints: tuple[str, ...], tip: int
) -> Array:
    low, high = derive.ranges(model, joints)
    if said.robot.home is not None:
        pose = said.row("home", np.zeros(0), "")
        bad = [j for j, q, a, b in zip(joints, pose, low, high, strict=True) if not a <= q <= b]
        if bad:
            raise ArgumentError(f"home: joint {', '.join(bad)} outside its range")
        return pose
    if file.home is not None:
        inside = (file.home >= low) & (file.home <= high)
        said.sources["home"] = "the file's first keyframe"
        if not inside.all():
            said.sources["home"] += ", moved into the joints' ranges"
        return np.clip(file.home, low, high)
    said.derived("home", "in front of the base, clear of singular poses and of the joints' ends")
    return derive.home_pose(model, joints, tip)


def _tool(robot: Robot, spec: mujoco.MjSpec, file: ArmFile, said: _SourceNotes) -> str | None:
    sites = [site.name for site in spec.sites if site.name]
    if robot.tool is not None:
        if robot.tool in sites:
            said.sources["tool"] = "given"
            return robot.tool
        raise ArgumentError(
            f"tool {robot.tool!r}: no such site or body; sites: {', '.join(sites) or 'none'}"
        )
    for name in TOOL_FRAMES:
        if name in sites:
            said.sources["tool"] = f"the file's site {name}"
            return name
    said.sources["tool"] = f"no known site: the origin of {file.links[-1]}"
    return None
