"""Meshes: build, first hit (Table 2.2 static), motion (dynamic), and queries with convex bodies.

The environment variable ``TAUGUARD_MESH`` names the mesh (any file that trimesh reads). Without
it the mesh is the Stanford bunny in ``TAUGUARD_DATA/meshes`` or, if that is missing, a generated
one of the bunny's size.
"""

import os
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracles import coal_peer
from oracles.coal_motion import MovingDistance
from oracles.convex_pairs import REST, farthest, random_bodies, random_motions, shifted, take
from oracles.surfaces import bumpy_surface, poses_near
from studies.framework import per, table_rows, time_in_turn
from studies.rigid import peer
from studies.rigid.bars import count, error, faster
from tauguard.arrays import Array
from tauguard.report import Row, rate
from tauguard.rigid import Impacts, MeshTree, Motion, distance, overlap, time_of_impact
from tauguard.rigid.comparators import ComparedTree

#: Number of pairs of each outcome for which advancement with coal's distance is run.
ADVANCED = 16
#: Of rounded shapes, coal takes only spheres and capsules beside a mesh.
BODIES = ("spheres", "capsules", "tetrahedra", "boxes")
NOTES = {
    "mesh build": "one tree; times_faster: time of coal's OBBRSS / this time.",
    "table 2.2 static": "first hit of two copies in random poses [us]; times_faster: coal's mean "
    "without its Python call / this mean; disagree: answers that differ from coal's.",
    "table 2.2 dynamic": "two copies, one of which moves. us_hit, us_miss: time for a pair that "
    "touches, and that stays apart. coal_us: the distance calls (OBBRSS) of conservative "
    "advancement, on some of the pairs. late: pairs that overlap 1e-10 before the time found; "
    "not_touching: pairs apart 1e-7 after it, by the exact query. met_before: pairs in contact "
    "before that, by coal's distance; distance_at_toi: coal's distance at the time found [m].",
    "mesh and convex": "one mesh and convex bodies, us per body, coal's with its Python call; "
    "coal_differs_most: largest difference of the distances of separate pairs [m].",
    "mesh and convex in motion": "as table 2.2 dynamic; the body moves.",
}


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh, and its name in the rows."""

    name: str
    vertices: Array
    faces: NDArray[np.int64]

    @property
    def center(self) -> Array:
        """The middle of the bounding box. Shape (3,)."""
        return np.asarray(0.5 * (self.vertices.min(axis=0) + self.vertices.max(axis=0)))

    @property
    def size(self) -> float:
        """The diagonal of the bounding box [m]."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))


def load(quick: bool) -> Mesh:
    """The mesh of the study; the module's docstring says which.

    Raises:
        ValueError: ``TAUGUARD_MESH`` names no readable triangle mesh.
    """
    named = os.environ.get("TAUGUARD_MESH")
    data = os.environ.get("TAUGUARD_DATA")
    bunny = Path(data) / "meshes" / "stanford-bunny.obj" if data else None
    path = Path(named) if named else bunny
    if path is None or (not named and not path.is_file()):
        return Mesh("generated", *bumpy_surface(60 if quick else 186))
    import trimesh

    try:
        found = trimesh.load(path, force="mesh", process=False)
        return Mesh(path.stem, np.array(found.vertices, dtype=float), np.array(found.faces))
    except (OSError, ValueError, AttributeError, NotImplementedError) as error:
        raise ValueError(
            f"TAUGUARD_MESH: {path.name} is no mesh trimesh can read: {error}"
        ) from None


def measure(quick: bool, seed: int) -> list[Row]:
    """Measure build, first hit, motion, and the mesh with convex bodies."""
    rng = np.random.default_rng(seed)
    mesh = load(quick)
    poses = poses_near(mesh.vertices, rng, 400 if quick else 2_000)
    built = [coal_peer.mesh(mesh.vertices, mesh.faces) for _ in range(3)]
    model = built[0][0]
    rows = build_rows(mesh, 1e3 * float(np.median([ms for _, ms in built])), 2 if quick else 5)
    rows += static_rows(mesh, model, poses, 3 if quick else 5)
    rows += dynamic_rows(mesh, model, poses, rng, 40 if quick else 200)
    sizes = (20, 20) if quick else (1_000, 50)
    beside = [body_rows(rng, mesh, model, kind, *sizes) for kind in BODIES]
    rows += [row for table in zip(*beside, strict=True) for row in table]
    return rows + summary(rows, quick)


