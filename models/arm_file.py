"""Read one serial arm from a robot file (MJCF or URDF) into a self-contained spec."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.findings import FileError
from tauguard.models.mjcf import SpecText, compiled, inline_meshes
from tauguard.models.robot_check import checked_robot
from tauguard.models.urdf import UrdfFile, is_urdf, max_speeds, read_urdf

#: Bits of MuJoCo's ``contype`` of the arm and of obstacles; the arm does not collide with itself.
ARM_BITS, OBSTACLE_BITS = 1, 2
#: Largest radius [m] of the capsule that a link without any shape gets, and that radius as a
#: fraction of the arm's length.
STICK_RADIUS, STICK_FRACTION = 0.05, 0.125
#: Colour of that capsule.
STICK_COLOUR = (0.85, 0.6, 0.25, 1.0)
#: Group of collision shapes if the file has visual shapes, too.
HIDDEN = 3
#: Branches at the end of a chain are a gripper if the chain has GRIPPER_FROM joints or more, and
#: each branch at most GRIPPER_JOINTS and no more than the chain.
GRIPPER_FROM, GRIPPER_JOINTS = 4, 4
#: After a chain of GRIPPER_FROM joints or more, a joint whose name matches is a gripper, with all
#: joints below it.
_GRIPPER = re.compile(r"grip|finger|jaw|knuckle|claw", re.IGNORECASE)
#: Usual names of a tool frame, the likeliest first.
TOOL_FRAMES = (
    "flange", "attachment_site", "tool0", "ee_link", "ee_site", "grip_site", "pinch_site",
    "link_eef", "panda_link8", "right_hand", "tool_frame", "end_effector", "ee",
)  # fmt: skip
_KINDS = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)


@dataclass(frozen=True)
class ArmFile:
    """The arm in a file; ``spec`` contains the arm only."""

    spec: mujoco.MjSpec
    links: tuple[str, ...]  #: the body of each joint, base to tip
    joints: tuple[str, ...]
    torque_limit: Array  #: [N m], infinite where the file has none, shape (n,)
    max_speed: Array  #: [rad/s], infinite where the file has none, shape (n,)
    home: Array | None  #: joint positions of the file's first keyframe [rad], shape (n,)
    gripper: tuple[str, ...]  #: joints of the gripper
    model: mujoco.MjModel  #: ``spec`` compiled without its shapes
    mended: tuple[str, ...]  #: links of a URDF whose impossible inertia was corrected
    sticks: tuple[str, ...]  #: links without any shape, which were given a capsule
    replaced: dict[str, str]  #: links whose shape differs from the file's, and how


def read_arm(
    path: Path,
    wanted: tuple[str, ...] | None = None,
    weld_gripper: bool = True,
    tool: str | None = None,
) -> ArmFile:
    """Read the arm in a file.

    Actuators, sensors and keyframes are omitted, because the drive is simulated here. Welded
    bodies are fused into their parent links; mesh files are written into the text. A link
    without collision geometry gets the convex hulls of its visual shapes; without these, a capsule.

    Args:
        path: MJCF or URDF.
        wanted: names of the arm's joints; every other joint is welded at zero. The
            default is the file's only chain; branches at its end are a gripper.
        weld_gripper: weld the joints of the gripper (otherwise they move without a drive).
        tool: name of a body or site. A body of this name, or of a usual name of a tool frame, gets
            a site of its name.

    Raises:
        FileError: not a robot that MuJoCo can read, or not one serial chain of hinge and slide
            joints; the message says what would work.
    """
    if is_urdf(path):
        urdf = read_urdf(path)
    else:
        urdf = UrdfFile(mujoco.MjSpec.from_file(str(checked_robot(path))))
    spec = urdf.spec
    _name_joints(spec)
    model = compiled(spec)
    limits, speeds = _torque_limits(model), max_speeds(path)
    keyframe = model.key_qpos[0].copy() if model.nkey else None
    address = {model.joint(j).name: int(model.jnt_qposadr[j]) for j in range(model.njnt)}
    names = [model.joint(j).name for j in range(model.njnt)]
    for element in (*spec.actuators, *spec.sensors, *spec.keys):
        spec.delete(element)
    inline_meshes(spec, model)
    _state_inertia(spec, model)
    gripper: tuple[str, ...] = ()
    if wanted is not None:
        kept = _requested_joints(spec, wanted, names)
        _weld(spec, [name for name in names if name not in kept])
    else:
        gripper = _find_gripper(spec)
        if weld_gripper:
            _weld(spec, list(gripper))
    _mark_tools(spec, tool)
    unread = {_carrier(spec, link): words for link, words in urdf.unread.items()}
    spec.fuse_static()
    links, joints = _chain(spec, gripper)
    sticks, replaced = _let_collide(spec, links, unread)
    model = SpecText(spec).dynamics()
    at = [names.index(name) for name in joints]
    home = None if keyframe is None else keyframe[[address[name] for name in joints]]
    speed = np.array([speeds.get(name, np.inf) for name in joints])
    return ArmFile(
        spec, links, joints, limits[at], speed, home, gripper, model, urdf.mended, sticks, replaced
    )


def _mark_tools(spec: mujoco.MjSpec, tool: str | None) -> None:
    sites = {site.name for site in spec.sites}
    for body in spec.bodies:
        if body.name not in sites and (body.name == tool or body.name in TOOL_FRAMES):
            body.add_site(name=body.name)


def _requested_joints(spec: mujoco.MjSpec, wanted: tuple[str, ...], names: list[str]) -> set[str]:
    """The requested joints, given by name or as a range ``FIRST..LAST``."""
    kept = set()
    for entry in wanted:
        ends = entry.split("..")
        for name in ends:
            if name not in names:
                raise FileError(f"joints: no joint {name!r}; the file has {', '.join(names)}")
        body = spec.joint(ends[-1]).parent
        chain = set(ends[-1:])
        while ends[0] not in chain:
            if body is None or body.name == "world":
                raise FileError(
                    f"joints {entry!r}: {ends[-1]} is not beyond {ends[0]} in the chain"
                )
            chain |= {joint.name for joint in body.joints}
            body = body.parent
        kept |= chain
    return kept


def _name_joints(spec: mujoco.MjSpec) -> None:
    """Give names to unnamed bodies and joints."""
    for i, body in enumerate(b for b in spec.bodies if b.name != "world"):
        body.name = body.name or f"body{i + 1}"
    for i, joint in enumerate(spec.joints):
        joint.name = joint.name or f"joint{i + 1}"


def _weld(spec: mujoco.MjSpec, names: list[str]) -> None:
    """Remove joints, and with them every equality constraint and tendon of the file."""
    if not names:
        return
    for element in (*spec.equalities, *spec.tendons):
        spec.delete(element)
    for name in names:
        spec.delete(spec.joint(name))


def _joints_below(body: mujoco.MjsBody) -> Iterator[mujoco.MjsJoint]:
    yield from body.joints
    for child in body.bodies:
        yield from _joints_below(child)


def _find_gripper(spec: mujoco.MjSpec) -> tuple[str, ...]:
    """Joints of small branches at the chain's end, or all from the first one named as a gripper."""
    chain: list[str] = []
    level = list(spec.worldbody.bodies)
    while level:
        branches = [joints for body in level if (joints := list(_joints_below(body)))]
        if not branches:
            return ()
        if len(branches) > 1:
            sizes = [len(joints) for joints in branches]
            small = len(chain) >= GRIPPER_FROM and max(sizes) <= min(GRIPPER_JOINTS, len(chain))
            return tuple(j.name for joints in branches for j in joints) if small else ()
        body = next(body for body in level if any(_joints_below(body)))
        names = [joint.name for joint in body.joints]
        if len(chain) >= GRIPPER_FROM and any(_GRIPPER.search(name) for name in names):
            return tuple(joint.name for joint in branches[0])
        chain += names
        level = list(body.bodies)
    return ()


