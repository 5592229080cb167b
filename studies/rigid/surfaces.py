"""Distances of meshes, points and rays, and the broad phase: time and error, also of peers.

coal has distances of meshes and broad phases; trimesh has points and rays, with Embree if it is
installed (``pip install embreex``), otherwise with rtree.
"""

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from oracles import coal_peer
from oracles.mesh_points import solid_angle_winding
from oracles.surfaces import bumpy_surface, poses_near
from studies.framework import number, per, table_rows, time_in_turn
from studies.rigid.bars import count, error, faster
from tauguard.arrays import Array
from tauguard.report import Row, rate
from tauguard.rigid import Boxes, MeshTree, distance, near_pairs

NOTES = {
    "distance of meshes": "us for one pose of surfaces that are apart, median; error: largest "
    "difference from coal, as a fraction of the mesh's size.",
    "points and rays": "ns per point or ray. `wrong`: points on the wrong side, by solid angles; "
    "rays through corners and edges of a closed surface that find no face.",
    "broad phase": "ms for all pairs of boxes that overlap, from a new set of boxes; coal's time "
    "is that of setup and collide of its dynamic tree. `missed`: pairs beside brute force.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """Measure two surfaces, points and rays of a sphere, and 10,000 boxes."""
    rng = np.random.default_rng(seed)
    ball = trimesh.creation.icosphere(4 if quick else 5)
    corners, faces = np.asarray(ball.vertices), np.asarray(ball.faces)
    bumpy, rows_of_bumpy = bumpy_surface(60 if quick else 186)
    poses = 20 if quick else 200
    rows = [mesh_row("sphere", corners, faces, rng, poses)]
    rows.append(mesh_row("bumpy surface", bumpy, rows_of_bumpy, rng, poses))
    tree = MeshTree(corners, faces)
    rows += [points_row(tree, rng, 2_000), rays_row(tree, rng, 20_000)]
    rows += [boxes_row(rng, 10_000, density) for density in (1, 8)]
    return rows + summary(rows, quick)


def summary(rows: list[Row], quick: bool) -> list[Row]:
    """Wrong answers, errors, and ratios of times."""
    meshes, sets = table_rows(rows, "distance of meshes"), table_rows(rows, "broad phase")
    points = table_rows(rows, "points and rays")
    ratios = [(number(r["coal_us"]) or 0) / (number(r["us"]) or 1) for r in meshes]
    wide = [(number(r["coal_ms"]) or 0) / (number(r["ms"]) or 1) for r in sets]
    return [
        error("meshes: difference from coal's distance", 1e-12, [row["error"] for row in meshes]),
        error("points and rays: wrong", 0, [count(row["wrong"]) for row in points]),
        error("broad phase: missed pairs", 0, [row["missed"] for row in sets]),
        faster("distance of meshes over coal", 1, ratios, quick),
        faster("broad phase over coal", 1, wide, quick),
    ]


def mesh_row(
    name: str, vertices: Array, faces: NDArray[np.integer[Any]], rng: np.random.Generator, n: int
) -> Row:
    """Distance of a mesh from itself at random poses without contact."""
    tree, (peer, _) = MeshTree(vertices, faces), coal_peer.mesh(vertices, faces)
    poses = poses_near(vertices, rng, 8 * n)
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    poses[:, :3, 3] *= rng.uniform(1, 3, (len(poses), 1))
    poses = poses[~tree.overlap(tree, poses).hit][:n]
    found = distance(tree, tree, pose_b=poses).distance
    apart = found > 0
    poses, found = poses[apart], found[apart]
    coal, here = coal_peer.coal_module(), coal_peer.coal_module().Transform3s.Identity()
    there = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in poses]
    ours, theirs, truth = [], [], []
    for pose, place in zip(poses, there, strict=True):
        start = time.perf_counter()
        distance(tree, tree, pose_b=pose)
        ours.append(time.perf_counter() - start)
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        start = time.perf_counter()
        truth.append(coal.distance(peer, here, peer, place, request, result))
        theirs.append(time.perf_counter() - start)
    return {
        "study": "distance of meshes",
        "mesh": name,
        "faces": len(faces),
        "poses": len(poses),
        "us": spread(ours),
        "coal_us": spread(theirs),
        "error": float(np.abs(found - truth).max()) / size,
    }


def spread(seconds: list[float]) -> dict[str, float]:
    """Median and quartiles [us]."""
    low, median, high = 1e6 * np.quantile(seconds, [0.25, 0.5, 0.75])
    return {"median": float(median), "low": float(low), "high": float(high)}


def points_row(tree: MeshTree, rng: np.random.Generator, n: int) -> Row:
    """Whether points are inside."""
    points = rng.uniform(-1.1, 1.1, (n, 3))
    triangles = tree.vertices[tree.faces]
    truth = np.concatenate(
        [solid_angle_winding(part, triangles) > 0.5 for part in np.array_split(points, n // 50)]
    )
    mesh = trimesh_of(tree)
    calls: dict[str, Callable[[], Any]] = {"ours": partial(tree.contains, points)}
    wrong: dict[str, Any] = {"wrong": rate(int((tree.contains(points) != truth).sum()), n)}
    if mesh is not None:
        calls["trimesh"] = partial(mesh.contains, points)
        wrong["trimesh_wrong"] = rate(int((mesh.contains(points) != truth).sum()), n)
    return answers("inside", n, calls, wrong)


def rays_row(tree: MeshTree, rng: np.random.Generator, n: int) -> Row:
    """First hits of rays from inside of the closed surface, through its corners and edges."""
    ends = np.concatenate([tree.vertices, tree.vertices[tree.faces][:, :2].mean(axis=1)])
    ends = ends[rng.permutation(len(ends))[:n]]
    origins = 0.3 * rng.uniform(-1, 1, ends.shape)
    ways = ends - origins
    calls: dict[str, Callable[[], Any]] = {"ours": partial(tree.cast, origins, ways)}
    wrong: dict[str, Any] = {"wrong": rate(int((~tree.cast(origins, ways).hit).sum()), len(ends))}
    mesh = trimesh_of(tree)
    if mesh is not None:
        calls["trimesh"] = partial(mesh.ray.intersects_first, origins, ways)
        missed = int((mesh.ray.intersects_first(origins, ways) < 0).sum())
        wrong["trimesh_wrong"] = rate(missed, len(ends))
    return answers("rays", len(ends), calls, wrong)


def answers(name: str, n: int, calls: dict[str, Callable[[], Any]], wrong: dict[str, Any]) -> Row:
    """A row of times and wrong answers."""
    spent = time_in_turn(calls, 3, time.process_time)
    peer: Any = per(spent["trimesh"], n) if "trimesh" in spent else "needs embreex or rtree"
    own: Row = {"study": "points and rays", "query": name, "queries": n}
    return own | {"ns": per(spent["ours"], n), "trimesh_ns": peer} | wrong


def trimesh_of(tree: MeshTree) -> Any:
    """trimesh's mesh; ``None`` without a library for its rays."""
    mesh = trimesh.Trimesh(tree.vertices, tree.faces, process=False)
    try:
        mesh.ray.intersects_first([[0.0, 0, 0]], [[0.0, 0, 1]])
    except ImportError:
        return None
    return mesh


def boxes_row(rng: np.random.Generator, n: int, density: int) -> Row:
    """All overlapping pairs of boxes along the axes."""
    center = rng.uniform(0, (n / density) ** (1 / 3), (n, 3))
    half = rng.uniform(0.1, 0.4, (n, 3))
    pairs = near_pairs(Boxes(center, half))
    low, high = center - half, center + half
    truth = sum(
        int(((low[k] <= high[k + 1 :]) & (high[k] >= low[k + 1 :])).all(axis=1).sum())
        for k in range(n)
    )
    coal = coal_peer.coal_module()
    objects = [
        coal.CollisionObject(coal.Box(*(2 * h)), coal.Transform3s(np.eye(3), c))
        for c, h in zip(center, half, strict=True)
    ]

    def managed() -> int:
        manager = coal.DynamicAABBTreeCollisionManager()
        for one in objects:
            manager.registerObject(one)
        manager.setup()
        collect = coal.CollisionCallBackCollect(10 * truth)
        manager.collide(collect)
        return int(collect.numCollisionPairs())

    calls = {"ours": lambda: near_pairs(Boxes(center, half)), "coal": managed}
    spent = time_in_turn(calls, 3, time.process_time)
    return {
        "study": "broad phase",
        "boxes": n,
        "pairs": truth,
        "ms": per(spent["ours"], 1, 1e3),
        "coal_ms": per(spent["coal"], 1, 1e3),
        "missed": truth - len(pairs),
        "coal_missed": truth - managed(),
    }
