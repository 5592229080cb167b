"""Pairs of random bodies: by outcome, with radii, in motion; and rows of batches of them."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from oracles.convex_bodies import KINDS
from oracles.convex_overlap import exact_vertices, truth
from tauguard.arrays import Array
from tauguard.rigid import Boxes, Capsules, Motion, Rounded, Spheres, Tetrahedra
from tauguard.rigid.queries import native_overlap
from tauguard.rigid.rounded import Solid, parts
from tauguard.rigid.shapes import Bodies

Batch = TypeVar("Batch", bound=Solid | Motion)

REST = Motion(np.eye(4), np.zeros(3), np.zeros(3))


def take(batch: Batch, index: NDArray[Any]) -> Batch:
    """The chosen rows of a batch of bodies or motions; a batch of one stands for every row."""
    index = np.zeros_like(index) if len(batch) == 1 else index
    fields = [getattr(batch, field.name) for field in dataclasses.fields(batch) if field.init]
    fields = [x[index] if isinstance(x, np.ndarray) else take(x, index) for x in fields]
    return type(batch)(*fields)


def join(batches: list[Bodies]) -> Bodies:
    """One batch of several of the same kind."""
    kind = type(batches[0])
    names = [field.name for field in dataclasses.fields(kind) if field.init]
    return kind(*(np.concatenate([getattr(part, name) for part in batches]) for name in names))


def shifted(bodies: Batch, by: Array) -> Batch:
    """The same bodies moved by ``by``, shape (N, 3) or (3,)."""
    places = {"center": by, "start": by, "end": by, "vertices": by[..., None, :]}
    moved = {
        name: getattr(bodies, name) + shift
        for name, shift in places.items()
        if hasattr(bodies, name)
    }
    return dataclasses.replace(bodies, **moved)


def random_bodies(
    rng: np.random.Generator, kind: str, n: int, reach: float, size: float = 1.0
) -> Solid:
    """N random bodies of about ``size`` [m], each coordinate of a centre within ``reach``."""
    center = rng.uniform(-reach, reach, (n, 3))
    radius = rng.uniform(0.05, 0.4, n) * size
    if kind == "spheres":
        return Spheres(center, radius)
    if kind == "capsules":
        half = rng.normal(size=(n, 3)) * 0.4 * size
        return Capsules(center - half, center + half, radius)
    if kind == "tetrahedra":
        return Tetrahedra(center[:, None] + rng.uniform(-1, 1, (n, 4, 3)) * size)
    rotation = Rotation.random(n, random_state=int(rng.integers(1 << 31))).as_matrix()
    boxes = Boxes(center, rng.uniform(0.1, 0.7, (n, 3)) * size, rotation)
    return boxes if kind == "boxes" else Rounded(boxes, 0.5 * radius)


def random_motions(rng: np.random.Generator, n: int, distance: float, speed: float) -> Motion:
    """N motions from ``distance`` [m] away towards the origin, turning by up to 2 rad."""
    direction = rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    pose = np.tile(np.eye(4), (n, 1, 1))
    seed = int(rng.integers(1 << 31))
    pose[:, :3, :3] = Rotation.random(n, random_state=seed).as_matrix()
    pose[:, :3, 3] = distance * direction
    aim = -speed * direction + 0.3 * distance * rng.normal(size=(n, 3))
    return Motion(pose, aim, rng.uniform(-1.2, 1.2, (n, 3)))


def farthest(solid: Solid) -> Array:
    """Largest distance of a body's points from the origin of its frame [m]. Shape (N,)."""
    core, radius = parts(solid)
    corners = (exact_vertices(core, i)[0] for i in range(len(solid)))
    reach = [max(float(sum(x * x for x in p)) for p in points) ** 0.5 for points in corners]
    return np.asarray(np.array(reach) + radius)


def pairs_by_outcome(
    rng: np.random.Generator, pair: tuple[str, str], per_cell: int, exact: int
) -> list[tuple[str, Bodies, Bodies]]:
    """``per_cell`` pairs that collide and as many that do not, by an independent reference."""
    found: dict[bool, list[tuple[Bodies, Bodies]]] = {True: [], False: []}
    have = {True: 0, False: 0}
    chunk = min(per_cell, 100_000)
    while min(have.values()) < per_cell:
        a, b = KINDS[pair[0]](rng, chunk), KINDS[pair[1]](rng, chunk)
        # The code under test guesses which pairs the cells still need; the truth alone places them.
        guess = native_overlap(a, b, "auto")[0]
        wanted = [np.flatnonzero(guess == k)[: per_cell - have[k]] for k in (True, False)]
        a, b = (take(side, np.concatenate(wanted)) for side in (a, b))
        hit = truth(a, b, sample=(exact * len(a) // (2 * per_cell), 0))
        for outcome in (True, False):
            index = np.flatnonzero(hit == outcome)[: per_cell - have[outcome]]
            if len(index):
                found[outcome].append((take(a, index), take(b, index)))
                have[outcome] += len(index)
    return [
        (
            "collision" if hit else "non-collision",
            join([a for a, _ in parts]),
            join([b for _, b in parts]),
        )
        for hit, parts in found.items()
    ]


def moving_pairs(
    rng: np.random.Generator, kind: str, n: int
) -> tuple[Bodies, Bodies, Motion, Motion]:
    """Bodies about 2 m apart that move by up to 2 m and turn by less than half a turn."""

    def body() -> Bodies:
        if kind == "tetrahedra":
            return Tetrahedra(rng.uniform(-1, 1, (n, 4, 3)))
        rotation = np.tile(np.eye(3), (n, 1, 1))
        return Boxes(np.zeros((n, 3)), rng.uniform(0.2, 1, (n, 3)), rotation)

    def motion() -> Motion:
        pose = np.tile(np.eye(4), (n, 1, 1))
        seed = int(rng.integers(1 << 31))
        pose[:, :3, :3] = Rotation.random(n, random_state=seed).as_matrix()
        pose[:, :3, 3] = rng.uniform(-2.5, 2.5, (n, 3))
        return Motion(pose, rng.uniform(-2, 2, (n, 3)), rng.uniform(-1.8, 1.8, (n, 3)))

    return body(), body(), motion(), motion()
