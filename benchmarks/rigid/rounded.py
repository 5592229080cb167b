"""Bodies with radii and meshes against convex bodies: times beside coal's, errors beside both.

The truth of an overlap is rational arithmetic where it is quick enough (points, segments,
tetrahedra). What coal says beyond its own tolerance of 1e-6 of the extent is compared as well.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tauguard.benchmarks.harness import measure
from tauguard.benchmarks.rigid.convex import nanoseconds
from tauguard.benchmarks.rigid.gap import worst
from tauguard.benchmarks.rigid.gap_truth import exact_gap, extent, squared_distance
from tauguard.benchmarks.rigid.mesh import Mesh, load
from tauguard.benchmarks.rigid.truth import exact_vertices
from tauguard.report import Row, rate
from tauguard.rigid import (
    Boxes,
    Capsules,
    MeshTree,
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

Array = NDArray[np.float64]
#: Distance at which advancement over coal's stops, and what counts as coal's own tolerance.
STOP = 1e-6
PAIRS = (
    ("spheres", "spheres"),
    ("capsules", "capsules"),
    ("capsules", "tetrahedra"),
    ("rounded boxes", "capsules"),
    ("rounded boxes", "rounded boxes"),
)


def bodies(rng: np.random.Generator, kind: str, n: int, reach: float, size: float) -> Solid:
    """Random bodies of about ``size``, centres within ``reach``."""
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
    """Static pairs, pairs in motion, and a mesh against each kind."""
    rng = np.random.default_rng(seed)
    n = 1_000 if quick else 20_000
    rows = [static_row(rng, pair, n, 15 if quick else 200) for pair in PAIRS]
    rows += [moving_row(rng, pair, 60 if quick else 1_000) for pair in PAIRS]
    mesh = load(quick)
    tree = MeshTree(mesh.vertices, mesh.faces)
    # coal knows no rounded shapes beside a mesh but spheres and capsules.
    for kind in ("spheres", "capsules", "tetrahedra", "boxes"):
        rows.append(mesh_row(rng, mesh, tree, kind, 60 if quick else 1_000))
    return rows


def static_row(rng: np.random.Generator, kinds: tuple[str, str], n: int, known: int) -> Row:
    """Overlap and distance of one kind of pair."""
    a, b = (bodies(rng, kind, n, 0.8, 1.0) for kind in kinds)
    hit, gap = overlap(a, b).hit, distance(a, b).distance
    spent = measure(
        {"overlap": partial(overlap, a, b), "distance": partial(distance, a, b)},
        3,
        time.process_time,
    )
    small = all("boxes" not in kind for kind in kinds)
    truth = np.array([exact_gap(a, b, i) for i in range(known if small else 2)])
    size = np.array([extent(a, b, i) for i in range(len(truth))])
    wrong = sum(bool(exactly_meet(a, b, i) != hit[i]) for i in range(known)) if small else None
    return {
        "study": "rounded",
        "pair": "-".join(kinds),
        "pairs": n,
        "hits": int(hit.sum()),
        "overlap_ns": nanoseconds(spent["overlap"], n),
        "distance_ns": nanoseconds(spent["distance"], n),
        "known": known if small else 0,
        "wrong": wrong,
        "signs_differ": int(((gap <= 0) != hit).sum()),
        "error": worst(gap, truth, size),
        **_coal_static(a, b, hit, gap, truth, size),
    }


def _coal_static(
    a: Solid, b: Solid, hit: NDArray[np.bool_], gap: Array, truth: Array, size: Array
) -> Row:
    try:
        left, right = coal_peer.geometries(a), coal_peer.geometries(b)
    except ValueError:
        return {"coal_overlap_ns": "coal is not installed"}
    answers, seconds = min((coal_peer.collide_all(left, right) for _ in range(3)), key=second)
    far, far_seconds = min((coal_peer.distance_all(left, right) for _ in range(3)), key=second)
    return {
        "coal_overlap_ns": seconds / len(hit) * 1e9,
        "coal_distance_ns": far_seconds / len(hit) * 1e9,
        "coal_disagrees": rate(int((np.array(answers) != hit).sum()), len(hit)),
        "coal_error": worst(far, truth, size),
        "coal_differs_most": float(np.abs(far - gap).max()),
    }


def second(pair: tuple[Any, float]) -> float:
    """The seconds of an answer with its time."""
    return pair[1]


def exactly_meet(a: Solid, b: Solid, i: int) -> bool:
    """In fractions: is the cores' squared distance at most the squared sum of the radii?"""
    (core_a, radius_a), (core_b, radius_b) = parts(a), parts(b)
    radii = sum(Fraction(float(r[i if len(r) > 1 else 0])) for r in (radius_a, radius_b))
    pa, pb = (
        [tuple(Fraction(x) for x in p) for p in exact_vertices(core, i)[0]]
        for core in (core_a, core_b)
    )
    return bool(squared_distance(pa, pb) <= radii * radii)