def _torque_limits(model: mujoco.MjModel) -> Array:
    """Torque limits of the joints, from their own ranges or those of their actuators."""
    limits = np.where(model.jnt_actfrclimited, np.abs(model.jnt_actfrcrange).max(axis=1), np.inf)
    for i in range(model.nu):
        if model.actuator_trntype[i] != mujoco.mjtTrn.mjTRN_JOINT:
            continue
        joint, gear = int(model.actuator_trnid[i, 0]), float(model.actuator_gear[i, 0])
        if model.actuator_forcelimited[i]:
            force = np.abs(model.actuator_forcerange[i] * gear).max()
            limits[joint] = min(limits[joint], force)
        elif model.actuator_ctrllimited[i] and _is_motor(model, i):
            force = np.abs(model.actuator_ctrlrange[i] * gear * model.actuator_gainprm[i, 0]).max()
            limits[joint] = min(limits[joint], force)
    limits = np.asarray(limits, dtype=float)
    return np.where(limits > 0, limits, np.inf)


def _is_motor(model: mujoco.MjModel, i: int) -> bool:
    """Whether actuator ``i`` turns its control into a torque, without any feedback."""
    plain = model.actuator_gaintype[i] == mujoco.mjtGain.mjGAIN_FIXED
    return bool(plain and model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_NONE)


