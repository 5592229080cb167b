"""Read OBJ and PLY files as vertices and triangles, in the file's order, without guesses.

A line or a count that does not fit is refused, because skipping it would renumber all vertices
after it.
"""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tauguard.untrusted_input import reading

Points = NDArray[np.float64]
Faces = NDArray[np.int32]
#: Polygons of any length, or triangles, as read.
Polygons = list[list[int]] | NDArray[np.int64]

#: Largest size of a mesh file [bytes].
MOST_BYTES = 1 << 30
#: Lines of an OBJ file that do not concern positions and faces.
OTHER = (b"vn", b"vt", b"vp", b"l", b"p", b"o", b"g", b"s", b"mtllib", b"usemtl")
#: PLY's names of types, the old and the new ones.
TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
}
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


def load_mesh(path: str | Path) -> tuple[Points, Faces]:
    """Vertices, shape (V, 3), and triangles, shape (F, 3); polygons become triangle fans.

    Raises:
        ValueError: not such a file, cut off, damaged, or without triangles; one line.
        OSError: missing or unreadable.
    """
    path = Path(path)
    with reading(path, "expected a triangle mesh, OBJ or PLY"):
        if path.stat().st_size > MOST_BYTES:
            raise ValueError(f"more than {MOST_BYTES >> 20} MiB")
        data = path.read_bytes()
        vertices, faces = _obj(data) if path.suffix.lower() == ".obj" else _ply(data)
        return _checked(vertices, faces)


def _checked(vertices: Points, polygons: Polygons) -> tuple[Points, Faces]:
    if not np.isfinite(vertices).all():
        row = int(np.argwhere(~np.isfinite(vertices))[0][0])
        raise ValueError(f"vertex {row} is not finite")
    if not isinstance(polygons, np.ndarray):
        fans = [(p[0], a, b) for p in polygons for a, b in itertools.pairwise(p[1:])]
        polygons = np.array(fans, dtype=np.int64).reshape(-1, 3)
    faces: NDArray[np.int64] = polygons
    if len(faces) == 0:
        raise ValueError("has no triangles")
    beyond = np.flatnonzero(((faces < 0) | (faces >= len(vertices))).any(axis=1))
    if len(beyond):
        raise ValueError(
            f"triangle {beyond[0]} names a vertex beyond the {len(vertices)} there are"
        )
    return vertices, faces.astype(np.int32)


# -- OBJ --------------------------------------------------------------------------------------


def _obj(data: bytes) -> tuple[Points, list[list[int]]]:
    points: list[list[float]] = []
    polygons: list[list[int]] = []
    for number, line in enumerate(data.splitlines(), 1):
        first, *rest = line.partition(b"#")[0].split() or [b""]
        if first == b"v":
            if len(rest) not in (3, 4, 6, 7):  # with a weight, or with a colour
                raise ValueError(f"line {number}: a vertex of {len(rest)} numbers")
            points.append([float(x) for x in rest[:3]])
        elif first == b"f":
            if len(rest) < 3:
                raise ValueError(f"line {number}: a face of {len(rest)} vertices")
            polygons.append([_index(x, len(points), number) for x in rest])
        elif first and first not in OTHER:
            raise ValueError(f"line {number}: {first[:20]!r} is not a statement of OBJ")
    return np.array(points).reshape(-1, 3), polygons


def _index(text: bytes, count: int, line: int) -> int:
    """The vertex of ``3``, ``3/1`` or ``3/1/2``, from 0; negative ones count from the last."""
    value = int(text.split(b"/")[0])
    if value == 0:
        raise ValueError(f"line {line}: vertex 0, where counting begins at 1")
    return value - 1 if value > 0 else count + value


# -- PLY --------------------------------------------------------------------------------------


@dataclass
class _Element:
    """One table of a PLY file: columns are (name, type), or (name, type, type of the count)."""

    name: str
    count: int
    columns: list[tuple[str, ...]]


def _ply(data: bytes) -> tuple[Points, Polygons]:
    head, end, body = data.partition(b"end_header")
    newline = 2 if body[:2] == b"\r\n" else 1
    if not end or body[:newline] not in (b"\n", b"\r\n", b"\r"):
        raise ValueError("no PLY header")
    order, elements = _header(head.decode("ascii"))
    if order:
        return _binary(body[newline:], elements, order)
    return _ascii(body[newline:].split(b"\n"), elements)


