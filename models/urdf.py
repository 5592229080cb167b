"""Prepare a URDF for MuJoCo: read meshes of any format, mend impossible inertias.

trimesh reads STL, OBJ, Collada, PLY, glTF and others; MuJoCo reads its own MSH.
"""

import copy
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.findings import FileError
from tauguard.models.robot_check import checked_text

MOST_BYTES = 1 << 27  # largest size of a mesh file
MOST_FACES = 50_000  # number of triangles above which a mesh collides as its convex hull
#: A visual mesh is simplified on the finest of these grids (cells along its longest side) that
#: leaves at most this many triangles.
SHOWN_CELLS, SHOWN_FACES = (64, 45, 32, 24), 5000
#: Smallest thickness over length; thinner meshes become boxes, because MuJoCo needs a volume.
FLATTEST = 1e-3
#: Colour of a mesh without one.
GREY = (0.7, 0.72, 0.75, 1.0)
#: A namespace prefix of an element or attribute; xacro may leave undeclared ones.
_PREFIX = re.compile(r"(</?|\s)([A-Za-z_][\w.-]*):(?=[A-Za-z_][\w.-]*[\s=/>])")


@dataclass
class UrdfFile:
    """The content of a URDF beyond its MjSpec."""

    spec: Any = None  #: the MjSpec, with its meshes
    mended: tuple[str, ...] = ()  #: links whose inertia was corrected
    unread: dict[str, str] = field(default_factory=dict)  #: by link: omitted shape and reason


def is_urdf(path: Path) -> bool:
    """Whether a file is a URDF, by its extension or its first lines."""
    if path.suffix.lower() == ".urdf":
        return True
    with open(path, errors="replace") as stream:
        return "<robot" in stream.read(4000)


def xml_root(text: str) -> ElementTree.Element:
    """The root of a robot's XML; namespace prefixes become part of the names.

    Raises:
        FileError: not XML.
    """
    try:
        return ElementTree.fromstring(_PREFIX.sub(r"\1\2_", text))
    except ElementTree.ParseError as error:
        raise FileError(f"not well-formed XML ({error})") from None


def max_speeds(path: Path) -> dict[str, float]:
    """Speed limits of a URDF's joints [rad/s]; MJCF has none."""
    if not is_urdf(path):
        return {}
    found = {}
    for joint in xml_root(path.read_text(errors="replace")).findall("joint"):
        limit = joint.find("limit")
        speed = float(limit.get("velocity", 0)) if limit is not None else 0.0
        if speed > 0:
            found[str(joint.get("name"))] = speed
    return found


Mesh = tuple[Array, NDArray[np.int64]]


def read_urdf(path: Path) -> UrdfFile:
    """The spec of a URDF, with every mesh that exists and can be read.

    Raises:
        FileError: not a robot that MuJoCo can read.
    """
    root = xml_root(path.read_text(errors="replace"))
    found, meshes = UrdfFile(mended=mend_inertias(root)), dict[str, Mesh]()
    for old in root.findall("mujoco"):
        root.remove(old)
    extension = ElementTree.SubElement(root, "mujoco")
    options = {"strippath": "false", "fusestatic": "false", "discardvisual": "false"}
    ElementTree.SubElement(extension, "compiler", options)
    checked_text(ElementTree.tostring(_without_meshes(root), encoding="unicode"))
    for link in root.findall("link"):
        for shape in _mesh_shapes(link):
            mesh = shape.find("geometry/mesh")
            assert mesh is not None
            file = Path(mesh.get("filename", "").removeprefix("file://").split("://", 1)[-1])
            key = f"{shape.tag}{len(meshes)}_{file.stem}.stl"
            try:
                meshes[key] = _read(path, file, shape)
            except ValueError as error:
                link.remove(shape)
                found.unread.setdefault(str(link.get("name")), f"{file.name} {error}")
            mesh.set("filename", key)
    found.spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    for mesh in found.spec.meshes:
        vertices, faces = meshes[mesh.file]
        if mesh.file.startswith("visual"):
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        turned = faces[:, ::-1] if np.prod(mesh.scale) < 0 else faces
        mesh.uservert = (vertices * mesh.scale).ravel().tolist()
        mesh.userface = turned.ravel().tolist()
        mesh.file, mesh.scale = "", [1, 1, 1]
    return found