def _state_inertia(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """State every body's inertia explicitly, so that it does not depend on geoms."""
    for body in spec.bodies:
        if body.name == "world" or body.explicitinertial:
            continue
        at = model.body(body.id).id
        if model.body_mass[at] <= 0:
            continue
        body.explicitinertial = True
        body.mass = float(model.body_mass[at])
        body.ipos, body.iquat = model.body_ipos[at], model.body_iquat[at]
        body.inertia = model.body_inertia[at]


def _chain(
    spec: mujoco.MjSpec, gripper: tuple[str, ...] = ()
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The moving bodies and their joints, base to tip, without the gripper."""
    links: list[str] = []
    joints: list[str] = []
    level = list(spec.worldbody.bodies)
    while level:
        moving = [body for body in level if any(True for _ in _joints_below(body))]
        moving = [body for body in moving if not _all_of(body, gripper)]
        if len(moving) > 1:
            raise FileError(_branches(moving))
        if not moving:
            break
        body = moving[0]
        if body.joints:
            joint = body.joints[0]
            if len(body.joints) > 1 or joint.type not in _KINDS:
                raise FileError(
                    f"body {body.name!r}: expected one hinge or slide joint per body; name the "
                    'arm\'s joints, Robot(file, joints=("...", ...)), and the others are welded'
                )
            links.append(body.name)
            joints.append(joint.name)
        level = list(body.bodies)
    if not links:
        raise FileError("no joints; expected an arm of hinge and slide joints")
    return tuple(links), tuple(joints)


def _all_of(body: mujoco.MjsBody, gripper: tuple[str, ...]) -> bool:
    return all(joint.name in gripper for joint in _joints_below(body))


def _ends(moving: list[mujoco.MjsBody]) -> str:
    """First and last joint of the longest chain, an example for the error message."""
    names = max(map(_longest, moving), key=len, default=[])
    return f"{names[0]}..{names[-1]}" if names else ".."


def _longest(body: mujoco.MjsBody, before: int = 0) -> list[str]:
    """Joints of the longest chain from a body on, without short branches (fingers) at its end."""
    names = [joint.name for joint in body.joints]
    count = before + len(names)
    parts = [part for part in body.bodies if any(_joints_below(part))]
    below = max((_longest(part, count) for part in parts), key=len, default=[])
    return names + (below if len(parts) == 1 or len(below) > count else [])


def _branches(moving: list[mujoco.MjsBody]) -> str:
    """The error message for a file with branches."""
    parts = []
    for body in moving:
        names = [joint.name for joint in _joints_below(body)]
        shown = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
        parts.append(f"{body.name} ({len(names)} joints: {shown})")
    return (
        f"it branches into {'; '.join(parts)}; expected one serial chain of joints. Name those of "
        f'the arm, `arm_joints="{_ends(moving)}"` or Robot(file, joints=({_ends(moving)!r},)) or '
        f"joints in a TOML file, and the others are welded"
    )


def _carrier(spec: mujoco.MjSpec, name: str) -> str:
    """The nearest ancestor with a joint; the body itself if it has one."""
    body = spec.body(name)
    while body is not None and body.name != "world" and not body.joints:
        body = body.parent
    return name if body is None else str(body.name)


def _let_collide(
    spec: mujoco.MjSpec, links: tuple[str, ...], unread: dict[str, str]
) -> tuple[tuple[str, ...], dict[str, str]]:
    """Set the arm's collision bits on all colliding geoms, and give every link such a geom.

    Returns the links that got a capsule; the links whose shape differs from the file's, and how.
    """
    sticks, replaced = [], {}
    for geom in spec.geoms:
        if geom.contype or geom.conaffinity:
            geom.contype, geom.conaffinity = ARM_BITS, OBSTACLE_BITS
    length = sum(float(np.linalg.norm(spec.body(link).pos)) for link in links[1:])
    radius = min(STICK_RADIUS, STICK_FRACTION * length or STICK_RADIUS)
    for i, link in enumerate(links):
        body = spec.body(link)
        geoms = list(body.geoms)
        solid = [geom for geom in geoms if geom.contype]
        if solid:
            for geom in solid if len(solid) < len(geoms) else ():
                geom.group = geom.group or HIDDEN
            if link in unread:
                replaced[link] = f"without {unread[link]}"
            continue
        for geom in geoms:
            geom.contype, geom.conaffinity = ARM_BITS, OBSTACLE_BITS
        words = "convex hull of its visual shapes"
        if not geoms:
            span = np.array(spec.body(links[i + 1]).pos) if i + 1 < len(links) else np.zeros(3)
            _add_stick(body, span, radius)
            sticks.append(link)
            words = f"capsule of {1000 * radius:.0f} mm"
        replaced[link] = words + (f": {unread[link]}" if link in unread else "")
    return tuple(sticks), replaced


def _add_stick(body: mujoco.MjsBody, span: np.ndarray, radius: float) -> None:
    """Add a capsule along a link, or a ball if the link is short."""
    long = float(np.linalg.norm(span)) > 2 * radius
    kind = mujoco.mjtGeom.mjGEOM_CAPSULE if long else mujoco.mjtGeom.mjGEOM_SPHERE
    stick = body.add_geom(type=kind, size=[radius, 0, 0], rgba=STICK_COLOUR, mass=0)
    stick.contype, stick.conaffinity = ARM_BITS, OBSTACLE_BITS
    if long:
        stick.fromto = [0, 0, 0, *span]