def _header(text: str) -> tuple[str, list[_Element]]:
    lines = [line.split() for line in text.splitlines()]
    if not lines or lines[0] != ["ply"]:
        raise ValueError("its first line is not ply")
    form = next((line[1:] for line in lines if line[:1] == ["format"]), [])
    if len(form) != 2 or form[0] not in ORDERS or form[1] != "1.0":
        raise ValueError(f"format {' '.join(form)!r}: expected one of {', '.join(ORDERS)}, 1.0")
    elements: list[_Element] = []
    for line in lines[1:]:
        match line:
            case ["element", name, count] if int(count) >= 0:
                elements.append(_Element(name, int(count), []))
            case ["property", "list", number, kind, name] if elements:
                elements[-1].columns.append((name, TYPES[kind], TYPES[number]))
            case ["property", kind, name] if elements:
                elements[-1].columns.append((name, TYPES[kind]))
            case [] | ["comment" | "obj_info" | "format", *_]:
                pass
            case _:
                raise ValueError(f"in its header: {' '.join(line)!r}")
    names = [element.name for element in elements]
    if names[:2] != ["vertex", "face"] or len(elements[1].columns) == 0:
        raise ValueError(f"elements {', '.join(names)}: expected vertex and face first")
    if any(len(c) == 3 for c in elements[0].columns):
        raise ValueError("its vertices have a list property, which is not supported")
    if [c[0] for c in elements[0].columns[:3]] != ["x", "y", "z"]:
        raise ValueError("expected x, y, z as the first properties of its vertices")
    (name, *kinds), *more = elements[1].columns
    if name not in ("vertex_indices", "vertex_index") or len(kinds) != 2 or more:
        raise ValueError("expected vertex_indices as the only property of its faces")
    return ORDERS[form[0]], elements


def _ascii(lines: Sequence[bytes], elements: Sequence[_Element]) -> tuple[Points, Polygons]:
    rows = [line.split() for line in lines]
    while rows and not rows[-1]:
        rows.pop()
    wanted = sum(element.count for element in elements)
    if len(rows) != wanted:
        raise ValueError(f"{len(rows)} rows, its header says {wanted}")
    points, faces = rows[: elements[0].count], rows[elements[0].count :][: elements[1].count]
    width = len(elements[0].columns)
    for k, row in enumerate(points):
        if len(row) != width:
            raise ValueError(f"vertex {k}: {len(row)} numbers, expected {width}")
    for k, row in enumerate(faces):
        if len(row) < 4 or int(row[0]) != len(row) - 1:
            raise ValueError(f"face {k}: {len(row)} numbers; expected a count and as many vertices")
    values = np.array([[float(x) for x in row[:3]] for row in points]).reshape(-1, 3)
    return values, [[int(x) for x in row[1:]] for row in faces]


def _binary(data: bytes, elements: Sequence[_Element], order: str) -> tuple[Points, Polygons]:
    vertex, face, *rest = elements
    row = np.dtype([(name, order + kind) for name, kind in vertex.columns])
    if len(data) < vertex.count * row.itemsize:
        raise ValueError(f"cut off within its {vertex.count} vertices")
    table = np.frombuffer(data, row, vertex.count)
    points = np.stack([table[axis].astype(np.float64) for axis in "xyz"], axis=1)
    faces, left = _lists(data[vertex.count * row.itemsize :], face, order)
    if left and not rest:
        raise ValueError(f"{left} bytes after its last face")
    return points, faces


def _lists(data: bytes, face: _Element, order: str) -> tuple[Polygons, int]:
    """The polygons, and the number of bytes that follow them."""
    ((_, kind, number),) = face.columns
    triangle = np.dtype([("n", order + number), ("v", order + kind, 3)])
    whole = face.count * triangle.itemsize
    if len(data) >= whole:
        table = np.frombuffer(data, triangle, face.count)
        if (table["n"] == 3).all():
            return table["v"].astype(np.int64), len(data) - whole
    found: list[list[int]] = []
    count, index, at = np.dtype(order + number), np.dtype(order + kind), 0
    for k in range(face.count):
        head = np.frombuffer(data[at : at + count.itemsize], count)
        size = int(head[0]) if len(head) else 0
        at += count.itemsize
        body = data[at : at + size * index.itemsize] if size >= 3 else b""
        if size < 3 or len(body) != size * index.itemsize:
            raise ValueError(f"face {k}: cut off, or of fewer than 3 vertices")
        found.append(_integers(np.frombuffer(body, index)))
        at += len(body)
    return found, len(data) - at


def _integers(values: Iterable[int]) -> list[int]:
    return [int(value) for value in values]
