"""The nominal rigid-body model of an arm in Pinocchio, from the numbers that MuJoCo compiles.

``pin.buildModelFromMJCF`` silently ignores base rotations, ``<option gravity>`` and everything
below the first top-level body. Here MuJoCo compiles the file, and the Pinocchio model is built
from the compiled numbers, so that both describe the same arm, for MJCF and URDF alike.
"""

import contextlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import mujoco
import numpy as np
import pinocchio as pin

from tauguard.arrays import Array
from tauguard.findings import ArgumentError
from tauguard.models.robot_check import checked_robot, checked_text
from tauguard.models.urdf import is_urdf, xml_root
from tauguard.untrusted_input import read_text

#: Deepest nesting of elements in a robot file.
MOST_DEPTH = 200


def compiled(source: str | Path | mujoco.MjSpec | mujoco.MjModel) -> mujoco.MjModel:
    """The MuJoCo model of MJCF or URDF text, of a file, or of a spec.

    Missing meshes of a URDF are ignored, because dynamics do not need them.

    Raises:
        ArgumentError: MuJoCo cannot compile the text or file.
        FileNotFoundError: no such file.
    """
    if isinstance(source, mujoco.MjModel):
        return source
    try:
        if isinstance(source, mujoco.MjSpec):
            return source.compile()
        text = str(source)
        if text.lstrip().startswith("<"):
            return mujoco.MjModel.from_xml_string(text)
        path = Path(text)
        if not path.is_file():
            raise FileNotFoundError(f"{path}: no such robot file")
        if is_urdf(path):
            return _compiled_urdf(read_text(path))
        return mujoco.MjModel.from_xml_path(str(checked_robot(path)))
    except ValueError as error:
        raise ArgumentError(f"robot: {' '.join(str(error).split())}") from None


def _compiled_urdf(text: str) -> mujoco.MjModel:
    """The model of a URDF without shapes; massless moving links get a mass of 0.1 g."""
    try:
        return mujoco.MjModel.from_xml_string(checked_text(_without_shapes(text)))
    except ValueError as error:
        light = {"boundmass": "1e-4", "boundinertia": "1e-8"}
        with contextlib.suppress(ValueError):  # otherwise masses are not the cause
            return mujoco.MjModel.from_xml_string(checked_text(_without_shapes(text, light)))
        raise error


def _without_shapes(urdf: str, compiler: Mapping[str, str] = MappingProxyType({})) -> str:
    """A URDF without visual and collision elements, fixed joints kept."""
    root = xml_root(urdf)
    _check_depth(root)
    for link in root.findall("link"):
        for kind in ("visual", "collision"):
            for element in link.findall(kind):
                link.remove(element)
    extension = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(
        extension,
        "compiler",
        {"fusestatic": "false", "discardvisual": "false", "strippath": "true", **compiler},
    )
    return ElementTree.tostring(root, encoding="unicode")


def _check_depth(root: ElementTree.Element) -> None:
    """Refuse deep nesting, which would exhaust the stack when the text is written."""
    level, depth = [root], 0
    while level:
        level, depth = [child for one in level for child in one], depth + 1
        if depth > MOST_DEPTH:
            raise ArgumentError(f"elements nested more than {MOST_DEPTH} deep")


def pin_model(source: str | Path | mujoco.MjSpec | mujoco.MjModel) -> pin.Model:
    """The Pinocchio model of an arm: hinge and slide joints, armature included, sites as frames.

    Args:
        source: MJCF or URDF (text or file), a spec or a compiled model, of the arm only.

    Raises:
        ArgumentError: not a model, no joints, ball or free joints, or several joints on one body.
    """
    m = compiled(source)
    if m.njnt == 0:
        raise ArgumentError("robot: no joints; expected an arm of hinge and slide joints")
    data = mujoco.MjData(m)
    data.qpos[:] = 0
    mujoco.mj_kinematics(m, data)
    model = pin.Model()
    model.name = "arm"
    model.gravity.linear = m.opt.gravity
    joint_of, offset = {0: 0}, {0: pin.SE3.Identity()}
    for body in range(1, m.nbody):
        placed = pin.SE3(_quat(m.body_quat[body]), m.body_pos[body])
        parent = int(m.body_parentid[body])
        joint, here = joint_of[parent], offset[parent] * placed
        if m.body_jntnum[body] > 1:
            raise ArgumentError(
                f"robot: body {m.body(body).name!r} has several joints; expected one"
            )
        if m.body_jntnum[body] == 1:
            joint, here = _add_joint(model, m, int(m.body_jntadr[body]), joint, here)
        joint_of[body], offset[body] = joint, here
        if joint and m.body_mass[body] > 0:
            inertia = pin.Inertia(
                float(m.body_mass[body]),
                m.body_ipos[body],
                _quat(m.body_iquat[body])
                @ np.diag(m.body_inertia[body])
                @ _quat(m.body_iquat[body]).T,
            )
            model.appendBodyToJoint(joint, inertia, here)
    for i in range(m.nsite):
        name, body = m.site(i).name, int(m.site_bodyid[i])
        if name:
            place = offset[body] * pin.SE3(_quat(m.site_quat[i]), m.site_pos[i])
            model.addFrame(pin.Frame(name, joint_of[body], place, pin.FrameType.OP_FRAME), False)
    return model


def _add_joint(
    model: pin.Model, m: mujoco.MjModel, j: int, parent: int, body: pin.SE3
) -> tuple[int, pin.SE3]:
    """Add joint ``j``; returns its index and the pose of the body's frame in the joint's frame."""
    name = m.joint(j).name or f"joint{j + 1}"
    axis, anchor = m.jnt_axis[j], m.jnt_pos[j]
    placement = body * pin.SE3(np.eye(3), anchor)
    kinds = {
        int(mujoco.mjtJoint.mjJNT_HINGE): pin.JointModelRevoluteUnaligned,
        int(mujoco.mjtJoint.mjJNT_SLIDE): pin.JointModelPrismaticUnaligned,
    }
    kind = kinds.get(int(m.jnt_type[j]))
    if kind is None:
        raise ArgumentError(f"robot: joint {name!r} is neither hinge nor slide")
    at = model.addJoint(parent, kind(*axis), placement, name)
    model.armature[model.idx_vs[at]] = m.dof_armature[m.jnt_dofadr[j]]
    limited = bool(m.jnt_limited[j])
    low, high = m.jnt_range[j] if limited else (-np.inf, np.inf)
    model.lowerPositionLimit[model.idx_qs[at]] = low
    model.upperPositionLimit[model.idx_qs[at]] = high
    return at, pin.SE3(np.eye(3), -anchor)


def _quat(wxyz: Array) -> Array:
    frame = np.zeros(9)
    mujoco.mju_quat2Mat(frame, np.asarray(wxyz, dtype=float))
    return frame.reshape(3, 3)
