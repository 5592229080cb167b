"""Which collisions are listed with recorded frames and public queries? Decided by their authors.

Sample-Scalable-CCD-Data (Belgrod et al. 2023) lists the collisions of whole frames, and
Sample-Queries (Wang et al. 2021) labels single queries; both used exact arithmetic. The files lie
in the folder ``ccd`` of the data (docs/notes/cloth.md names their origin).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh
from numpy.typing import NDArray

from oracles.all_pairs import edges_of

#: By recorded frame: pattern of its two files, and the number of its lists.
FRAMES = {"cloth-funnel": ("*", "227"), "cloth-ball": ("cloth_ball*", "92")}
#: The labelled sets of single queries.
QUERY_SETS = (
    "unit-tests",
    "erleben-cube-cliff-edges",
    "erleben-sliding-spike",
    "erleben-spike-hole",
    "erleben-spike-wedge",
    "erleben-wedges",
)
#: The kinds of each set.
KINDS = ("vertex-face", "edge-edge")


class RecordedFrame(NamedTuple):
    """One step of a mesh and its collisions, numbered as in ``tauguard.cloth``."""

    faces: NDArray[np.int32]  #: shape (F, 3)
    edges: NDArray[np.int64]  #: shape (E, 2)
    x_t0: NDArray[np.float64]  #: shape (V, 3) [m]
    x_t1: NDArray[np.float64]  #: shape (V, 3) [m]
    hits: tuple[NDArray[np.int64], NDArray[np.int64]]  #: sorted (vertex, face) and (edge, edge)


def keys(pairs: object) -> NDArray[np.int64]:
    """One number for each row of pairs (N, 2), in the same order as the rows."""
    pairs = np.asarray(pairs, dtype=np.int64)
    return np.asarray(pairs[:, 0] << 32 | pairs[:, 1])


def load_frame(data: Path, name: str) -> RecordedFrame:
    """The frame ``name`` of :data:`FRAMES` in the folder ``data``."""
    folder = data / "ccd" / name
    pattern, number = FRAMES[name]
    files = sorted((folder / "frames").glob(f"{pattern}.ply"))
    # Without processing trimesh keeps the file's vertices and their order.
    first, last = (trimesh.load_mesh(file, process=False) for file in files)
    assert np.array_equal(first.faces, last.faces)
    faces = np.asarray(first.faces, dtype=np.int32)
    x_t0, x_t1 = (np.array(mesh.vertices, dtype=np.float64) for mesh in (first, last))
    edges = edges_of(faces)
    # Boxes are numbered vertices first, then edges ordered by (larger, smaller) vertex, then faces.
    theirs = np.lexsort((edges[:, 0], edges[:, 1]))

    def listed(kind: str) -> NDArray[np.int64]:
        boxes = json.loads((folder / "boxes" / f"{number}{kind}.json").read_text())
        hit = json.loads((folder / "mma_bool" / f"{number}{kind}_mma_bool.json").read_text())
        chosen: NDArray[np.int64] = np.array(boxes, dtype=np.int64)[np.array(hit, dtype=bool)]
        return chosen

    vf = np.sort(listed("vf"), axis=1) - np.array([0, len(x_t0) + len(edges)], dtype=np.int64)
    ee = np.sort(theirs[listed("ee") - len(x_t0)], axis=1).astype(np.int64)
    order = [np.argsort(keys(pairs), kind="stable") for pairs in (vf, ee)]
    return RecordedFrame(faces, edges, x_t0, x_t1, (vf[order[0]], ee[order[1]]))


def load_queries(folder: Path) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Positions (N, 2, 4, 3) at both ends of the step, and labels (N,), of one kind of a set.

    Every rational in the files is exactly a double.
    """
    x: list[list[float]] = []
    hit: list[bool] = []
    for file in sorted(folder.glob("*.csv")):
        rows = [[int(cell) for cell in line.split(",")] for line in file.read_text().split()]
        x += [[row[2 * k] / row[2 * k + 1] for k in range(3)] for row in rows]
        hit += [bool(row[6]) for row in rows[::8]]
    return np.array(x).reshape(-1, 2, 4, 3), np.array(hit)