def summary(rows: list[Row], quick: bool) -> list[Row]:
    """Ratios of build and first-hit times to coal's, wrong answers, and late contacts."""
    static = table_rows(rows, "table 2.2 static")
    moving = table_rows(rows, "table 2.2 dynamic") + table_rows(rows, "mesh and convex in motion")
    convex, own = table_rows(rows, "mesh and convex"), [r for r in static if r["volume"] == "obb"]
    build = [r["times_faster"] for r in table_rows(rows, "mesh build") if r["volume"] == "obb"]
    found = [faster("obb: build over coal", 5, build, quick)]
    for outcome, bar in (("collision", 6), ("non-collision", 4)):
        ratios = [row["times_faster"] for row in own if row["outcome"] == outcome]
        found.append(faster(f"obb: first hit over coal, {outcome}", bar, ratios, quick))
    late = [row[key] for row in moving for key in ("late", "met_before") if key in row]
    return [
        *found,
        error(
            "answers that differ from coal's, any volume", 0, [count(r["disagree"]) for r in static]
        ),
        error("in motion: late or met before", 0, late),
        error("beside convex bodies: wrong signs", 0, [row["signs_differ"] for row in convex]),
    ]


def build_rows(mesh: Mesh, coal_ms: float, repeats: int) -> list[Row]:
    """Time of a tree with each bounding volume."""
    calls = {v: partial(ComparedTree, mesh.vertices, mesh.faces, v) for v in ComparedTree.volumes}
    return [
        {
            "study": "mesh build",
            "mesh": mesh.name,
            "triangles": len(mesh.faces),
            "volume": volume,
            "build_ms": per(seconds, 1, 1e3),
            "coal_obbrss_ms": coal_ms,
            "times_faster": coal_ms / (1e3 * seconds["median"]),
        }
        for volume, seconds in time_in_turn(calls, repeats, time.process_time).items()
    ]


def static_rows(mesh: Mesh, model: Any, poses: Array, repeats: int) -> list[Row]:
    """Mean time of a first hit in a batch, for each volume and coal.

    The overhead of coal's call is that of two one-triangle models far apart.
    """
    trees = {v: ComparedTree(mesh.vertices, mesh.faces, v) for v in ComparedTree.volumes}
    hits = {v: tree.overlap(tree, poses).hit for v, tree in trees.items()}
    far, one = np.tile(np.eye(4), (1000, 1, 1)), coal_peer.mesh(mesh.vertices, mesh.faces[:1])[0]
    far[:, 0, 3] = 10 * mesh.size
    coal_hit, first = coal_peer.collide_mesh(model, model, poses)
    coal_us = 1e6 * np.minimum(first, coal_peer.collide_mesh(model, model, poses)[1])
    call_us = float(1e6 * np.median(coal_peer.collide_mesh(one, one, far)[1]))
    rows: list[Row] = []
    for outcome, name in ((True, "collision"), (False, "non-collision")):
        index = coal_hit == outcome
        calls = {v: partial(tree.overlap, tree, poses[index]) for v, tree in trees.items()}
        spent = time_in_turn(calls, repeats, time.process_time)
        for volume in trees:
            mean, coal = per(spent[volume], index.sum(), 1e6), float(coal_us[index].mean())
            rows.append(
                {
                    "study": "table 2.2 static",
                    "mesh": mesh.name,
                    "volume": volume,
                    "outcome": name,
                    "poses": int(index.sum()),
                    "batch_mean_us": mean,
                    "coal_mean_us": coal,
                    "coal_median_us": float(np.median(coal_us[index])),
                    "coal_call_us": call_us,
                    "times_faster": (coal - call_us) / mean["median"],
                    "disagree": rate(int((hits[volume] != coal_hit).sum()), len(poses)),
                }
            )
    return rows