def motions(rng: np.random.Generator, n: int, reach: float, speed: float) -> Motion:
    """From about ``reach`` away past the origin, turning by up to 2 rad."""
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
            partial(time_of_impact, a, b, ma, mb), shapes(a), shapes(b), ma, mb, reach(a) + reach(b)
        ),
    }


def reach(solid: Solid) -> Array:
    """No point of a body is further from its frame's origin. Shape (N,)."""
    core, radius = parts(solid)
    far = [max(float(sum(x * x for x in p)) for p in exact_vertices(core, i)[0]) ** 0.5
           for i in range(len(solid))]  # fmt: skip
    return np.asarray(np.array(far) + radius)


def shapes(solid: Solid) -> list[tuple[Any, Any]] | None:
    """coal's shapes and poses, None where it is not installed."""
    try:
        return coal_peer.geometries(solid)
    except ValueError:
        return None


def in_motion(
    call: Callable[[], Any],
    left: list[tuple[Any, Any]] | None,
    right: list[tuple[Any, Any]] | None,
    ma: Motion,
    mb: Motion,
    reach: Array,
) -> Row:
    """Times, and coal's distance at each time of impact and at 24 moments before."""
    found = call()
    n = len(found.toi)
    spent = measure({"": call}, 3, time.process_time)[""]
    row: Row = {"pairs": n, "hits": int(found.hit.sum()), "us": nanoseconds(spent, 1000 * n)}
    if left is None or right is None:
        return {**row, "coal_us": "coal is not installed"}
    gap = CoalGap(left, right, ma, mb)
    end = np.where(found.hit, found.toi, 1.0)
    before = [gap(np.arange(n), share * end) for share in np.linspace(0, 0.999, 24)]
    at = np.abs(gap(np.arange(n), end))[found.hit & (found.toi > 0)]
    speed = np.linalg.norm(ma.linear - mb.linear, axis=1)
    speed += reach * np.maximum(*(np.linalg.norm(m.angular, axis=1) for m in (ma, mb)))
    toi, seconds, steps = advanced(gap, speed, n)
    both = np.isfinite(toi) & found.hit & (found.toi > 0)
    return {
        **row,
        "passed_before": int((np.min(before, axis=0) < -STOP).sum() - (found.toi == 0).sum()),
        "gap_at_toi": float(at.max(initial=0.0)),
        "coal_us": 1e6 * seconds / n,
        "coal_steps": steps / n,
        "coal_disagrees": int((np.isfinite(toi) != found.hit).sum()),
        "toi_differs_most": float(np.abs(toi[both] - found.toi[both]).max(initial=0.0)),
    }


class CoalGap:
    """coal's signed distance of moving pairs."""

    def __init__(
        self, left: list[tuple[Any, Any]], right: list[tuple[Any, Any]], ma: Motion, mb: Motion
    ) -> None:
        """Shapes with their poses in the bodies' frames (one shape stands for all), and motions."""
        self.sides, self.motions = (left, right), (ma, mb)
        self.coal, self.seconds = coal_peer.coal_module(), 0.0

    def __call__(self, rows: NDArray[np.intp], t: Array) -> Array:
        """Of the chosen rows at their times; the seconds of the calls are added up."""
        out = np.empty(len(rows))
        poses = [self._poses(side, rows, t) for side in (0, 1)]
        request, result = self.coal.DistanceRequest(), self.coal.DistanceResult()
        request.enable_signed_distance = True
        begin = time.process_time()
        for k in range(len(rows)):
            (a, at_a), (b, at_b) = poses[0][k], poses[1][k]
            result.clear()
            out[k] = self.coal.distance(a, at_a, b, at_b, request, result)
        self.seconds += time.process_time() - begin
        return out

    def _poses(self, side: int, rows: NDArray[np.intp], t: Array) -> list[tuple[Any, Any]]:
        motion, own = self.motions[side], self.sides[side]
        some = rows if len(motion) > 1 else np.zeros_like(rows)
        moved = Motion(motion.pose_t0[some], motion.linear[some], motion.angular[some]).at(t)
        found = []
        for row, pose in zip(rows, moved, strict=True):
            shape, place = own[row if len(own) > 1 else 0]
            there = self.coal.Transform3s(pose[:3, :3], pose[:3, 3])
            found.append((shape, there * place))
        return found


