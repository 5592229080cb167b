"""From a robot file, MJCF or URDF, to a spec that holds one serial arm and stands alone."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.models.mjcf import SpecText, compiled
from tauguard.models.robot_check import checked_robot, checked_text
from tauguard.models.urdf_inertia import mend_inertias

#: Collision bits: what the arm has and what obstacles have, so that the arm never meets itself.
ARM_BITS, OBSTACLE_BITS = 1, 2
#: Radius of the capsule that stands for a link without collision geometry [m].
STICK_RADIUS = 0.05
#: Below a chain of at least this many joints a branch is a gripper, if it has fewer joints.
GRIPPER_FROM, GRIPPER_JOINTS = 4, 4
#: A last joint that is called so moves a gripper, too.
_GRIPPER = re.compile(r"grip|finger|jaw|knuckle|claw", re.IGNORECASE)
#: Names that a tool frame has in common files, the likeliest first.
TOOL_FRAMES = (
    "flange", "attachment_site", "tool0", "ee_link", "ee_site", "grip_site", "pinch_site",
    "link_eef", "panda_link8", "right_hand", "tool_frame", "end_effector", "ee",
)  # fmt: skip
_KINDS = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)


@dataclass(frozen=True)
class ArmFile:
    """What a file says about an arm; ``spec`` holds nothing else."""

    spec: mujoco.MjSpec
    links: tuple[str, ...]  #: the body of each joint, base to tip
    joints: tuple[str, ...]
    torque_limit: Array  #: [N m], infinite where the file has none, shape (n,)
    max_speed: Array  #: [rad/s], infinite where the file has none, shape (n,)
    home: Array | None  #: joint positions of the file's first keyframe [rad], shape (n,)
    gripper: tuple[str, ...]  #: joints below the flange
    model: mujoco.MjModel  #: of ``spec``, compiled without its shapes
    mended: tuple[str, ...]  #: links of a URDF whose inertia no body can have
    sticks: tuple[str, ...]  #: links without collision geometry, which got a capsule


def read_arm(
    path: Path,
    wanted: tuple[str, ...] | None = None,
    weld_gripper: bool = True,
    tool: str | None = None,
) -> ArmFile:
    """The arm in a file.

    Actuators, sensors and keyframes are left out (the drive is ours), welded bodies are fused into
    the links that carry them, mesh files are written into the text, and a link without collision
    geometry gets a capsule along it.

    Args:
        path: MJCF or URDF.
        wanted: names of the arm's joints; every other joint is welded where it stands at zero. The
            default is the file's only chain; branches at its end are a gripper.
        weld_gripper: weld the joints of the gripper (else they move without a drive).
        tool: a body or site; a body, and any body with a usual name of a tool frame, becomes a
            site.

    Raises:
        ValueError: not a robot that MuJoCo can read, or not one serial chain of hinge and slide
            joints; the message says what would work.
    """
    mended: tuple[str, ...] = ()
    if _is_urdf(path):
        spec, mended = _urdf_spec(path)
    else:
        spec = mujoco.MjSpec.from_file(str(checked_robot(path)))
    _name_joints(spec)
    model = compiled(spec)
    limits, speeds = _torque_limits(model), _speeds(path)
    keyframe = model.key_qpos[0].copy() if model.nkey else None
    address = {model.joint(j).name: int(model.jnt_qposadr[j]) for j in range(model.njnt)}
    names = [model.joint(j).name for j in range(model.njnt)]
    for element in (*spec.actuators, *spec.sensors, *spec.keys):
        spec.delete(element)
    _inline(spec, model)
    _weigh(spec, model)
    gripper: tuple[str, ...] = ()
    if wanted is not None:
        _weld(spec, [name for name in names if name not in _known(wanted, names)])
    else:
        gripper = _find_gripper(spec)
        if weld_gripper:
            _weld(spec, list(gripper))
    _mark_tools(spec, tool)
    spec.fuse_static()
    links, joints = _chain(spec, gripper)
    sticks = _let_collide(spec, links)
    model = SpecText(spec).dynamics()
    at = [names.index(name) for name in joints]
    home = None if keyframe is None else keyframe[[address[name] for name in joints]]
    speed = np.array([speeds.get(name, np.inf) for name in joints])
    return ArmFile(spec, links, joints, limits[at], speed, home, gripper, model, mended, sticks)


def _mark_tools(spec: mujoco.MjSpec, tool: str | None) -> None:
    sites = {site.name for site in spec.sites}
    for body in spec.bodies:
        if body.name not in sites and (body.name == tool or body.name in TOOL_FRAMES):
            body.add_site(name=body.name)


def _known(wanted: tuple[str, ...], names: list[str]) -> tuple[str, ...]:
    for name in wanted:
        if name not in names:
            raise ValueError(f"joints: no joint {name!r}; the file has {', '.join(names)}")
    return wanted


def _name_joints(spec: mujoco.MjSpec) -> None:
    """Unnamed bodies and joints get names, so that they can be found again."""
    for i, body in enumerate(b for b in spec.bodies if b.name != "world"):
        body.name = body.name or f"body{i + 1}"
    for i, joint in enumerate(spec.joints):
        joint.name = joint.name or f"joint{i + 1}"


def _is_urdf(path: Path) -> bool:
    return path.suffix.lower() == ".urdf" or "<robot" in path.read_text(errors="replace")[:4000]


def _parsed(path: Path) -> ElementTree.Element:
    try:
        return ElementTree.fromstring(path.read_text(errors="replace"))
    except ElementTree.ParseError as error:
        raise ValueError(f"not well-formed XML ({error})") from None


def _urdf_spec(path: Path) -> tuple[mujoco.MjSpec, tuple[str, ...]]:
    """A URDF whose meshes are where its ``package://`` names lead, going up from its folder.

    Shapes that only show, and meshes that are not there or that MuJoCo does not read, are left out.
    The second value names the links whose inertia was made possible.
    """
    root = _parsed(path)
    mended = mend_inertias(root)
    for link in root.findall("link"):
        for shape in link.findall("visual"):
            link.remove(shape)
        for shape in link.findall("collision"):
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            found = _mesh_file(path, mesh.get("filename", ""))
            if found is None:
                link.remove(shape)
            else:
                mesh.set("filename", str(found))
    for old in root.findall("mujoco"):
        root.remove(old)
    extension = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(extension, "compiler", {"strippath": "false", "fusestatic": "false"})
    text = checked_text(ElementTree.tostring(root, encoding="unicode"))
    return mujoco.MjSpec.from_string(text), mended


def _mesh_file(urdf: Path, name: str) -> Path | None:
    inside = Path(name.removeprefix("file://").split("://", 1)[-1])
    if inside.suffix.lower() not in (".stl", ".obj", ".msh"):
        return None
    tails = [inside, Path(*inside.parts[1:]), Path(inside.name)]
    for folder in urdf.resolve().parents:
        for tail in tails[: 2 if folder != urdf.resolve().parent else 3]:
            if (folder / tail).is_file():
                return folder / tail
    return None


def _speeds(path: Path) -> dict[str, float]:
    """Speed limits of a URDF's joints [rad/s]; MJCF has none."""
    if not _is_urdf(path):
        return {}
    found = {}
    for joint in _parsed(path).findall("joint"):
        limit = joint.find("limit")
        speed = float(limit.get("velocity", 0)) if limit is not None else 0.0
        if speed > 0:
            found[str(joint.get("name"))] = speed
    return found


