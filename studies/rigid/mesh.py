"""Mesh against mesh: build, first hit (table 2.2 static) and sweep (dynamic), beside coal.

The mesh is the one that the environment variable ``TAUGUARD_MESH`` names (any file trimesh reads),
else the Stanford bunny in ``TAUGUARD_DATA/meshes``, else a generated one of the bunny's size.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from studies.framework import time_in_turn
from tauguard.report import Row, rate
from tauguard.rigid import MeshTree, Motion, coal_peer
from tauguard.rigid.mesh import Volume

STOP = 1e-6  # gap at which the peer's advancement stops [m]: coal's own tolerance
MOST_STEPS = 1000  # after which it gives up a pair that creeps along
ADVANCED = 16  # pairs that it is asked
SAMPLES = 24  # times at which coal checks a pair that is said to stay apart


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh with the name its rows carry; its size is its box's diagonal [m]."""

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]

    @property
    def centre(self) -> NDArray[np.float64]:
        """The middle of the box. Shape (3,)."""
        return np.asarray(0.5 * (self.vertices.min(axis=0) + self.vertices.max(axis=0)))

    @property
    def size(self) -> float:
        """The diagonal of the box [m]."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))


def load(quick: bool) -> Mesh:
    """The mesh that the study runs on; the module says which.

    Raises:
        ValueError: ``TAUGUARD_MESH`` names no readable triangle mesh.
    """
    named = os.environ.get("TAUGUARD_MESH")
    data = os.environ.get("TAUGUARD_DATA")
    bunny = Path(data) / "meshes" / "stanford-bunny.obj" if data else None
    path = Path(named) if named else bunny
    if path is None or (not named and not path.is_file()):
        return generated(60 if quick else 186)
    import trimesh

    try:
        found = trimesh.load(path, force="mesh", process=False)
        return Mesh(path.stem, np.array(found.vertices, dtype=float), np.array(found.faces))
    except (OSError, ValueError, AttributeError, NotImplementedError) as error:
        raise ValueError(
            f"TAUGUARD_MESH: {path.name} is no mesh trimesh can read: {error}"
        ) from None


def generated(rows: int) -> Mesh:
    """A bumpy closed surface, ``2 rows (rows - 1)`` triangles (68,820 for 186), 0.25 m across."""
    u, v = np.meshgrid(np.arange(rows) / rows, (np.arange(rows + 1)) / rows, indexing="ij")
    along, around = 2 * np.pi * u, np.pi * v
    radius = 0.1 * (1 + 0.25 * np.sin(3 * along) * np.sin(around) ** 3 + 0.1 * np.cos(7 * around))
    direction = np.stack(
        [np.sin(around) * np.cos(along), 0.7 * np.sin(around) * np.sin(along), np.cos(around)], -1
    )
    index = np.arange(rows * (rows + 1)).reshape(rows, rows + 1)
    a, b = index[:, :-1], np.roll(index, -1, axis=0)[:, :-1]
    # At either pole one triangle of a square has no area, which coal takes for a contact.
    first, second = np.stack([a, b, a + 1], -1)[:, 1:], np.stack([a + 1, b, b + 1], -1)[:, :-1]
    faces = np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)])
    return Mesh("generated", (radius[..., None] * direction).reshape(-1, 3), faces)


def poses_near(mesh: Mesh, rng: np.random.Generator, n: int) -> NDArray[np.float64]:
    """Any turn, centres 0.35 to 0.85 sizes apart: about a third of them collide."""
    pose = np.tile(np.eye(4), (n, 1, 1))
    seed = int(rng.integers(1 << 31))
    pose[:, :3, :3] = Rotation.random(n, random_state=seed).as_matrix()
    way = rng.normal(size=(n, 3))
    way *= (rng.uniform(0.35, 0.85, n) * mesh.size / np.linalg.norm(way, axis=1))[:, None]
    pose[:, :3, 3] = mesh.centre + way - pose[:, :3, :3] @ mesh.centre
    return pose


def run(quick: bool, seed: int) -> list[Row]:
    """Rows of build, first hit, sweep and motion."""
    rng = np.random.default_rng(seed)
    mesh = load(quick)
    poses = poses_near(mesh, rng, 400 if quick else 2_000)
    try:
        peer = Peer(mesh, poses)
    except ValueError:
        peer = None
    rows = build_rows(mesh, peer, 2 if quick else 5)
    rows += static_rows(mesh, poses, peer, 3 if quick else 5)
    rows += dynamic_rows(mesh, poses, peer, rng, 40 if quick else 200)
    return rows


class Peer:
    """coal on the same mesh and poses: answers, times of single calls, a call's overhead.

    The overhead is that of two one-triangle models far apart: all that is left is the call.
    """

    def __init__(self, mesh: Mesh, poses: NDArray[np.float64]) -> None:
        """Build the model three times, ask every pose twice."""
        builds = [coal_peer.mesh(mesh.vertices, mesh.faces) for _ in range(3)]
        self.model = builds[0][0]
        self.build_ms = 1e3 * np.array([seconds for _, seconds in builds])
        far = np.tile(np.eye(4), (1000, 1, 1))
        far[:, 0, 3] = 10 * mesh.size
        one = coal_peer.mesh(mesh.vertices, mesh.faces[:1])[0]
        coal_peer.collide_mesh(self.model, self.model, poses[:100])
        self.hit, first = coal_peer.collide_mesh(self.model, self.model, poses)
        again = coal_peer.collide_mesh(self.model, self.model, poses)[1]
        self.us = 1e6 * np.minimum(first, again)
        self.call_us = float(1e6 * np.median(coal_peer.collide_mesh(one, one, far)[1]))

    def touches(self, poses: NDArray[np.float64]) -> NDArray[np.bool_]:
        """coal's answers at other poses, without hits that its own distance calls gaps."""
        hit = coal_peer.collide_mesh(self.model, self.model, poses)[0]
        for i in np.flatnonzero(hit):
            hit[i] = coal_peer.mesh_distance(self.model, self.model, poses[i]) <= 0
        return hit


