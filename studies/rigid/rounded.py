"""Bodies with radii, at rest and in motion: times beside coal's, errors beside both.

The truth of an overlap is rational arithmetic where it is quick enough (points, segments,
tetrahedra). What coal says beyond its own tolerance of 1e-6 of the extent is compared as well.
"""

from __future__ import annotations

import time
from functools import partial
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from oracles.convex_distance import exact_distance, exactly_meet, extent
from oracles.convex_overlap import exact_vertices
from studies.framework import time_in_turn
from studies.rigid.coal_motion import coal_shapes, in_motion
from studies.rigid.convex import nanoseconds
from studies.rigid.gap import worst
from tauguard.arrays import Array
from tauguard.report import Row, rate
from tauguard.rigid import (
    Boxes,
    Capsules,
    Motion,
    Rounded,
    Spheres,
    Tetrahedra,
    coal_peer,
    distance,
    overlap,
    time_of_impact,
)
from tauguard.rigid.rounded import Solid, parts

PAIRS = (
    ("spheres", "spheres"),
    ("capsules", "capsules"),
    ("capsules", "tetrahedra"),
    ("rounded boxes", "capsules"),
    ("rounded boxes", "rounded boxes"),
)


def bodies(rng: np.random.Generator, kind: str, n: int, reach: float, size: float) -> Solid:
    """N random bodies of about ``size`` [m], each coordinate of a centre within ``reach``."""
    centre = rng.uniform(-reach, reach, (n, 3))
    radius = rng.uniform(0.05, 0.4, n) * size
    if kind == "spheres":
        return Spheres(centre, radius)
    if kind == "capsules":
        way = rng.normal(size=(n, 3)) * 0.4 * size
        return Capsules(centre - way, centre + way, radius)
    if kind == "tetrahedra":
        return Tetrahedra(centre[:, None] + rng.uniform(-1, 1, (n, 4, 3)) * size)
    turn = Rotation.random(n, random_state=int(rng.integers(1 << 31))).as_matrix()
    boxes = Boxes(centre, rng.uniform(0.1, 0.7, (n, 3)) * size, turn)
    return boxes if kind == "boxes" else Rounded(boxes, 0.5 * radius)


def run(quick: bool, seed: int) -> list[Row]:
    """Static pairs and pairs in motion."""
    rng = np.random.default_rng(seed)
    n = 1_000 if quick else 20_000
    rows = [static_row(rng, pair, n, 5 if quick else 200) for pair in PAIRS]
    return rows + [moving_row(rng, pair, 20 if quick else 1_000) for pair in PAIRS]


def static_row(rng: np.random.Generator, kinds: tuple[str, str], n: int, known: int) -> Row:
    """Overlap and distance of one kind of pair; boxes take seconds each: a hundredth is known."""
    a, b = (bodies(rng, kind, n, 0.8, 1.0) for kind in kinds)
    hit, gap = overlap(a, b).hit, distance(a, b).distance
    spent = time_in_turn(
        {"overlap": partial(overlap, a, b), "distance": partial(distance, a, b)},
        3,
        time.process_time,
    )
    decided = range(known // 100 if any("boxes" in kind for kind in kinds) else known)
    truth = np.array([exact_distance(a, b, i) for i in decided])
    size = np.array([extent(a, b, i) for i in decided])
    return {
        "study": "rounded",
        "pair": "-".join(kinds),
        "pairs": n,
        "hits": int(hit.sum()),
        "overlap_ns": nanoseconds(spent["overlap"], n),
        "distance_ns": nanoseconds(spent["distance"], n),
        "known": len(truth),
        "wrong": sum(exactly_meet(a, b, i) != bool(hit[i]) for i in decided),
        "signs_differ": int(((gap <= 0) != hit).sum()),
        "error": worst(gap, truth, size),
        **_coal_static(a, b, hit, gap, truth, size),
    }


def _coal_static(
    a: Solid, b: Solid, hit: NDArray[np.bool_], gap: Array, truth: Array, size: Array
) -> Row:
    left, right = coal_shapes(a), coal_shapes(b)
    if left is None or right is None:
        return {"coal_overlap_ns": "coal is not installed"}
    answers, seconds = min(
        (coal_peer.collide_all(left, right) for _ in range(3)), key=itemgetter(1)
    )
    far, far_seconds = min(
        (coal_peer.distance_all(left, right) for _ in range(3)), key=itemgetter(1)
    )
    return {
        "coal_overlap_ns": seconds / len(hit) * 1e9,
        "coal_distance_ns": far_seconds / len(hit) * 1e9,
        "coal_disagrees": rate(int((np.array(answers) != hit).sum()), len(hit)),
        "coal_error": worst(far, truth, size),
        "coal_differs_most": float(np.abs(far - gap).max()),
    }


def motions(rng: np.random.Generator, n: int, reach: float, speed: float) -> Motion:
    """N motions from about ``reach`` [m] away past the origin, turning by up to 2 rad."""
    way = rng.normal(size=(n, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    pose = np.tile(np.eye(4), (n, 1, 1))
    seed = int(rng.integers(1 << 31))
    pose[:, :3, :3] = Rotation.random(n, random_state=seed).as_matrix()
    pose[:, :3, 3] = reach * way
    aim = -speed * way + 0.3 * reach * rng.normal(size=(n, 3))
    return Motion(pose, aim, rng.uniform(-1.2, 1.2, (n, 3)))


def moving_row(rng: np.random.Generator, kinds: tuple[str, str], n: int) -> Row:
    """Time of impact of one kind of pair, both turning."""
    a, b = (bodies(rng, kind, n, 0.0, 1.0) for kind in kinds)
    ma, mb = motions(rng, n, 0.3, 0.3), motions(rng, n, 2.5, 2.5)
    return {
        "study": "rounded in motion",
        "pair": "-".join(kinds),
        **in_motion(
            partial(time_of_impact, a, b, ma, mb),
            (coal_shapes(a), coal_shapes(b)),
            (ma, mb),
            farthest(a) + farthest(b),
        ),
    }


def farthest(solid: Solid) -> Array:
    """No point of a body is further from its frame's origin [m]. Shape (N,)."""
    core, radius = parts(solid)
    points = (exact_vertices(core, i)[0] for i in range(len(solid)))
    corners = [max(float(sum(x * x for x in p)) for p in corners) ** 0.5 for corners in points]
    return np.asarray(np.array(corners) + radius)
