"""Frames with exact truth (Sample-Scalable-CCD-Data), in this package's numbering."""

import json
from typing import NamedTuple

import numpy as np

from tauguard.cloth.scenes import load_sequence
from tests.cloth.brute_force import edges_of

FILES = {"cloth-funnel": ("*", "227"), "cloth-ball": ("cloth_ball*", "92")}


class TruthScene(NamedTuple):
    faces: np.ndarray
    edges: np.ndarray
    x_t0: np.ndarray
    x_t1: np.ndarray
    hits: tuple[np.ndarray, np.ndarray]  # sorted (vertex, face) and (edge, edge)


def keys(pairs):
    """One number a row, in the order of the rows."""
    pairs = np.asarray(pairs, dtype=np.int64)
    return pairs[:, 0] << 32 | pairs[:, 1]


def load_scene(data_dir, name):
    folder = data_dir / "ccd" / name
    pattern, number = FILES[name]
    sequence = load_sequence(folder / "frames", pattern)
    ((x_t0, x_t1),) = sequence.steps()
    faces = sequence.faces
    edges = edges_of(faces)
    # Boxes: vertices, then edges ordered by (larger, smaller) vertex, then faces.
    theirs = np.lexsort((edges[:, 0], edges[:, 1]))
    vertices = len(x_t0)

    def listed(kind):
        boxes = np.array(json.loads((folder / "boxes" / f"{number}{kind}.json").read_text()))
        truth = json.loads((folder / "mma_bool" / f"{number}{kind}_mma_bool.json").read_text())
        return boxes[np.array(truth, dtype=bool)]

    vf = np.sort(listed("vf"), axis=1) - [0, vertices + len(edges)]
    ee = np.sort(theirs[listed("ee") - vertices], axis=1)
    order = [np.argsort(keys(pairs), kind="stable") for pairs in (vf, ee)]
    return TruthScene(faces, edges, x_t0, x_t1, (vf[order[0]], ee[order[1]]))