def _mesh_shapes(link: ElementTree.Element) -> list[ElementTree.Element]:
    shapes = [*link.findall("visual"), *link.findall("collision")]
    return [shape for shape in shapes if shape.find("geometry/mesh") is not None]


def _without_meshes(root: ElementTree.Element) -> ElementTree.Element:
    bare = copy.deepcopy(root)
    for link in bare.findall("link"):
        for shape in _mesh_shapes(link):
            link.remove(shape)
    return bare


def _read(urdf: Path, name: Path, shape: ElementTree.Element) -> Mesh:
    """The mesh of a shape; a visual one is simplified, and gives its colour to the shape.

    Raises:
        FileError: the file cannot be used; the message leaves out its name.
    """
    source = _find(urdf, name)
    if source is None:
        raise FileError("is not there")
    vertices, faces, colour = load_mesh(source)
    if shape.tag == "visual":
        vertices, faces = coarse(vertices, faces)
        if shape.find("material") is None:
            material = ElementTree.SubElement(shape, "material", {"name": ""})
            rgba = " ".join(f"{c:.3f}" for c in colour)
            ElementTree.SubElement(material, "color", {"rgba": rgba})
    thin = np.ptp(vertices, axis=0)
    if thin.min() < FLATTEST * thin.max() or (shape.tag != "visual" and len(faces) > MOST_FACES):
        return _hull(vertices)
    return vertices, faces


def _find(urdf: Path, inside: Path) -> Path | None:
    """Find a mesh file by its path in a package, from the URDF's folder upwards."""
    tails = [inside, Path(*inside.parts[1:]), Path(inside.name)]
    for folder in urdf.resolve().parents:
        for tail in tails[: 2 if folder != urdf.resolve().parent else 3]:
            if (folder / tail).is_file():
                return folder / tail
    return None


def load_mesh(source: Path) -> tuple[Array, NDArray[np.int64], Array]:
    """Vertices [m], shape (V, 3), triangles, shape (F, 3), and colour, shape (4,), of a file.

    Raises:
        FileError: it cannot be read, or has no triangles; the message leaves out its name.
    """
    if source.stat().st_size > MOST_BYTES:
        raise FileError(f"is larger than {MOST_BYTES >> 20} MB")
    try:
        read = _load_msh if source.suffix.lower() == ".msh" else _load_any
        vertices, faces, colour = read(source)
    except Exception as error:  # readers of meshes raise exceptions of many types
        raise FileError(f"cannot be read ({' '.join(str(error).split())[:80]})") from None
    if len(faces) == 0 or not np.isfinite(vertices).all():
        raise FileError("has no triangles, or vertices that are not finite")
    return vertices, faces, colour


def _load_any(source: Path) -> tuple[Array, NDArray[np.int64], Array]:
    import trimesh

    scene = trimesh.load_scene(source)
    mesh = scene.to_mesh()
    units = re.match(r"([\d.eE+-]+) \* meters", scene.units or "")  # as Collada states them
    vertices = np.asarray(mesh.vertices, dtype=np.float64) * (float(units[1]) if units else 1.0)
    visual = mesh.visual.to_color() if hasattr(mesh.visual, "to_color") else mesh.visual
    colour = np.asarray(visual.main_color, dtype=float) / 255
    if colour.shape != (4,) or not mesh.visual.defined:
        colour = np.array(GREY)
    return vertices, np.asarray(mesh.faces, dtype=np.int64), colour


def _load_msh(source: Path) -> tuple[Array, NDArray[np.int64], Array]:
    numbers = np.fromfile(source, dtype="<i4", count=4)
    vertices, normals, texture, faces = numbers.tolist()
    floats = np.fromfile(source, dtype="<f4", offset=16, count=3 * vertices)
    first = 16 + 4 * (3 * vertices + 3 * normals + 2 * texture)
    rows = np.fromfile(source, dtype="<i4", offset=first, count=3 * faces)
    return floats.reshape(-1, 3).astype(float), rows.reshape(-1, 3).astype(np.int64), np.array(GREY)


