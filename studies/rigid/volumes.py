"""Bounding volumes compared: build, update, overlap test and tightness (figure 1.1).

The bodies are pieces of the mesh, about 64 triangles each, as the nodes of a tree hold them, thrown
together near the origin under random poses. A ball and an oriented box are moved by a pose; bounds
along fixed directions (axis-aligned box, 18-DOP) are taken anew over the posed corners; a hull's
vertices are posed. Tightness is the volume over the hull's, and what that costs: of the pairs whose
hulls are apart, the share that the volumes cannot tell apart. All but the hull's build (Qhull) and
update (NumPy) are native, one thread.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError
from scipy.spatial.transform import Rotation

from studies.framework import time_in_turn
from studies.rigid.mesh import Mesh, load, scaled
from tauguard.arrays import Array
from tauguard.report import Row, rate
from tauguard.rigid import Hulls, _rigid_mesh
from tauguard.rigid.queries import native_overlap

NATIVE: dict[str, Any] = {
    "sphere": _rigid_mesh.BallVolumes,
    "aabb": _rigid_mesh.AabbVolumes,
    "obb": _rigid_mesh.ObbVolumes,
    "k_dop": _rigid_mesh.KDopVolumes,
}
#: The 18-DOP's directions, one of each pair.
DIRECTIONS = np.array(
    [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, -1, 0], [1, 0, 1], [1, 0, -1], [0, 1, 1],
     [0, 1, -1]], dtype=np.float64,
)  # fmt: skip


@dataclass(frozen=True)
class Pieces:
    """Bodies as runs of triangles.

    Attributes:
        corners: Shape (T, 3, 3), m; every body's about its own mean.
        offsets: Body i is ``corners[offsets[i]:offsets[i + 1]]``. Shape (B + 1,).
    """

    corners: Array
    offsets: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def points(self, i: int) -> Array:
        """The corners of one body. Shape (K, 3)."""
        return self.corners[self.offsets[i] : self.offsets[i + 1]].reshape(-1, 3)


def run(quick: bool, seed: int) -> list[Row]:
    """A row a volume."""
    rng = np.random.default_rng(seed)
    bodies = pieces(load(quick), 64)
    poses = near(bodies, rng)
    pairs = rng.integers(0, len(bodies), (5_000 if quick else 50_000, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    repeats = 3 if quick else 7
    hulls = Hull(bodies)
    rows = [hull_row(hulls, poses, pairs, repeats)]
    hit = hulls.meet(poses, pairs)
    for name, kind in NATIVE.items():
        volume = kind(bodies.corners, bodies.offsets)
        rows.append(volume_row(name, volume, bodies, hulls, poses, pairs, hit, repeats))
    return rows[1:] + rows[:1]


def pieces(mesh: Mesh, size: int) -> Pieces:
    """The triangles split at the median of the longest axis until at most ``size`` are left."""
    corners = mesh.vertices[mesh.faces]
    middle = corners.mean(axis=1)
    done: list[NDArray[np.intp]] = []
    left = [np.arange(len(corners))]
    while left:
        part = left.pop()
        if len(part) <= size:
            done.append(part)
            continue
        axis = np.ptp(middle[part], axis=0).argmax()
        order = part[np.argsort(middle[part, axis], kind="stable")]
        left += [order[: len(order) // 2], order[len(order) // 2 :]]
    centred = [corners[part] - corners[part].mean(axis=(0, 1)) for part in done]
    offsets = np.concatenate([[0], np.cumsum([len(part) for part in done])]).astype(np.int64)
    return Pieces(np.concatenate(centred), offsets)


def near(bodies: Pieces, rng: np.random.Generator) -> Array:
    """Any turn, places spread by half of the bodies' radius. Shape (B, 4, 4)."""
    n = len(bodies)
    radius = np.median([np.linalg.norm(bodies.points(i), axis=1).max() for i in range(n)])
    pose = np.tile(np.eye(4), (n, 1, 1))
    seed = int(rng.integers(1 << 31))
    pose[:, :3, :3] = Rotation.random(n, random_state=seed).as_matrix()
    pose[:, :3, 3] = rng.normal(0, 0.5 * radius, (n, 3))
    return pose