def advanced(gap: CoalGap, speed: Array, n: int, most: int = 300) -> tuple[Array, float, int]:
    """Conservative advancement (Mirtich 1996): times, seconds in coal's distance, its calls."""
    t, toi, alive, steps = np.zeros(n), np.full(n, np.inf), np.arange(n), 0
    gap.seconds = 0.0
    for _ in range(most):
        left = gap(alive, t[alive])
        steps += len(alive)
        touch = left <= STOP
        toi[alive[touch]] = t[alive[touch]]
        t[alive] += np.maximum(left, 0) / speed[alive]
        alive = alive[~touch & (t[alive] < 1)]
        if len(alive) == 0:
            break
    toi[alive] = t[alive]  # creeping towards contact
    return toi, gap.seconds, steps


def mesh_row(rng: np.random.Generator, mesh: Mesh, tree: MeshTree, kind: str, n: int) -> Row:
    """Overlap, distance and time of impact of the mesh and one kind of body."""
    at = bodies(rng, kind, n, 0.45 * mesh.size, 0.15 * mesh.size)
    solid = moved(at, mesh.centre)
    hit, gap = overlap(tree, solid).hit, distance(tree, solid).distance
    calls: dict[str, Callable[[], object]] = {
        "overlap": partial(overlap, tree, solid),
        "distance": partial(distance, tree, solid),
    }
    spent = measure(calls, 3, time.process_time)
    own = bodies(rng, kind, n, 0.0, 0.15 * mesh.size)
    rest = Motion(np.eye(4), np.zeros(3), np.zeros(3))
    motion = motions(rng, n, 0.8 * mesh.size, 0.8 * mesh.size)
    pose = motion.pose_t0.copy()
    pose[:, :3, 3] += mesh.centre
    motion = Motion(pose, motion.linear, motion.angular)
    model = shapes(own) and coal_peer.mesh(mesh.vertices, mesh.faces)[0]
    here = None if model is None else [(model, coal_peer.coal_module().Transform3s.Identity())]
    few = slice(0, 20 if n < 1_000 else 50)
    moving = in_motion(
        partial(time_of_impact, tree, take(own, few), rest, take_motion(motion, few)),
        here, shapes(take(own, few)), rest, take_motion(motion, few), reach(own)[few],
    )  # fmt: skip
    row: Row = {
        "study": "mesh and convex",
        "mesh": mesh.name,
        "body": kind,
        "pairs": n,
        "hits": int(hit.sum()),
        "overlap_us": nanoseconds(spent["overlap"], 1000 * n),
        "distance_us": nanoseconds(spent["distance"], 1000 * n),
        "signs_differ": int(((gap <= 0) != hit).sum()),
    }
    if here is not None:
        there = shapes(solid)
        assert there is not None
        answers, seconds = coal_peer.collide_all(here * n, there)
        far, far_seconds = coal_peer.distance_all(here * n, there)
        row |= {
            "coal_overlap_us": seconds / n * 1e6,
            "coal_distance_us": far_seconds / n * 1e6,
            "coal_disagrees": rate(int((np.array(answers) != hit).sum()), n),
            "coal_differs_most": float(np.abs(far - gap)[~hit].max(initial=0.0)),
        }
    return row | {f"moving_{key}": value for key, value in moving.items()}


def moved(solid: Solid, by: Array) -> Solid:
    """The batch further on."""
    if isinstance(solid, Spheres):
        return Spheres(solid.center + by, solid.radius)
    if isinstance(solid, Capsules):
        return Capsules(solid.start + by, solid.end + by, solid.radius)
    if isinstance(solid, Tetrahedra):
        return Tetrahedra(solid.vertices + by)
    assert isinstance(solid, Boxes)
    return Boxes(solid.center + by, solid.half_extents, solid.rotation)


def take(solid: Solid, index: slice) -> Solid:
    """Some rows of a batch."""
    if isinstance(solid, Spheres):
        return Spheres(solid.center[index], solid.radius[index])
    if isinstance(solid, Capsules):
        return Capsules(solid.start[index], solid.end[index], solid.radius[index])
    if isinstance(solid, Tetrahedra):
        return Tetrahedra(solid.vertices[index])
    assert isinstance(solid, Boxes)
    return Boxes(solid.center[index], solid.half_extents[index], solid.rotation[index])


def take_motion(motion: Motion, index: slice) -> Motion:
    """Some rows of a batch of motions."""
    return Motion(motion.pose_t0[index], motion.linear[index], motion.angular[index])
