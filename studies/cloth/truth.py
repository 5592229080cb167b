"""Whole frames against the collisions listed with them, decided by others' exact arithmetic."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studies.cloth.frames import compare, lateness
from tauguard.cloth.comparators import METHODS
from tauguard.cloth.comparators import ComparedMeshCCD as MeshCCD
from tauguard.cloth.scenes import load_sequence
from tauguard.report import Row

#: Frames and number of the lists of each scene (Sample-Scalable-CCD-Data, Belgrod et al. 2023).
SCENES = {"cloth-funnel": ("*", "227"), "cloth-ball": ("cloth_ball*", "92")}


def on_listed_frames(folder: Path) -> list[Row]:
    """What each method misses and adds; "exact" where that takes seconds, not minutes."""
    rows: list[Row] = []
    for name, (pattern, number) in SCENES.items():
        sequence = load_sequence(folder / name / "frames", pattern)
        step = next(sequence.steps())
        edges = MeshCCD(sequence.faces).edges
        vf, ee = listed(folder / name, number, edges, len(step[0]))
        ours = MeshCCD(sequence.faces).find(*step)
        for method in METHODS:
            ccd = MeshCCD(sequence.faces, method)
            if method == "exact" and len(ccd.faces) > 50_000:
                continue
            frame = ccd.find(*step)
            by_kind = compare(vf, frame.vf), compare(ee, frame.ee)
            rows.append(
                {
                    "study": "truth",
                    "scene": name,
                    "method": method,
                    "candidates": frame.stats.vf["candidates"] + frame.stats.ee["candidates"],
                    "listed_vf": len(vf),
                    "listed_ee": len(ee),
                    "misses": by_kind[0][0] + by_kind[1][0],
                    "false_hits": by_kind[0][1] + by_kind[1][1],
                    **lateness(ours, frame),
                }
            )
    return rows


def listed(
    folder: Path, number: str, edges: NDArray[np.int32], vertices: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Listed collisions as sorted (vertex, face) and (edge, edge), edges as rows of ``edges``."""

    def hits(kind: str) -> NDArray[np.int64]:
        boxes = json.loads((folder / "boxes" / f"{number}{kind}.json").read_text())
        truth = json.loads((folder / "mma_bool" / f"{number}{kind}_mma_bool.json").read_text())
        chosen: NDArray[np.int64] = np.array(boxes, dtype=np.int64)[np.array(truth, dtype=bool)]
        return chosen

    # Boxes are numbered vertices first, then edges ordered by (larger, smaller) vertex, then faces.
    theirs = np.lexsort((edges[:, 0], edges[:, 1]))
    vf = np.sort(hits("vf"), axis=1) - np.array([0, vertices + len(edges)], dtype=np.int64)
    ee = np.sort(theirs[hits("ee") - vertices], axis=1)
    return (_in_order(vf), _in_order(ee))


def _in_order(pairs: NDArray[np.int64]) -> NDArray[np.int32]:
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].astype(np.int32)