def build_rows(mesh: Mesh, peer: Peer | None, repeats: int) -> list[Row]:
    """How long a tree takes with each bounding volume."""
    calls = {v: partial(MeshTree, mesh.vertices, mesh.faces, v) for v in get_args(Volume)}
    coal = None if peer is None else float(np.median(peer.build_ms))
    return [
        {
            "study": "mesh build",
            "mesh": mesh.name,
            "triangles": len(mesh.faces),
            "volume": volume,
            "build_ms": scaled(seconds, 1e3),
            "coal_obbrss_ms": "coal is not installed" if coal is None else coal,
            "times_faster": coal / (1e3 * seconds["median"]) if coal else None,
        }
        for volume, seconds in time_in_turn(calls, repeats, time.process_time).items()
    ]


def scaled(seconds: dict[str, float], factor: float) -> dict[str, float]:
    """A measured time in another unit."""
    return {name: value * factor for name, value in seconds.items()}


def static_rows(
    mesh: Mesh, poses: NDArray[np.float64], peer: Peer | None, repeats: int
) -> list[Row]:
    """First hit per volume: a batch's mean, the median of single calls, and coal's of both."""
    trees = {v: MeshTree(mesh.vertices, mesh.faces, v) for v in get_args(Volume)}
    hits = {v: tree.overlap(tree, poses).hit for v, tree in trees.items()}
    hit = hits["obb"]
    rows: list[Row] = []
    for outcome in (True, False):
        chosen = poses[hit == outcome]
        calls = {v: partial(tree.overlap, tree, chosen) for v, tree in trees.items()}
        times = time_in_turn(calls, repeats, time.process_time)
        for volume, tree in trees.items():
            mean = times[volume]["median"] / len(chosen) * 1e6
            wrong = int((hits[volume] != (hit if peer is None else peer.hit)).sum())
            rows.append(
                {
                    "study": "table 2.2 static",
                    "mesh": mesh.name,
                    "volume": volume,
                    "outcome": "collision" if outcome else "non-collision",
                    "poses": len(chosen),
                    "batch_mean_us": scaled(times[volume], 1e6 / len(chosen)),
                    "single_call_us": single_call(tree, chosen[:300]),
                    **coal_columns(peer, hit == outcome, mean),
                    "disagree": rate(wrong, len(poses)),
                }
            )
    return rows


def single_call(tree: MeshTree, poses: NDArray[np.float64]) -> float:
    """Median of one pose a call, our Python checks included [us]."""
    seconds = []
    for pose in poses:
        start = time.perf_counter()
        tree.overlap(tree, pose)
        seconds.append(time.perf_counter() - start)
    return float(np.median(seconds)) * 1e6


def coal_columns(peer: Peer | None, chosen: NDArray[np.bool_], mean_us: float) -> Row:
    """coal's times on the same poses; the ratio is of means, coal's net of its call."""
    if peer is None:
        none = dict.fromkeys(("coal_mean_us", "coal_median_us", "coal_call_us", "times_faster"))
        return {**none, "coal_mean_us": "coal is not installed"}
    mean = float(peer.us[chosen].mean())
    return {
        "coal_mean_us": mean,
        "coal_median_us": float(np.median(peer.us[chosen])),
        "coal_call_us": peer.call_us,
        "times_faster": (mean - peer.call_us) / mean_us,
    }