def dynamic_rows(
    mesh: Mesh, model: Any, poses: Array, rng: np.random.Generator, n: int
) -> list[Row]:
    """Times of a straight motion and of one with rotation, from poses without overlap."""
    tree = MeshTree(mesh.vertices, mesh.faces)
    start = poses[~tree.overlap(tree, poses).hit][:n]
    away = mesh.center - (start[:, :3, :3] @ mesh.center + start[:, :3, 3])
    move = away * rng.uniform(0, 1.5, (len(start), 1))
    move += 0.2 * mesh.size * rng.normal(size=move.shape)
    turn = rng.uniform(-1, 1, move.shape)
    reach, rows = float(np.linalg.norm(mesh.vertices, axis=1).max()), []
    shapes = [(model, coal_peer.coal_module().Transform3s.Identity())]
    for kind, angular in (("sweep", np.zeros_like(move)), ("linear and angular", turn)):
        motion = Motion(start, move, angular)

        def call(index: NDArray[np.intp], motion: Motion = motion) -> Impacts:
            return tree.time_of_impact(tree, take(motion, index))

        coal = MovingDistance((shapes, shapes), (REST, motion), signed=False)
        toi = tree.time_of_impact(tree, motion).time_of_impact
        hit, end = np.isfinite(toi), np.where(np.isfinite(toi), toi, 1.0)
        before = tree.overlap(tree, motion.at(np.maximum(end - 1e-10, 0))).hit
        after = tree.overlap(tree, motion.at(np.minimum(end + 1e-7, 1))).hit
        rows.append(
            {
                "study": "table 2.2 dynamic",
                "mesh": mesh.name,
                "motion": kind,
                **peer.motion_columns(call, coal, reach, ADVANCED),
                "late": int((hit & before).sum()),
                "not_touching": int((hit & ~after).sum()),
            }
        )
    return rows


def body_rows(
    rng: np.random.Generator, mesh: Mesh, model: Any, kind: str, n: int, moving: int
) -> list[Row]:
    """The mesh and one kind of body: overlap and distance, then the time of impact."""
    tree = MeshTree(mesh.vertices, mesh.faces)
    solid = shifted(random_bodies(rng, kind, n, 0.45 * mesh.size, 0.15 * mesh.size), mesh.center)
    hit, found = overlap(tree, solid).hit, distance(tree, solid).distance
    calls: dict[str, Any] = {
        "overlap": partial(overlap, tree, solid),
        "distance": partial(distance, tree, solid),
    }
    spent = time_in_turn(calls, 3, time.process_time)
    shapes = [(model, coal_peer.coal_module().Transform3s.Identity())]
    answers, seconds = coal_peer.collide_all(shapes * n, coal_peer.geometries(solid))
    far, far_seconds = coal_peer.distance_all(shapes * n, coal_peer.geometries(solid))
    static: Row = {
        "study": "mesh and convex",
        "mesh": mesh.name,
        "body": kind,
        "pairs": n,
        "hits": int(hit.sum()),
        "overlap_us": per(spent["overlap"], n, 1e6),
        "distance_us": per(spent["distance"], n, 1e6),
        "coal_overlap_us": seconds / n * 1e6,
        "coal_distance_us": far_seconds / n * 1e6,
        "signs_differ": int(((found <= 0) != hit).sum()),
        "coal_disagrees": rate(int((np.array(answers) != hit).sum()), n),
        "coal_differs_most": float(np.abs(far - found)[~hit].max(initial=0.0)),
    }
    own = random_bodies(rng, kind, moving, 0.0, 0.15 * mesh.size)
    motion = random_motions(rng, moving, 0.8 * mesh.size, 0.8 * mesh.size)
    pose = motion.pose_t0.copy()
    pose[:, :3, 3] += mesh.center
    motion = Motion(pose, motion.linear, motion.angular)

    def call(index: NDArray[np.intp]) -> Impacts:
        return time_of_impact(tree, take(own, index), REST, take(motion, index))

    coal = MovingDistance((shapes, coal_peer.geometries(own)), (REST, motion), signed=True)
    columns = peer.motion_columns(call, coal, farthest(own))
    base = {"study": "mesh and convex in motion", "mesh": mesh.name, "body": kind}
    return [static, {**base, **columns}]
