"""Shapes and poses of the bodies of a MuJoCo model."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array

LARGEST_SHOWN_GROUP = 2  # in MuJoCo's viewer and the menagerie, group 3 holds collision geoms
STICK_RADIUS = 0.02  # [m] radius of the capsules in place of links without geometry


@dataclass(frozen=True)
class Shape:
    """One geom in the frame of its body."""

    kind: str  #: "sphere", "ellipsoid", "capsule", "cylinder", "box" or "mesh"
    size: Array  #: MuJoCo's sizes: radius, half-lengths [m], shape (3,)
    position: Array  #: [m], shape (3,)
    quat_wxyz: Array  #: shape (4,)
    rgba: Array  #: in [0, 1], shape (4,)
    vertices: NDArray[np.float32] | None = None  #: vertices of a mesh [m], shape (V, 3)
    normals: NDArray[np.float32] | None = None  #: one per vertex, shape (V, 3)
    triangles: NDArray[np.int32] | None = None  #: vertex indices, shape (F, 3)


@dataclass(frozen=True)
class Body:
    """A body of the scene with its shapes."""

    name: str
    shapes: tuple[Shape, ...]
    moves: bool  #: False for a body fixed to the world


@dataclass(frozen=True)
class Motion:
    """Poses of bodies: rows are samples, columns bodies."""

    positions: Array  #: world [m], shape (T, bodies, 3)
    quats_wxyz: Array  #: world, shape (T, bodies, 4)


def load_model(source: Any) -> Any:
    """A ``mujoco.MjModel`` from a model, an MJCF or URDF file, or MJCF text.

    A URDF whose meshes are missing is drawn as sticks between its joints.

    Raises:
        ValueError: the file or text is no valid model, or needs too much time or memory (see
            :func:`tauguard.models.robot_check.checked_robot`); one line.
        OSError: the file is missing.
    """
    import mujoco

    from tauguard.models.mjcf import compiled
    from tauguard.models.robot_check import checked_robot, checked_text

    if isinstance(source, mujoco.MjModel):
        return source
    is_text = isinstance(source, str) and source.lstrip().startswith("<")
    if not is_text and not Path(source).is_file():
        raise FileNotFoundError(f"{source}: no such file; expected an MJCF or URDF file")
    name = "the attached MJCF" if is_text else str(source)
    try:
        if is_text:
            checked_text(source)
        else:
            checked_robot(Path(source))
    except ValueError as error:
        raise ValueError(f"{name}: {error}" if is_text else str(error)) from error
    try:
        parse = mujoco.MjSpec.from_string if is_text else mujoco.MjSpec.from_file
        spec = parse(str(source))
    except (ValueError, RuntimeError) as error:
        raise ValueError(f"{name}: no MJCF or URDF: {error}") from error
    spec.compiler.discardvisual = False
    try:
        return compiled(spec)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error


def bodies(model: Any) -> list[Body]:
    """All bodies of the model, the world first; some have no shapes."""
    found = []
    for index in range(model.nbody):
        body = model.body(index)
        first, count = int(model.body_geomadr[index]), int(model.body_geomnum[index])
        shapes = [shape(model, geom) for geom in range(first, first + count)]
        moves = bool(model.body_weldid[index]) or model.body_mocapid[index] >= 0
        found.append(
            Body(body.name or f"body {index}", tuple(s for s in shapes if s is not None), moves)
        )
    if not any(body.shapes and body.moves for body in found):
        found = [
            Body(body.name, (*body.shapes, *sticks(model, index)), body.moves)
            for index, body in enumerate(found)
        ]
    return found


def shape(model: Any, geom: int) -> Shape | None:
    """Convert a geom to a shape; None if it is hidden, a plane or a height field."""
    import mujoco

    kinds = {
        mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
        mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
        mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
        mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
        mujoco.mjtGeom.mjGEOM_BOX: "box",
        mujoco.mjtGeom.mjGEOM_MESH: "mesh",
    }
    kind = kinds.get(mujoco.mjtGeom(int(model.geom_type[geom])))
    material = int(model.geom_matid[geom])
    rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    if kind is None or model.geom_group[geom] > LARGEST_SHOWN_GROUP or rgba[3] == 0:
        return None
    faces: dict[str, Any] = {}
    if kind == "mesh":
        mesh = int(model.geom_dataid[geom])
        vertex, face = int(model.mesh_vertadr[mesh]), int(model.mesh_faceadr[mesh])
        corners = slice(face, face + int(model.mesh_facenum[mesh]))
        points = model.mesh_vert[vertex : vertex + int(model.mesh_vertnum[mesh])]
        triangles = model.mesh_face[corners]
        first = int(model.mesh_normaladr[mesh])
        normals = model.mesh_normal[first : first + int(model.mesh_normalnum[mesh])]
        corner_normals = normals[model.mesh_facenormal[corners]]
        faces = {
            "vertices": points[triangles].reshape(-1, 3).copy(),
            "normals": corner_normals.reshape(-1, 3).copy(),
            "triangles": np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3),
        }
    return Shape(
        kind=kind,
        size=model.geom_size[geom].copy(),
        position=model.geom_pos[geom].copy(),
        quat_wxyz=model.geom_quat[geom].copy(),
        rgba=np.asarray(rgba, float).copy(),
        **faces,
    )


def sticks(model: Any, index: int) -> list[Shape]:
    """Capsules from a body's origin to the origins of its children."""
    import mujoco

    found = []
    for child in np.flatnonzero(model.body_parentid == index):
        end = model.body_pos[child]
        length = float(np.linalg.norm(end))
        if child == index or length < STICK_RADIUS:
            continue
        quat = np.empty(4)
        mujoco.mju_quatZ2Vec(quat, end / length)
        grey = np.array([0.75, 0.77, 0.8, 1.0])
        size = np.array([STICK_RADIUS, length / 2, 0.0])
        found.append(Shape("capsule", size, end / 2, quat, grey))
    return found


def motion(model: Any, joint_names: Sequence[str], q: Array) -> Motion:
    """World poses of all bodies for joint positions ``q`` [rad], shape (T, n).

    Joints of the model that are not in ``joint_names`` keep the model's initial position.

    Raises:
        ValueError: a joint that the model lacks, or that is not a hinge or a slide.
    """
    import mujoco

    known = {model.joint(i).name: i for i in range(model.njnt)}
    missing = [name for name in joint_names if name not in known]
    if missing:
        raise ValueError(
            f"joint {missing[0]!r} is not in the model; its joints: {', '.join(known) or 'none'}"
        )
    joints = [known[name] for name in joint_names]
    single = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}
    for name, joint in zip(joint_names, joints, strict=True):
        if int(model.jnt_type[joint]) not in single:
            raise ValueError(f"joint {name!r}: expected a hinge or a slide")
    address = model.jnt_qposadr[joints]
    data = mujoco.MjData(model)
    positions = np.empty((len(q), model.nbody, 3))
    quats = np.empty((len(q), model.nbody, 4))
    for row, value in enumerate(q):
        data.qpos[address] = value
        mujoco.mj_kinematics(model, data)
        positions[row], quats[row] = data.xpos, data.xquat
    return Motion(positions, quats)


def quats_wxyz(rotations: Array) -> Array:
    """Unit quaternions (w first) of rotation matrices, shape (..., 3, 3) to (..., 4)."""
    from scipy.spatial.transform import Rotation

    flat = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat(scalar_first=True)
    return np.asarray(flat, np.float64).reshape(*rotations.shape[:-2], 4)