def dynamic_rows(
    mesh: Mesh,
    poses: NDArray[np.float64],
    peer: Peer | None,
    rng: np.random.Generator,
    n: int,
) -> list[Row]:
    """A straight sweep and one that also turns, from poses apart; coal judges the times.

    coal has no continuous query; what stands beside ours is the textbook's advancement (Mirtich
    1996) over coal's distance on the first few pairs, stopped at a gap of ``STOP``.
    """
    tree = MeshTree(mesh.vertices, mesh.faces)
    start = poses[~tree.overlap(tree, poses).hit][:n]
    away = mesh.centre - (start[:, :3, :3] @ mesh.centre + start[:, :3, 3])
    move = away * rng.uniform(0, 1.5, (len(start), 1))
    move += 0.2 * mesh.size * rng.normal(size=move.shape)
    turn = rng.uniform(-1, 1, move.shape)
    rows: list[Row] = []
    for kind, angular in (("sweep", np.zeros_like(move)), ("linear and angular", turn)):
        motion = Motion(start, move, angular)
        found = tree.time_of_impact(tree, motion)
        late, early = judged(tree, peer, motion, found.time_of_impact)
        for outcome in (True, False):
            chosen = np.flatnonzero(found.hit == outcome)
            part = Motion(start[chosen], move[chosen], angular[chosen])
            seconds = time_in_turn(
                {"toi": partial(tree.time_of_impact, tree, part)}, 2, time.process_time
            )["toi"]
            rows.append(
                {
                    "study": "table 2.2 dynamic",
                    "mesh": mesh.name,
                    "motion": kind,
                    "outcome": "collision" if outcome else "non-collision",
                    "pairs": len(chosen),
                    "us": scaled(seconds, 1e6 / max(1, len(chosen))),
                    **advancement(mesh, peer, motion, found.time_of_impact, chosen[:ADVANCED]),
                    "late_or_missed": late,
                    "not_touching_1e-7_later": early,
                }
            )
    return rows


def advancement(
    mesh: Mesh,
    peer: Peer | None,
    motion: Motion,
    toi: NDArray[np.float64],
    chosen: NDArray[np.intp],
) -> Row:
    """The peer's mean time on these pairs, distance calls alone, and how early or late it is."""
    if peer is None or len(chosen) == 0:
        return dict.fromkeys(("over_coal_us", "over_coal_toi_error_max"))
    reach = float(np.linalg.norm(mesh.vertices, axis=1).max())
    seconds, error = 0.0, 0.0
    for i in chosen:
        turn = float(np.linalg.norm(motion.angular[i]))
        speed = float(np.linalg.norm(motion.linear[i])) + turn * reach
        t = 0.0
        for _ in range(MOST_STEPS):
            pose = motion.at(np.full(len(toi), min(t, 1.0)))[i]
            start = time.process_time()
            gap = coal_peer.mesh_distance(peer.model, peer.model, pose)
            seconds += time.process_time() - start
            if gap <= STOP or t >= 1:
                break
            t += gap / speed
        if np.isfinite(toi[i]):
            error = max(error, abs(min(t, 1.0) - toi[i]))
    return {"over_coal_us": 1e6 * seconds / len(chosen), "over_coal_toi_error_max": error}


def judged(
    tree: MeshTree, peer: Peer | None, motion: Motion, toi: NDArray[np.float64]
) -> tuple[Row, Row]:
    """Pairs that touch before the time found, and pairs that do not touch 1e-7 after it.

    The exact query of one pose judges 1e-10 before and 1e-7 after; coal judges the way there, up
    to 1e-4 of the step before. To its boolean query gaps of a micrometre are hits, so its distance
    confirms them.
    """
    hit = np.isfinite(toi)
    end = np.where(hit, toi, 1.0)
    late = hit & tree.overlap(tree, motion.at(np.maximum(end - 1e-10, 0))).hit
    if peer is not None:
        for t in np.linspace(0, np.maximum(end - 1e-4, 0), SAMPLES):
            late |= peer.touches(motion.at(t))
    early = hit & ~tree.overlap(tree, motion.at(np.minimum(end + 1e-7, 1))).hit
    return rate(int(late.sum()), len(toi)), rate(int(early.sum()), int(hit.sum()))


def draw(rows: list[Row], axes: Any) -> None:
    """First hit per volume and outcome, beside coal."""
    cells = [row for row in rows if row["study"] == "table 2.2 static"]
    names = list(dict.fromkeys(row["volume"] for row in cells))
    at = np.arange(len(names))
    for k, outcome in enumerate(("collision", "non-collision")):
        part = [row for row in cells if row["outcome"] == outcome]
        us = [row["batch_mean_us"]["median"] for row in part]
        bars = axes.bar(at + 0.4 * k - 0.2, us, 0.38, label=outcome)
        if part and part[0]["coal_call_us"] is not None:
            axes.axhline(part[0]["coal_mean_us"], color=bars[0].get_facecolor(), ls="--", lw=1)
    axes.set_xticks(at, names)
    wrong = max(
        (round(row["disagree"]["value"] * row["disagree"]["n"]) for row in cells), default=0
    )
    mesh = cells[0]["mesh"] if cells else ""
    axes.set(ylabel="us a pose, mean", yscale="log")
    axes.set_title(f"{mesh}, coal dashed; {wrong} disagree", fontsize="medium")
    axes.legend(fontsize="small")