class Hull:
    """The convex hulls of the bodies: their vertices, volumes and overlap."""

    def __init__(self, bodies: Pieces) -> None:
        """Build them all."""
        self.bodies = bodies
        self.volume = np.zeros(len(bodies))
        self.build()

    def build(self) -> None:
        """Qhull on every body; a flat one keeps all its corners and has no volume."""
        kept = []
        for i in range(len(self.bodies)):
            points = self.bodies.points(i)
            try:
                hull = ConvexHull(points)
                kept.append(points[hull.vertices])
                self.volume[i] = hull.volume
            except QhullError:
                kept.append(points)
        self.counts = np.array([len(points) for points in kept])
        self.vertices = np.concatenate(kept)

    def place(self, poses: Array) -> Array:
        """The vertices in the world. Shape (V, 3)."""
        rotation = np.repeat(poses[:, :3, :3], self.counts, axis=0)
        moved = np.einsum("nij,nj->ni", rotation, self.vertices)
        return np.asarray(moved + np.repeat(poses[:, :3, 3], self.counts, axis=0))

    def sides(self, poses: Array, pairs: NDArray[np.int64]) -> tuple[Hulls, Hulls]:
        """Both columns of the pairs as batches."""
        placed = np.split(self.place(poses), np.cumsum(self.counts)[:-1])

        def side(column: NDArray[np.int64]) -> Hulls:
            offsets = np.concatenate([[0], np.cumsum(self.counts[column])])
            return Hulls(np.concatenate([placed[i] for i in column]), offsets)

        return side(pairs[:, 0]), side(pairs[:, 1])

    def meet(self, poses: Array, pairs: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which pairs share a point, exactly."""
        return native_overlap(*self.sides(poses, pairs), "auto")[0]


def hull_row(hulls: Hull, poses: Array, pairs: NDArray[np.int64], repeats: int) -> Row:
    """The hull itself: the tightest convex volume."""
    a, b = hulls.sides(poses, pairs)
    times = time_in_turn(
        {
            "build": hulls.build,
            "update": partial(hulls.place, poses),
            "test": partial(native_overlap, a, b, "auto"),
        },
        min(repeats, 3),
        process_time,
    )
    hit = hulls.meet(poses, pairs)
    return {
        **columns("hull", hulls.bodies, pairs, times),
        "tightness": 1.0,
        "false_hits": rate(0, int((~hit).sum())),
        "missed": rate(0, int(hit.sum())),
    }


def columns(name: str, bodies: Pieces, pairs: Any, times: dict[str, dict[str, float]]) -> Row:
    """What every row begins with."""
    return {
        "study": "figure 1.1 volumes",
        "volume": name,
        "bodies": len(bodies),
        "triangles_each": len(bodies.corners) / len(bodies),
        "pairs": len(pairs),
        "build_us": scaled(times["build"], 1e6 / len(bodies)),
        "update_us": scaled(times["update"], 1e6 / len(bodies)),
        "test_ns": scaled(times["test"], 1e9 / len(pairs)),
    }


def volume_row(
    name: str,
    volume: Any,
    bodies: Pieces,
    hulls: Hull,
    poses: Array,
    pairs: NDArray[np.int64],
    hit: NDArray[np.bool_],
    repeats: int,
) -> Row:
    """Times and tightness of one volume; a pair of hulls that meet must never be called clear."""
    numbers = np.empty((len(bodies), volume.numbers))
    volume.fit()
    volume.write(numbers)
    solid = np.flatnonzero(hulls.volume > 0)[:: max(1, len(bodies) // 200)]
    ratio = [size(name, numbers[i]) / hulls.volume[i] for i in solid]
    found = np.empty(len(pairs), dtype=np.bool_)
    times = time_in_turn(
        {
            "build": volume.fit,
            "update": partial(volume.place, poses),
            "test": partial(volume.meet, pairs, found),
        },
        repeats,
        process_time,
    )
    volume.place(poses)
    volume.meet(pairs, found)
    return {
        **columns(name, bodies, pairs, times),
        "tightness": float(np.median(ratio)),
        "false_hits": rate(int((found & ~hit).sum()), int((~hit).sum())),
        "missed": rate(int((~found & hit).sum()), int(hit.sum())),
    }


def size(name: str, numbers: Array) -> float:
    """The volume that a volume's numbers enclose [m^3]."""
    if name == "sphere":
        return float(4 / 3 * np.pi * numbers[3] ** 3)
    if name == "aabb":
        return float(np.prod(numbers[3:] - numbers[:3]))
    if name == "obb":
        return float(8 * np.prod(numbers[3:6]))
    lo, hi = numbers[:9], numbers[9:]
    planes = np.concatenate([np.c_[DIRECTIONS, -hi], np.c_[-DIRECTIONS, lo]])
    corners = HalfspaceIntersection(planes, np.zeros(3)).intersections  # the body's mean is inside
    return float(ConvexHull(corners).volume)


def draw(rows: list[Row], axes: Any) -> None:
    """What cannot be told apart over the cost of a test."""
    for row in (row for row in rows if row["study"] == "figure 1.1 volumes"):
        ns, update = row["test_ns"]["median"], row["update_us"]["median"]
        label = f"{row['volume']}: x{row['tightness']:.2g}, {update:.2g} us"
        axes.plot(ns, row["false_hits"]["value"], "o", label=label)
    axes.set(xlabel="ns a test", ylabel="hulls apart, volumes not", xscale="log")
    axes.set_title("volumes: size over hull's, update", fontsize="medium")
    axes.legend(fontsize="x-small")
