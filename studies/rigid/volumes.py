"""Comparison of bounding volumes: build, update, overlap test and tightness (figure 1.1).

The bodies are pieces of a mesh, of about 64 triangles each, in random poses near the origin. For
a new pose a ball and an oriented box are moved. An axis-aligned box and an 18-DOP are computed
again.
"""

from functools import partial
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from oracles.hull_volumes import HullVolumes, enclosed
from oracles.surfaces import pieces
from studies.framework import per, time_in_turn
from studies.rigid.bars import count, error
from studies.rigid.mesh import load
from tauguard.report import Row, rate
from tauguard.rigid.comparators import VOLUMES
from tauguard.rigid.queries import native_overlap

NOTES = {
    "figure 1.1 volumes": "us to build and to update a body's volume, ns to test a pair. "
    "tightness: volume over that of the hull, median; false_hits: fraction of pairs with "
    "separate hulls whose volumes overlap; missed: fraction of pairs with overlapping hulls "
    "whose volumes are apart.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """Return a row for each volume, the hull last."""
    rng = np.random.default_rng(seed)
    mesh = load(quick)
    corners, offsets = pieces(mesh.vertices[mesh.faces], 64)
    n = len(offsets) - 1
    pose = np.tile(np.eye(4), (n, 1, 1))
    pose[:, :3, :3] = Rotation.random(n, random_state=int(rng.integers(1 << 31))).as_matrix()
    radius = np.linalg.norm(corners, axis=2).max(axis=1)
    pose[:, :3, 3] = rng.normal(0, 0.5 * np.median(radius), (n, 3))
    pairs = rng.integers(0, n, (5_000 if quick else 50_000, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    hulls = HullVolumes(corners, offsets)
    sides = hulls.sides(pose, pairs)
    hit, size = native_overlap(*sides, "auto")[0], hulls.size.copy()
    rows = []
    for name, kind in VOLUMES.items():
        volume, found = kind(corners, offsets), np.empty(len(pairs), dtype=np.bool_)
        numbers = np.empty((n, volume.numbers))
        volume.fit()
        volume.write(numbers)
        calls = (volume.fit, partial(volume.place, pose), partial(volume.meet, pairs, found))
        times = columns(name, calls, n, len(pairs), 3 if quick else 7)
        solid = np.flatnonzero(size > 0)[:: max(1, n // 200)]
        ratios = [enclosed(name, numbers[i]) / size[i] for i in solid]
        volume.place(pose)
        volume.meet(pairs, found)
        rows.append({**times, "tightness": float(np.median(ratios)), **errors(found, hit)})
    calls = (hulls.fit, partial(hulls.place, pose), partial(native_overlap, *sides, "auto"))
    hull = columns("hull", calls, n, len(pairs), 3)
    rows.append({**hull, "tightness": 1.0, **errors(hit, hit)})
    missed = [count(row["missed"]) for row in rows]
    return [*rows, error("pairs of hulls that meet, reported as apart", 0, missed)]


def columns(name: str, calls: Any, bodies: int, pairs: int, repeats: int) -> Row:
    """Times of build, update and test."""
    named = dict(zip(("build", "update", "test"), calls, strict=True))
    times = time_in_turn(named, repeats, process_time)
    return {
        "study": "figure 1.1 volumes",
        "volume": name,
        "bodies": bodies,
        "pairs": pairs,
        "build_us": per(times["build"], bodies, 1e6),
        "update_us": per(times["update"], bodies, 1e6),
        "test_ns": per(times["test"], pairs),
    }


def errors(found: NDArray[np.bool_], hit: NDArray[np.bool_]) -> Row:
    """Rates of overlapping volumes among pairs of hulls apart, and of missed pairs of hulls."""
    return {
        "false_hits": rate(int((found & ~hit).sum()), int((~hit).sum())),
        "missed": rate(int((~found & hit).sum()), int(hit.sum())),
    }
