"""A mesh against convex bodies, at rest and in motion: times and errors beside coal's."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import numpy as np

from studies.framework import time_in_turn
from studies.rigid.coal_motion import Shapes, coal_shapes, in_motion
from studies.rigid.convex import nanoseconds, shifted
from studies.rigid.mesh import Mesh, load
from studies.rigid.rounded import bodies, farthest, motions
from tauguard.report import Row, rate
from tauguard.rigid import MeshTree, Motion, coal_peer, distance, overlap, time_of_impact

#: coal knows no rounded shapes beside a mesh but spheres and capsules.
BODIES = ("spheres", "capsules", "tetrahedra", "boxes")


def run(quick: bool, seed: int) -> list[Row]:
    """A row of each kind of body."""
    rng = np.random.default_rng(seed)
    mesh = load(quick)
    tree = MeshTree(mesh.vertices, mesh.faces)
    return [mesh_row(rng, mesh, tree, kind, 20 if quick else 1_000) for kind in BODIES]


def mesh_row(rng: np.random.Generator, mesh: Mesh, tree: MeshTree, kind: str, n: int) -> Row:
    """Overlap, distance and time of impact of the mesh and one kind of body."""
    at = bodies(rng, kind, n, 0.45 * mesh.size, 0.15 * mesh.size)
    solid = shifted(at, mesh.centre)
    hit, gap = overlap(tree, solid).hit, distance(tree, solid).distance
    calls: dict[str, Callable[[], object]] = {
        "overlap": partial(overlap, tree, solid),
        "distance": partial(distance, tree, solid),
    }
    spent = time_in_turn(calls, 3, time.process_time)
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
    here, there = coal_model(mesh), coal_shapes(solid)
    if here is not None and there is not None:
        answers, seconds = coal_peer.collide_all(here * n, there)
        far, far_seconds = coal_peer.distance_all(here * n, there)
        row |= {
            "coal_overlap_us": seconds / n * 1e6,
            "coal_distance_us": far_seconds / n * 1e6,
            "coal_disagrees": rate(int((np.array(answers) != hit).sum()), n),
            "coal_differs_most": float(np.abs(far - gap)[~hit].max(initial=0.0)),
        }
    moving = moving_row(rng, mesh, tree, kind, 20 if n < 1_000 else 50)
    return row | {f"moving_{key}": value for key, value in moving.items()}


def coal_model(mesh: Mesh) -> Shapes | None:
    """coal's model of the mesh in its place, None where it is not installed."""
    try:
        coal = coal_peer.coal_module()
    except ValueError:
        return None
    return [(coal_peer.mesh(mesh.vertices, mesh.faces)[0], coal.Transform3s.Identity())]


def moving_row(rng: np.random.Generator, mesh: Mesh, tree: MeshTree, kind: str, n: int) -> Row:
    """Time of impact of the mesh at rest and n turning bodies of one kind."""
    own = bodies(rng, kind, n, 0.0, 0.15 * mesh.size)
    rest = Motion(np.eye(4), np.zeros(3), np.zeros(3))
    motion = motions(rng, n, 0.8 * mesh.size, 0.8 * mesh.size)
    pose = motion.pose_t0.copy()
    pose[:, :3, 3] += mesh.centre
    motion = Motion(pose, motion.linear, motion.angular)
    return in_motion(
        partial(time_of_impact, tree, own, rest, motion),
        (coal_model(mesh), coal_shapes(own)),
        (rest, motion),
        farthest(own),
    )
