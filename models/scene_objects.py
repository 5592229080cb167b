"""Things of your own in a scene: fixtures, bins, tools, held and loose parts, things that move."""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from tauguard.models.checks import above_zero, not_negative
from tauguard.untrusted_input import read_text, reading

Vector = tuple[float, float, float]
Quat = tuple[float, float, float, float]

#: Primitive shapes and how many numbers their size has, as MuJoCo has them: half extents [m] of a
#: box and an ellipsoid; radius and, but for a sphere, half length [m].
SHAPES = {"box": 3, "sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3, "mesh": 0}
#: What an object does: stands, hangs on the tool, or is free; one with a path follows it.
MOTIONS = ("fixed", "held", "free")
#: Objects touch one another, and the table, by this bit; the arm meets them by contact pairs.
OBJECT_BIT = 4
_COLOUR = (0.55, 0.6, 0.65, 1.0)


@dataclass(frozen=True)
class Shape:
    """One primitive or mesh in the frame of its object; a mesh collides as its convex hull."""

    kind: str  #: one of :data:`SHAPES`
    size: tuple[float, ...] = ()  #: [m], see :data:`SHAPES`
    position: Vector = (0.0, 0.0, 0.0)  #: [m]
    quat_wxyz: Quat = (1.0, 0.0, 0.0, 0.0)
    file: str = ""  #: of a mesh: any format that trimesh reads
    rgba: tuple[float, ...] = _COLOUR

    def __post_init__(self) -> None:
        """Check the values: ``ValueError`` names the one that is wrong."""
        for name in ("size", "position", "quat_wxyz", "rgba"):
            object.__setattr__(self, name, tuple(map(float, np.atleast_1d(getattr(self, name)))))
        if self.kind not in SHAPES:
            raise ValueError(f"shape {self.kind!r}: expected one of {', '.join(SHAPES)}")
        if len(self.size) != SHAPES[self.kind] or not all(s > 0 for s in self.size):
            raise ValueError(
                f"{self.kind} size {self.size}: expected {SHAPES[self.kind]} numbers above 0 [m]"
            )
        if self.kind == "mesh" and not Path(self.file).is_file():
            raise ValueError(f"mesh {self.file!r}: no such file")


@dataclass(frozen=True)
class SceneObject:
    """Something of your own: shapes, or an MJCF fragment, and what it does.

    Contacts with the arm are as stiff as ``stiffness`` says, are labelled, and count against the
    limits like those with people. An object is a region of the environment, by its name.
    """

    name: str
    shapes: tuple[Shape, ...] = ()
    mjcf: str = (
        ""  #: text or file of an MJCF fragment instead of shapes; its bodies may have joints
    )
    position: Vector = (0.0, 0.0, 0.0)  #: in the world [m]; of a held one in the tool's frame
    quat_wxyz: Quat = (1.0, 0.0, 0.0, 0.0)
    motion: str = "fixed"  #: one of :data:`MOTIONS`
    path: tuple[tuple[float, ...], ...] = ()
    """Rows of time [s] and position [m], from 0 on; after the last row it begins anew. It replaces
    ``position``."""
    mass: float = 1.0  #: of a free or held one [kg]
    stiffness: float = 1e5  #: of its contact with the arm [N/m]
    damping: float = 100.0  #: of its contact with the arm [N s/m]
    quasi_static_limit: float | None = None  #: largest lasting force without a cost [N]
    transient_limit: float | None = None  #: largest force of an impact without a cost [N]

    def __post_init__(self) -> None:
        """Check the values: ``ValueError`` names the one that is wrong."""
        shapes = tuple(s if isinstance(s, Shape) else Shape(**s) for s in self.shapes)
        object.__setattr__(self, "shapes", shapes)
        for name in ("position", "quat_wxyz"):
            object.__setattr__(self, name, tuple(map(float, getattr(self, name))))
        path = tuple(tuple(map(float, row)) for row in self.path)
        object.__setattr__(self, "path", path)
        if not self.name.isidentifier():
            raise ValueError(f"object {self.name!r}: expected a name of letters, digits and _")
        if bool(shapes) == bool(self.mjcf):
            raise ValueError(f"object {self.name}: expected either shapes or mjcf")
        if self.motion not in MOTIONS:
            raise ValueError(
                f"object {self.name}: motion {self.motion!r}; expected one of {', '.join(MOTIONS)}"
            )
        above_zero(self, "mass", "stiffness")
        for name in ("quasi_static_limit", "transient_limit"):
            if getattr(self, name) is not None:
                above_zero(self, name)
        not_negative(self, "damping")
        if path:
            times = [row[0] for row in path]
            if self.motion != "fixed" or any(len(row) != 4 for row in path) or len(path) < 2:
                raise ValueError(
                    f"object {self.name}: path: expected motion 'fixed' and two or more rows of "
                    "time, x, y, z"
                )
            if times[0] != 0 or any(b <= a for a, b in itertools.pairwise(times)):
                raise ValueError(f"object {self.name}: path: expected times that grow from 0 on")
            object.__setattr__(self, "position", path[0][1:])

    @classmethod
    def from_spec(cls, name: str, spec: mujoco.MjSpec, **keywords: Any) -> SceneObject:
        """From a ``mujoco.MjSpec``; its keywords are those of the class."""
        spec.compile()
        return cls(name, mjcf=spec.to_xml(), **keywords)

    @property
    def moves(self) -> bool:
        """Whether it is elsewhere later."""
        return self.motion == "free" or bool(self.path)

    @property
    def touchable(self) -> bool:
        """Whether it is something that the arm can touch, not a part of the arm."""
        return self.motion != "held"


def load_objects(path: str | Path) -> tuple[SceneObject, ...]:
    """The objects of a TOML file, a table ``[[object]]`` each, with ``[[object.shapes]]``.

    Files that it names count from its own folder.

    Raises:
        ValueError: not TOML, or a key or value that an object cannot have.
        FileNotFoundError: no such file.
    """
    path = Path(path)
    with reading(path):
        rows = tomllib.loads(read_text(path)).get("object", [])
        if not rows:
            raise ValueError("no objects; expected tables [[object]]")
        return tuple(_from_mapping(row, path.parent) for row in rows)


def _from_mapping(row: Mapping[str, Any], folder: Path) -> SceneObject:
    values = dict(row)
    _check_keys(values, SceneObject)
    shapes = []
    for part in values.pop("shapes", ()):
        _check_keys(part, Shape)
        beside = folder / part["file"] if "file" in part else None
        shapes.append(Shape(**part | ({"file": str(beside)} if beside else {})))
    if "mjcf" in values and (folder / values["mjcf"]).is_file():
        values["mjcf"] = str(folder / values["mjcf"])
    return SceneObject(shapes=tuple(shapes), **values)


def _check_keys(found: Mapping[str, Any], kind: type[SceneObject] | type[Shape]) -> None:
    known = [field.name for field in fields(kind)]
    for key in found:
        if key not in known:
            raise ValueError(f"no key {key!r}; expected some of {', '.join(known)}")


def hold(
    spec: mujoco.MjSpec, link: mujoco.MjsBody, flange: mujoco.MjsSite, obj: SceneObject
) -> None:
    """Put a held object on the last link: its shapes are the link's, its mass a body's beside."""
    pose = np.zeros(3), np.zeros(4)
    mujoco.mju_mulPose(*pose, flange.pos, flange.quat, obj.position, obj.quat_wxyz)
    place, turn = pose
    carrier = link.add_body(name=obj.name, pos=place, quat=turn)
    carrier.explicitinertial, carrier.mass = True, obj.mass
    carrier.inertia = [obj.mass * 1e-3] * 3
    for geom in _fill(spec, carrier, obj):
        at, way = np.zeros(3), np.zeros(4)
        mujoco.mju_mulPose(at, way, place, turn, geom.pos, geom.quat)
        mesh, kind, size = geom.meshname, geom.type, geom.size.copy()
        rgba, name = geom.rgba.copy(), geom.name
        spec.delete(geom)
        moved = link.add_geom(name=name, type=kind, size=size, pos=at, quat=way, rgba=rgba, mass=0)
        if mesh:
            moved.meshname = mesh
        moved.contype, moved.conaffinity = 1, 2


def add_object(spec: mujoco.MjSpec, obj: SceneObject) -> list[mujoco.MjsGeom]:
    """Add an object that stands, moves or is free as the body of its name; returns its geoms."""
    body = spec.worldbody.add_body(
        name=obj.name, pos=obj.position, quat=obj.quat_wxyz, mocap=bool(obj.path)
    )
    if obj.motion == "free":
        body.add_freejoint()
    geoms = _fill(spec, body, obj)
    for geom in geoms:
        geom.contype = geom.conaffinity = OBJECT_BIT
        if obj.motion == "free":
            geom.mass = obj.mass / len(geoms)
    return geoms


def _fill(spec: mujoco.MjSpec, body: mujoco.MjsBody, obj: SceneObject) -> list[mujoco.MjsGeom]:
    """The geoms of an object on a body, named after it."""
    if obj.mjcf:
        text = obj.mjcf
        child = (
            mujoco.MjSpec.from_string(text)
            if text.lstrip().startswith("<")
            else mujoco.MjSpec.from_file(text)
        )
        spec.attach(child, frame=body.add_frame(), prefix=f"{obj.name}_")
    else:
        for k, shape in enumerate(obj.shapes):
            _add_shape(spec, body, shape, f"{obj.name}_{k}")
    geoms = [geom for part in _below(body) for geom in part.geoms]
    if not geoms:
        raise ValueError(f"object {obj.name}: no geoms; expected something that can be touched")
    for k, geom in enumerate(geoms):
        geom.name = f"{obj.name}_{k}"
    return geoms


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
