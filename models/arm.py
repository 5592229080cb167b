"""An arm from its file: the CURA6-like one by name, or any serial arm as MJCF or URDF."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.models import cura6
from tauguard.models.mjcf import compiled

Array = NDArray[np.float64]

#: Arms that need no file.
NAMED = cura6.NAMES
#: Collision bits: what the arm has and what obstacles have, so that the arm never meets itself.
ARM_BITS, OBSTACLE_BITS = 1, 2
#: Radius of the capsule that stands for a link without collision geometry [m].
STICK_RADIUS = 0.05
_SITES = ("flange", "attachment_site", "tool0", "ee_site")


@dataclass(frozen=True)
class Arm:
    """An arm ready to be put into a scene; ``spec`` holds nothing else."""

    spec: mujoco.MjSpec
    links: tuple[str, ...]  #: the body of each joint, base to tip
    joints: tuple[str, ...]
    torque_limit: Array  #: [N m], infinite where the file has none, shape (n,)
    home: Array  #: joint positions of the file's first keyframe, else all zero [rad], shape (n,)

    def shapes(self) -> list[mujoco.MjsGeom]:
        """The geoms of the links that can touch something, named."""
        found = []
        for link in self.links:
            colliding = [g for g in self.spec.body(link).geoms if g.contype or g.conaffinity]
            for i, geom in enumerate(colliding):
                geom.name = geom.name or f"{link}_collision{i}"
                found.append(geom)
        return found

    def flange(self) -> mujoco.MjsSite:
        """The site at the tool flange; the origin of the last link where the file names none."""
        sites = {site.name: site for site in self.spec.sites}
        for name in _SITES:
            if name in sites:
                return sites[name]
        return self.spec.body(self.links[-1]).add_site(name="flange")

    def place(self, pose: Array) -> None:
        """Move the base: ``pose`` is that of the file's world in the world, shape (4, 4)."""
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(pose[:3, :3]).ravel())
        frame = self.spec.worldbody.add_frame(pos=pose[:3, 3], quat=quat)
        world = self.spec.worldbody
        for part in (*world.bodies, *world.geoms, *world.sites):
            part.set_frame(frame)


def load_arm(source: str) -> Arm:
    """The arm called or filed as ``source``.

    A file's actuators, sensors and keyframes are left out (the drive is ours), welded bodies are
    fused into the links that carry them, mesh files are written into the text, and a link without
    collision geometry gets a capsule along it.

    Raises:
        ValueError: not a robot that MuJoCo can read, or not one serial chain of hinge and slide
            joints; the message says what would work.
        FileNotFoundError: no such name or file.
    """
    if source in NAMED:
        spec = mujoco.MjSpec.from_string(cura6.arm_xml(source))
        limits = spec.compile().jnt_actfrcrange[:, 1].copy()
        links = tuple(f"link{i}" for i in range(1, len(cura6.JOINTS) + 1))
        return Arm(spec, links, cura6.JOINTS, limits, np.array(cura6.HOME))
    path = Path(source)
    if not path.is_file():
        raise FileNotFoundError(
            f"arm {source!r}: no such file; expected {', '.join(NAMED)} or an MJCF or URDF file"
        )
    try:
        return _from_file(path)
    except ValueError as error:
        raise ValueError(f"arm {source}: {' '.join(str(error).split())}") from None


def _from_file(path: Path) -> Arm:
    spec = mujoco.MjSpec.from_file(str(path))
    model = compiled(spec)
    limits = _torque_limits(model)
    home = model.key_qpos[0].copy() if model.nkey else model.qpos0.copy()
    for element in (*spec.actuators, *spec.sensors, *spec.keys):
        spec.delete(element)
    _inline(spec, model)
    _weigh(spec, model)
    spec.fuse_static()
    links, joints = _chain(spec)
    _let_collide(spec, links)
    arm = Arm(spec, links, joints, limits, home)
    spec.compile()
    return arm


def _torque_limits(model: mujoco.MjModel) -> Array:
    """Of the joints, from their own ranges or those of the actuators that drive them."""
    limits = np.where(model.jnt_actfrclimited, np.abs(model.jnt_actfrcrange).max(axis=1), np.inf)
    for i in range(model.nu):
        if (
            model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT
            and model.actuator_forcelimited[i]
        ):
            joint = int(model.actuator_trnid[i, 0])
            force = np.abs(model.actuator_forcerange[i] * model.actuator_gear[i, 0]).max()
            limits[joint] = min(limits[joint], force)
    return np.asarray(limits, dtype=float)


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


def _chain(spec: mujoco.MjSpec) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The bodies that move and their joints, base to tip, named."""
    links: list[str] = []
    joints: list[str] = []
    level = list(spec.worldbody.bodies)
    while level:
        moving = [body for body in level if body.joints]
        if len(moving) > 1:
            names = ", ".join(body.name or "unnamed" for body in moving)
            raise ValueError(f"it branches into {names}; expected one serial chain of joints")
        if not moving:
            level = [child for body in level for child in body.bodies]
            continue
        body = moving[0]
        joint = body.joints[0]
        kinds = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
        if len(body.joints) > 1 or joint.type not in kinds:
            raise ValueError(f"body {body.name!r}: expected one hinge or slide joint a body")
        body.name = body.name or f"link{len(links) + 1}"
        joint.name = joint.name or f"joint{len(joints) + 1}"
        links.append(body.name)
        joints.append(joint.name)
        level = list(body.bodies)
    if not links:
        raise ValueError("no joints; expected an arm of hinge and slide joints")
    return tuple(links), tuple(joints)


def _let_collide(spec: mujoco.MjSpec, links: tuple[str, ...]) -> None:
    """Every colliding geom of the file gets the arm's bits; links without one get a capsule."""
    for geom in spec.geoms:
        if geom.contype or geom.conaffinity:
            geom.contype, geom.conaffinity = ARM_BITS, OBSTACLE_BITS
    for i, link in enumerate(links):
        body = spec.body(link)
        if any(geom.contype for geom in body.geoms):
            continue
        reach = np.array(spec.body(links[i + 1]).pos) if i + 1 < len(links) else np.zeros(3)
        long = float(np.linalg.norm(reach)) > 2 * STICK_RADIUS
        kind = mujoco.mjtGeom.mjGEOM_CAPSULE if long else mujoco.mjtGeom.mjGEOM_SPHERE
        stick = body.add_geom(type=kind, size=[STICK_RADIUS, 0, 0], group=3, mass=0)
        stick.contype, stick.conaffinity = ARM_BITS, OBSTACLE_BITS
        if long:
            stick.fromto = [0, 0, 0, *reach]
