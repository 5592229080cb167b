"""Shapes and poses of the bodies of a MuJoCo model."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.findings import FileError
from tauguard.models.cloth import flex_elements

LARGEST_SHOWN_GROUP = 2  # in MuJoCo's viewer and the menagerie, group 3 holds collision geoms
STICK_RADIUS = 0.02  # [m] radius of the capsules in place of links without geometry
STICK_COLOUR = (191, 196, 204)


@dataclass(frozen=True)
class Body:
    """A body of the scene with its shapes."""

    name: str
    shapes: tuple[Any, ...]  #: rerun archetypes in the frame of the body
    moves: bool  #: False for a body fixed to the world


@dataclass(frozen=True)
class Motion:
    """Poses of bodies: rows are samples, columns bodies."""

    positions: Array  #: world [m], shape (T, bodies, 3)
    quats: Array  #: unit quaternions, scalar last, shape (T, bodies, 4)


def load_model(source: Any) -> Any:
    """A ``mujoco.MjModel`` from a model, an MJCF or URDF file, or MJCF text.

    A URDF whose meshes are missing is drawn as sticks between its joints.

    Raises:
        FileError: the file or text is no valid model, or needs too much time or memory (see
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
        raise FileError(f"{name}: {error}" if is_text else str(error)) from error
    try:
        parse = mujoco.MjSpec.from_string if is_text else mujoco.MjSpec.from_file
        spec = parse(str(source))
    except (ValueError, RuntimeError) as error:
        raise FileError(f"{name}: no MJCF or URDF: {error}") from error
    spec.compiler.discardvisual = False
    try:
        return compiled(spec)
    except ValueError as error:
        raise FileError(f"{name}: {error}") from error


def bodies(model: Any) -> list[Body]:
    """All bodies of the model, the world first; some have no shapes."""
    found = []
    for index in range(model.nbody):
        body = model.body(index)
        first, count = int(model.body_geomadr[index]), int(model.body_geomnum[index])
        shapes = [drawn(model, geom) for geom in range(first, first + count)]
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


def drawn(model: Any, geom: int) -> Any:
    """A geom as a rerun archetype; None if it is hidden, a plane or a height field."""
    import mujoco
    import rerun as rr

    kind, size = mujoco.mjtGeom(int(model.geom_type[geom])), model.geom_size[geom]
    material = int(model.geom_matid[geom])
    rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    if model.geom_group[geom] > LARGEST_SHOWN_GROUP or rgba[3] == 0:
        return None
    colour = np.round(255 * np.clip(rgba, 0, 1)).astype(np.uint8)
    place, quat = model.geom_pos[geom].copy(), model.geom_quat[geom]
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return capsule(place, quat, size[0], size[1], colour)
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        return mesh(model, int(model.geom_dataid[geom]), place, matrix(quat), colour)
    common = {"quaternions": [np.roll(quat, -1)], "colors": [colour], "fill_mode": "solid"}
    common["centers"] = [place]
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return rr.Cylinders3D(lengths=[2 * size[1]], radii=[size[0]], **common)
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return rr.Boxes3D(half_sizes=[size], **common)
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return rr.Ellipsoids3D(half_sizes=[[size[0]] * 3], **common)
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        return rr.Ellipsoids3D(half_sizes=[size], **common)
    return None


def capsule(center: Array, quat_wxyz: Array, radius: float, half: float, colour: Any) -> Any:
    """A capsule as a rerun archetype, which begins at its origin and extends along z."""
    import rerun as rr  # here, so that a video, which needs none, does not load it

    start = center - matrix(quat_wxyz) @ np.array([0.0, 0.0, half])
    return rr.Capsules3D(
        lengths=[2 * half],
        radii=[radius],
        translations=[start],
        quaternions=[np.roll(quat_wxyz, -1)],
        colors=[colour],
        fill_mode="solid",
    )


def mesh(model: Any, number: int, center: Array, rotation: Array, colour: Any) -> Any:
    """A mesh as a rerun archetype; each triangle has its own vertices, with its normals."""
    import rerun as rr

    vertex, face = int(model.mesh_vertadr[number]), int(model.mesh_faceadr[number])
    corners = slice(face, face + int(model.mesh_facenum[number]))
    points = model.mesh_vert[vertex : vertex + int(model.mesh_vertnum[number])]
    first = int(model.mesh_normaladr[number])
    normals = model.mesh_normal[first : first + int(model.mesh_normalnum[number])]
    vertices = points[model.mesh_face[corners]].reshape(-1, 3)
    return rr.Mesh3D(
        vertex_positions=vertices @ rotation.T + center,
        vertex_normals=normals[model.mesh_facenormal[corners]].reshape(-1, 3) @ rotation.T,
        triangle_indices=np.arange(len(vertices), dtype=np.int32).reshape(-1, 3),
        albedo_factor=colour,
    )


def matrix(quat_wxyz: Array) -> Array:
    """Rotation matrix of a unit quaternion, shape (3, 3)."""
    import mujoco

    found = np.empty(9)
    mujoco.mju_quat2Mat(found, quat_wxyz)
    return found.reshape(3, 3)


def sticks(model: Any, index: int) -> list[Any]:
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
        found.append(capsule(end / 2, quat, STICK_RADIUS, length / 2, STICK_COLOUR))
    return found


def sheets(model: Any) -> Iterator[tuple[int, slice, NDArray[np.int32]]]:
    """Each cloth of the model: its flex, its rows of ``flexvert_xpos``, and its triangles."""
    for flex in np.flatnonzero(np.asarray(model.flex_dim) == 2).tolist():
        first = int(model.flex_vertadr[flex])
        rows = slice(first, first + int(model.flex_vertnum[flex]))
        yield flex, rows, flex_elements(model, flex) - first


def motion(model: Any, joint_names: Sequence[str], q: Array) -> Motion:
    """World poses of all bodies for joint positions ``q`` [rad], shape (T, n).

    Joints of the model that are not in ``joint_names`` keep the model's initial position.

    Raises:
        FileError: a joint that the model lacks, or that is not a hinge or a slide.
    """
    import mujoco

    known = {model.joint(i).name: i for i in range(model.njnt)}
    missing = [name for name in joint_names if name not in known]
    if missing:
        raise FileError(
            f"joint {missing[0]!r} is not in the model; its joints: {', '.join(known) or 'none'}"
        )
    joints = [known[name] for name in joint_names]
    single = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}
    for name, joint in zip(joint_names, joints, strict=True):
        if int(model.jnt_type[joint]) not in single:
            raise FileError(f"joint {name!r}: expected a hinge or a slide")
    address = model.jnt_qposadr[joints]
    data = mujoco.MjData(model)
    positions = np.empty((len(q), model.nbody, 3))
    quats = np.empty((len(q), model.nbody, 4))
    for row, value in enumerate(q):
        data.qpos[address] = value
        mujoco.mj_kinematics(model, data)
        positions[row], quats[row] = data.xpos, data.xquat
    return Motion(positions, np.roll(quats, -1, axis=-1))
