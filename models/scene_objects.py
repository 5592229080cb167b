"""A user's objects in a scene: fixtures, bins, tools, held and free parts, moving objects."""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from tauguard.arrays import Array, in_a_line
from tauguard.findings import ArgumentError
from tauguard.models.checks import above_zero, check_keys, not_negative, vector
from tauguard.models.mjcf import inline_meshes, xml_text
from tauguard.untrusted_input import read_text, reading

Vector = tuple[float, float, float]
Quat = tuple[float, float, float, float]

#: Primitive shapes and the length of their size, as in MuJoCo: half extents [m] of a
#: box and an ellipsoid; radius and, but for a sphere, half length [m].
SHAPES = {"box": 3, "sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3, "mesh": 0}
#: An object is fixed, held by the tool, or free; a fixed object with a path follows it.
MOTIONS = ("fixed", "held", "free")
#: Collision bits: of objects among themselves, and of free objects with table and floor. The arm
#: collides with objects through contact pairs.
OBJECT_BIT, GROUND_BIT = 4, 8
#: The constraint that holds a graspable object has the object's name with this ending.
GRASP = "_grasp"
_COLOUR = (0.55, 0.6, 0.65, 1.0)
#: Mass of a conveyor's belt [kg], large enough that parts on it do not slow it down.
BELT_MASS = 1e4
#: Sizes of shapes lie between these [m].
LEAST, MOST = 1e-5, 1e3
#: Largest initial overlap of free objects [m]; a deeper one would eject them.
RESTING = 1e-3


@dataclass(frozen=True)
class Shape:
    """One primitive or mesh in the frame of its object; a mesh collides as its convex hull."""

    kind: str  #: one of :data:`SHAPES`
    size: tuple[float, ...] = ()  #: [m], see :data:`SHAPES`
    position: Vector = (0.0, 0.0, 0.0)  #: [m]
    quat_wxyz: Quat = (1.0, 0.0, 0.0, 0.0)
    file: str = ""  #: file of a mesh, in any format that trimesh reads
    rgba: tuple[float, ...] = _COLOUR

    def __post_init__(self) -> None:
        """Check the values: ``ArgumentError`` names the one that is wrong."""
        if self.kind not in SHAPES:
            raise ArgumentError(f"shape {self.kind!r}: expected one of {', '.join(SHAPES)}")
        object.__setattr__(self, "size", tuple(np.atleast_1d(self.size).tolist()))
        for name, size in (("position", 3), ("quat_wxyz", 4), ("rgba", 4)):
            object.__setattr__(self, name, vector(self, name, size))
        object.__setattr__(self, "quat_wxyz", _unit(self.quat_wxyz, self.kind))
        if len(self.size) != SHAPES[self.kind] or not all(LEAST < s < MOST for s in self.size):
            raise ArgumentError(
                f"{self.kind} size {self.size}: expected {SHAPES[self.kind]} numbers between "
                f"{LEAST} and {MOST} [m]"
            )
        if self.kind == "mesh" and not Path(self.file).is_file():
            raise ArgumentError(f"mesh {self.file!r}: no such file")


@dataclass(frozen=True)
class SceneObject:
    """A user's object: its shapes or an MJCF fragment, and its motion.

    Contacts with the arm have the given stiffness, are labelled, and count against the
    limits like those with people. Environments treat an object as a region of its name.
    """

    __repr__ = in_a_line

    name: str
    shapes: tuple[Shape, ...] = ()
    mjcf: Any = ""
    """Instead of shapes: an MJCF fragment as text or file, a ``mujoco.MjSpec``, or a root of
    dm_control's ``mjcf``. It is stored as text that includes meshes. Its bodies may have joints."""
    position: Vector = (0.0, 0.0, 0.0)  #: in the world, or in the frame of the holding tool [m]
    quat_wxyz: Quat = (1.0, 0.0, 0.0, 0.0)
    motion: str = "fixed"  #: one of :data:`MOTIONS`
    path: tuple[tuple[float, ...], ...] = ()
    """Rows of time [s] and position [m], from 0 on; after the last row it repeats. It replaces
    ``position``."""
    belt: Vector | None = None
    """Velocity of a conveyor's surface in the object's frame [m/s]. The object itself does not
    move, but carries parts that lie on it."""
    mass: float = 1.0  #: mass of a free or held object [kg]
    stiffness: float = 1e5  #: of its contact with the arm [N/m]
    damping: float = 100.0  #: of its contact with the arm [N s/m]
    quasi_static_limit: float | None = None  #: largest lasting force without a cost [N]
    transient_limit: float | None = None  #: largest force of an impact without a cost [N]
    graspable: bool = False
    """Whether an environment's task can fix this free object to the tool. It does not collide with
    the last link."""

    def __post_init__(self) -> None:
        """Check the values: ``ArgumentError`` names the one that is wrong."""
        shapes = tuple(s if isinstance(s, Shape) else Shape(**s) for s in self.shapes)
        object.__setattr__(self, "shapes", shapes)
        object.__setattr__(self, "position", vector(self, "position", 3))
        object.__setattr__(self, "quat_wxyz", _unit(vector(self, "quat_wxyz", 4), self.name))
        object.__setattr__(self, "mjcf", _text(self.mjcf, self.name))
        path = tuple(tuple(map(float, row)) for row in self.path)
        object.__setattr__(self, "path", path)
        if not self.name.isidentifier():
            raise ArgumentError(f"object {self.name!r}: expected a name of letters, digits and _")
        if bool(shapes) == bool(self.mjcf):
            raise ArgumentError(f"object {self.name}: expected either shapes or mjcf")
        if self.motion not in MOTIONS:
            raise ArgumentError(
                f"object {self.name}: motion {self.motion!r}; expected one of {', '.join(MOTIONS)}"
            )
        if self.graspable and self.motion != "free":
            raise ArgumentError(f"object {self.name}: graspable: expected motion 'free'")
        above_zero(self, "mass", "stiffness")
        for name in ("quasi_static_limit", "transient_limit"):
            if getattr(self, name) is not None:
                above_zero(self, name)
        not_negative(self, "damping")
        if self.belt is not None:
            object.__setattr__(self, "belt", vector(self, "belt", 3))
            if self.motion != "fixed" or path or not any(self.belt):
                raise ArgumentError(
                    f"object {self.name}: belt {self.belt}: expected motion 'fixed', no path, and "
                    "a velocity that is not zero"
                )
        if path:
            if not np.isfinite(path).all():
                raise ArgumentError(f"object {self.name}: path: expected finite numbers")
            times = [row[0] for row in path]
            if self.motion != "fixed" or any(len(row) != 4 for row in path) or len(path) < 2:
                raise ArgumentError(
                    f"object {self.name}: path: expected motion 'fixed' and two or more rows of "
                    "time, x, y, z"
                )
            if times[0] != 0 or any(b <= a for a, b in itertools.pairwise(times)):
                raise ArgumentError(f"object {self.name}: path: expected times that grow from 0 on")
            object.__setattr__(self, "position", path[0][1:])

    @property
    def moves(self) -> bool:
        """Whether its position changes."""
        return self.motion == "free" or bool(self.path)

    def places(self, step: float) -> Array:
        """Positions along the path, at most ``step`` apart [m], shape (k, 3)."""
        rows = np.array(self.path)[:, 1:]
        pieces = [
            np.linspace(a, b, 1 + int(np.ceil(np.linalg.norm(b - a) / step)))
            for a, b in itertools.pairwise(rows)
        ]
        return np.concatenate(pieces)

    @property
    def touchable(self) -> bool:
        """Whether the arm can touch it (a held object is part of the arm)."""
        return self.motion != "held"


def _unit(quat: tuple[float, ...], name: str) -> Quat:
    size = float(np.linalg.norm(quat))
    if not size > 0:
        raise ArgumentError(f"{name}: quat_wxyz {quat}: expected a quaternion that is not zero")
    w, x, y, z = (c / size for c in quat)
    return w, x, y, z


def _text(mjcf: Any, name: str) -> str:
    """Self-contained MJCF text."""
    if isinstance(mjcf, str) and (not mjcf or mjcf.lstrip().startswith("<")):
        return mjcf
    try:
        if isinstance(mjcf, mujoco.MjSpec):
            spec = mjcf.copy()
        elif hasattr(mjcf, "to_xml_string"):  # dm_control's
            spec = mujoco.MjSpec.from_string(mjcf.to_xml_string(), assets=mjcf.get_assets())
        elif not Path(mjcf).is_file():
            raise ArgumentError(f"mjcf {str(mjcf)!r}: no such file, and no MJCF text")
        else:
            spec = mujoco.MjSpec.from_file(str(mjcf))
        inline_meshes(spec, spec.compile())
        spec.compile()
    except ValueError as error:
        raise ArgumentError(f"object {name}: {' '.join(str(error).split())}") from None
    return xml_text(spec)


def load_objects(path: str | Path) -> tuple[SceneObject, ...]:
    """The objects of a TOML file: tables ``[[object]]`` with ``[[object.shapes]]``.

    Files that it names are relative to its folder.

    Raises:
        ArgumentError: not TOML, or a key or value that an object cannot have.
        FileNotFoundError: no such file.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"objects {path}: no such file; expected a TOML file of objects")
    with reading(path):
        rows = tomllib.loads(read_text(path)).get("object", [])
        if not rows:
            raise ArgumentError("no objects; expected tables [[object]]")
        return tuple(_from_mapping(row, path.parent) for row in rows)


def _from_mapping(row: Mapping[str, Any], folder: Path) -> SceneObject:
    values = dict(row)
    check_keys(values, SceneObject)
    shapes = []
    for part in values.pop("shapes", ()):
        check_keys(part, Shape)
        beside = folder / part["file"] if "file" in part else None
        shapes.append(Shape(**part | ({"file": str(beside)} if beside else {})))
    if "mjcf" in values and (folder / values["mjcf"]).is_file():
        values["mjcf"] = str(folder / values["mjcf"])
    return SceneObject(shapes=tuple(shapes), **values)


def hold(
    spec: mujoco.MjSpec, link: mujoco.MjsBody, flange: mujoco.MjsSite, obj: SceneObject
) -> None:
    """Attach a held object to the last link: shapes to the link, mass to an extra body."""
    pose = np.zeros(3), np.zeros(4)
    mujoco.mju_mulPose(*pose, flange.pos, flange.quat, obj.position, obj.quat_wxyz)
    place, turn = pose
    carrier = link.add_body(name=obj.name, pos=place, quat=turn)
    carrier.explicitinertial, carrier.mass = True, obj.mass
    carrier.inertia = [obj.mass * 1e-3] * 3
    for geom in _fill(spec, carrier, obj):
        at, quat = np.zeros(3), np.zeros(4)
        mujoco.mju_mulPose(at, quat, place, turn, geom.pos, geom.quat)
        mesh, kind, size = geom.meshname, geom.type, geom.size.copy()
        rgba, name = geom.rgba.copy(), geom.name
        spec.delete(geom)
        moved = link.add_geom(name=name, type=kind, size=size, pos=at, quat=quat, rgba=rgba, mass=0)
        if mesh:
            moved.meshname = mesh
        moved.contype, moved.conaffinity = 1, 2


def add_object(spec: mujoco.MjSpec, obj: SceneObject) -> list[mujoco.MjsGeom]:
    """Add a fixed, moving or free object as a body of its name; returns its geoms."""
    body = spec.worldbody.add_body(
        name=obj.name, pos=obj.position, quat=obj.quat_wxyz, mocap=bool(obj.path)
    )
    if obj.motion == "free":
        body.add_freejoint()
    if obj.belt is not None:
        axis = np.array(obj.belt) / np.linalg.norm(obj.belt)
        body.add_joint(name=obj.name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        body.gravcomp = 1
    geoms = _fill(spec, body, obj)
    for geom in geoms:
        geom.contype = geom.conaffinity = OBJECT_BIT
        if obj.motion == "free":
            geom.conaffinity |= GROUND_BIT
        if obj.motion == "free" or obj.belt is not None:
            geom.mass = (obj.mass if obj.belt is None else BELT_MASS) / len(geoms)
    return geoms


def add_grasp(spec: mujoco.MjSpec, link: str, obj: SceneObject) -> None:
    """Add the constraint that holds a graspable object on a link; it is switched off."""
    spec.add_equality(
        name=obj.name + GRASP,
        type=mujoco.mjtEq.mjEQ_WELD,
        objtype=mujoco.mjtObj.mjOBJ_BODY,
        name1=link,
        name2=obj.name,
        active=False,
    )


def _fill(spec: mujoco.MjSpec, body: mujoco.MjsBody, obj: SceneObject) -> list[mujoco.MjsGeom]:
    """The geoms of an object on a body, named after it."""
    if obj.mjcf:
        try:
            child = mujoco.MjSpec.from_string(obj.mjcf)
        except ValueError as error:
            raise ArgumentError(f"object {obj.name}: {' '.join(str(error).split())}") from None
        spec.attach(child, frame=body.add_frame(), prefix=f"{obj.name}_")
    else:
        for k, shape in enumerate(obj.shapes):
            _add_shape(spec, body, shape, f"{obj.name}_{k}")
    geoms = [geom for part in _below(body) for geom in part.geoms]
    if not geoms:
        raise ArgumentError(f"object {obj.name}: no geoms; expected something that can be touched")
    for k, geom in enumerate(geoms):
        geom.name = f"{obj.name}_{k}"
    return geoms


def check_apart(model: mujoco.MjModel, objects: tuple[SceneObject, ...]) -> None:
    """Check that free objects overlap nothing at the beginning.

    Raises:
        ArgumentError: an overlap exceeds :data:`RESTING`; the message has both names.
    """
    free = {obj.name for obj in objects if obj.motion == "free"}
    if not free:
        return
    data, parts = mujoco.MjData(model), {obj.name for obj in objects if obj.touchable}
    mujoco.mj_fwdPosition(model, data)
    for contact in data.contact:
        names = [_owner(model, int(geom), parts) for geom in contact.geom]
        if contact.dist < -RESTING and names[0] != names[1] and free & set(names):
            first, second = sorted(names, key=lambda name: name not in free)
            raise ArgumentError(
                f"objects: {first} is {-1000 * contact.dist:.0f} mm inside {second}; expected free "
                "objects that overlap nothing"
            )


def _owner(model: mujoco.MjModel, geom: int, parts: set[str]) -> str:
    """The name of a geom's object, or else of the geom."""
    body = int(model.geom_bodyid[geom])
    while body:
        if model.body(body).name in parts:
            return str(model.body(body).name)
        body = int(model.body_parentid[body])
    return model.geom(geom).name or "the scene"


def _below(body: mujoco.MjsBody) -> Iterable[mujoco.MjsBody]:
    yield body
    for child in body.bodies:
        yield from _below(child)


def _add_shape(spec: mujoco.MjSpec, body: mujoco.MjsBody, shape: Shape, name: str) -> None:
    kind = getattr(mujoco.mjtGeom, f"mjGEOM_{shape.kind.upper()}")
    size = [*shape.size, 0.0, 0.0, 0.0][:3]
    geom = body.add_geom(
        name=name, type=kind, size=size, pos=shape.position, quat=shape.quat_wxyz, rgba=shape.rgba
    )
    if shape.kind == "mesh":
        import trimesh

        found = trimesh.load_mesh(shape.file)
        mesh = spec.add_mesh(name=name)
        mesh.uservert = np.asarray(found.vertices, dtype=np.float64).ravel().tolist()
        mesh.userface = np.asarray(found.faces, dtype=np.int32).ravel().tolist()
        geom.meshname = name