def coarse(vertices: Array, faces: NDArray[np.int64]) -> Mesh:
    """Simplify a visual mesh: vertices in one grid cell are merged, see :data:`SHOWN_CELLS`.

    Args:
        vertices: [m], shape (V, 3).
        faces: shape (F, 3).
    """
    low, size = vertices.min(axis=0), float(np.ptp(vertices, axis=0).max())
    points, drawn = vertices, faces
    for cells in SHOWN_CELLS if size > 0 else ():
        if len(drawn) <= SHOWN_FACES:
            break
        grid = np.floor((vertices - low) * (cells / size)).astype(np.int64)
        _, first, group = np.unique(grid, axis=0, return_index=True, return_inverse=True)
        points, drawn = vertices[first], group.reshape(-1)[faces]
        drawn = drawn[(drawn != np.roll(drawn, 1, axis=1)).all(axis=1)]
        _, one = np.unique(np.sort(drawn, axis=1), axis=0, return_index=True)
        drawn = drawn[np.sort(one)]
    return points, drawn


def _hull(vertices: Array) -> Mesh:
    """The convex hull, at least :data:`FLATTEST` of its length thick.

    Raises:
        FileError: the points do not span a body.
    """
    from scipy.spatial import ConvexHull, QhullError

    low, high = vertices.min(axis=0), vertices.max(axis=0)
    least = FLATTEST * float((high - low).max())
    if (high - low < least).any():  # a sheet is replaced by its bounding box
        low, high = np.minimum(low, high - least), np.maximum(high, low + least)
        vertices = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)
    try:
        hull = ConvexHull(vertices)
    except QhullError:
        raise FileError("spans no body") from None
    used, faces = np.unique(hull.simplices, return_inverse=True)
    faces = faces.reshape(-1, 3)
    points = vertices[used]
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a - points.mean(axis=0)) < 0
    faces[inward] = faces[inward][:, ::-1]
    return points, faces.astype(np.int64)


#: Smallest principal moment over the largest one, in a corrected inertia.
LEAST_MOMENT = 0.01
#: Smallest corrected moment [kg m^2] (MuJoCo takes those below 1e-14 for 0). Links without inertia
#: and below this mass [kg] are not corrected.
SMALLEST, LIGHTEST = 1e-12, 1e-5
#: A body with a mass but no inertia becomes a ball of this density [kg/m^3].
DENSITY = 1000.0
_ENTRIES = {
    "ixx": (0, 0),
    "iyy": (1, 1),
    "izz": (2, 2),
    "ixy": (0, 1),
    "ixz": (0, 2),
    "iyz": (1, 2),
}


def mend_inertias(root: ElementTree.Element) -> tuple[str, ...]:
    """Correct the impossible inertias of a URDF in place; returns the names of their links.

    Moments at or below 0 are raised, and the largest is cut to the sum of the others. Missing
    moments become those of a ball.

    Raises:
        FileError: a mass or moment that is no number.
    """
    mended = []
    for link in root.findall("link"):
        inertia = link.find("inertial/inertia")
        mass = link.find("inertial/mass")
        if inertia is None or mass is None:
            continue
        name = str(link.get("name"))
        size = _number(mass, "value", name)
        tensor = np.zeros((3, 3))
        for key, (i, j) in _ENTRIES.items():
            tensor[i, j] = tensor[j, i] = _number(inertia, key, name)
        if (tensor.any() or size > LIGHTEST) and not _possible(tensor):
            found = possible_inertia(tensor, size)
            for key, (i, j) in _ENTRIES.items():
                inertia.set(key, repr(float(found[i, j])))
            mended.append(name)
    return tuple(mended)


def possible_inertia(tensor: Array, mass: float) -> Array:
    """A physically possible inertia near ``tensor`` [kg m^2], shape (3, 3)."""
    moments, axes = np.linalg.eigh(tensor)
    if moments[2] <= 0:
        # A mass below 0 gets no ball; MuJoCo then reports its link.
        ball = (3 * max(mass, 0.0) / (4 * np.pi * DENSITY)) ** (1 / 3)
        return np.diag(np.full(3, 0.4 * mass * ball**2))
    moments = np.maximum(moments, max(LEAST_MOMENT * moments[2], SMALLEST))
    moments[2] = min(moments[2], 0.999 * (moments[0] + moments[1]))
    mended: Array = axes @ np.diag(np.sort(moments)) @ axes.T
    return np.asarray((mended + mended.T) / 2)


def _possible(tensor: Array) -> bool:
    moments = np.linalg.eigvalsh(tensor)
    return bool(moments[0] > 0 and moments[2] <= moments[0] + moments[1])


def _number(element: ElementTree.Element, key: str, link: str) -> float:
    text = element.get(key, "0")
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise FileError(f"link {link!r}: {element.tag} {key} {text!r}: expected a number")
    return value