def _weld(spec: mujoco.MjSpec, names: list[str]) -> None:
    """Take joints out; what constrains them goes, too."""
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
    """The joints below the flange: small branches at the end of a chain, and a gripper's joint."""
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
    """Of the joints, from their own ranges or those of the actuators that drive them."""
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


def _inline(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Write mesh files into the text and drop textures, so that the text stands alone."""
    for mesh in spec.meshes:
        at = model.mesh(mesh.name or Path(mesh.file).stem)
        first, count = int(model.mesh_vertadr[at.id]), int(model.mesh_vertnum[at.id])
        face, faces = int(model.mesh_faceadr[at.id]), int(model.mesh_facenum[at.id])
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.mesh_quat[at.id])
        vertices = model.mesh_vert[first : first + count] @ turn.reshape(3, 3).T
        mesh.name = at.name
        mesh.uservert = (vertices + model.mesh_pos[at.id]).ravel().tolist()
        mesh.userface = model.mesh_face[face : face + faces].ravel().tolist()
        mesh.file, mesh.scale = "", [1, 1, 1]
        mesh.refpos, mesh.refquat = [0, 0, 0], [1, 0, 0, 0]
    for texture in list(spec.textures):
        spec.delete(texture)
    for material in spec.materials:
        material.textures = [""] * len(material.textures)


def _weigh(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """State every body's inertia, so that no geom decides it any more."""
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
    """The bodies that move and their joints, base to tip, up to a gripper that moves."""
    links: list[str] = []
    joints: list[str] = []
    level = list(spec.worldbody.bodies)
    while level:
        moving = [body for body in level if any(True for _ in _joints_below(body))]
        moving = [body for body in moving if not _all_of(body, gripper)]
        if len(moving) > 1:
            raise ValueError(_branches(moving))
        if not moving:
            break
        body = moving[0]
        if body.joints:
            joint = body.joints[0]
            if len(body.joints) > 1 or joint.type not in _KINDS:
                raise ValueError(
                    f"body {body.name!r}: expected one hinge or slide joint a body; name the arm's "
                    'joints, Robot(file, joints=("...", ...)), and the others are welded'
                )
            links.append(body.name)
            joints.append(joint.name)
        level = list(body.bodies)
    if not links:
        raise ValueError("no joints; expected an arm of hinge and slide joints")
    return tuple(links), tuple(joints)


def _all_of(body: mujoco.MjsBody, gripper: tuple[str, ...]) -> bool:
    return all(joint.name in gripper for joint in _joints_below(body))


def _branches(moving: list[mujoco.MjsBody]) -> str:
    """Where it branches, and what to do about it."""
    parts = []
    for body in moving:
        names = [joint.name for joint in _joints_below(body)]
        shown = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
        parts.append(f"{body.name} ({len(names)} joints: {shown})")
    return (
        f"it branches into {'; '.join(parts)}; expected one serial chain of joints. Name those of "
        'the arm, Robot(file, joints=("...", ...)) or joints = ["...", ...] in a TOML file, and '
        "the others are welded"
    )


def _let_collide(spec: mujoco.MjSpec, links: tuple[str, ...]) -> tuple[str, ...]:
    """Every colliding geom of the file gets the arm's bits; links without one get a capsule.

    Returns the names of the latter.
    """
    sticks = []
    for geom in spec.geoms:
        if geom.contype or geom.conaffinity:
            geom.contype, geom.conaffinity = ARM_BITS, OBSTACLE_BITS
    for i, link in enumerate(links):
        body = spec.body(link)
        if any(geom.contype for geom in body.geoms):
            continue
        sticks.append(link)
        reach = np.array(spec.body(links[i + 1]).pos) if i + 1 < len(links) else np.zeros(3)
        long = float(np.linalg.norm(reach)) > 2 * STICK_RADIUS
        kind = mujoco.mjtGeom.mjGEOM_CAPSULE if long else mujoco.mjtGeom.mjGEOM_SPHERE
        stick = body.add_geom(type=kind, size=[STICK_RADIUS, 0, 0], group=3, mass=0)
        stick.contype, stick.conaffinity = ARM_BITS, OBSTACLE_BITS
        if long:
            stick.fromto = [0, 0, 0, *reach]
    return tuple(sticks)
