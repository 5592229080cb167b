"""Support functions and membership of convex bodies in NumPy, and the least depth by search.

A distance is judged without computing it: the reported points must lie in their bodies, so the
distance is at most that of the points; and no direction may separate the bodies further than that.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tauguard.rigid import Boxes, Capsules, Cones, Cylinders, Distances, Ellipsoids, Hulls, Spheres

Array = NDArray[np.float64]
#: Bounded kinds, by name.
NAMES = ("boxes", "hulls", "spheres", "capsules", "cylinders", "cones", "ellipsoids")
CURVED = ("cylinders", "cones", "ellipsoids")


class Sets:
    """N convex sets: local numbers, and the frames that place them."""

    def __init__(self, kind: str, rng: np.random.Generator, n: int, spread: float = 1.0) -> None:
        self.kind, self.n = kind, n
        self.center = spread * rng.uniform(-1, 1, (n, 3))
        self.rotation = Rotation.random(n, rng=rng).as_matrix()
        flat = 10 ** rng.uniform(-2, 0, n)  # slender and flat bodies, too
        self.size = rng.uniform(0.1, 1, (n, 3))
        self.size[np.arange(n), rng.integers(0, 3, n)] *= flat
        self.points = rng.uniform(-1, 1, (n, 12, 3)) * self.size[:, None]

    def at(self, rows: NDArray[np.int64]) -> "Sets":
        """Some of the sets."""
        out = object.__new__(Sets)
        out.kind, out.n = self.kind, len(rows)
        out.center, out.rotation = self.center[rows], self.rotation[rows]
        out.size, out.points = self.size[rows], self.points[rows]
        return out

    def bodies(self):  # type: ignore[no-untyped-def]
        """The batch of the product."""
        c, r, s = self.center, self.rotation, self.size
        if self.kind == "boxes":
            return Boxes(c, s, r)
        if self.kind == "hulls":
            return Hulls(self.world(self.points).reshape(-1, 3), 12 * np.arange(self.n + 1))
        if self.kind == "spheres":
            return Spheres(c, s[:, 0])
        if self.kind == "capsules":
            along = s[:, 1:2] * r[:, :, 2]
            return Capsules(c - along, c + along, s[:, 0])
        if self.kind == "cylinders":
            return Cylinders(c, s[:, 0], s[:, 1], r)
        if self.kind == "cones":
            return Cones(c, s[:, 0], s[:, 1], r)
        return Ellipsoids(c, s, r)

    def world(self, x: Array) -> Array:
        """Local points (N, M, 3) in the common frame."""
        return np.einsum("nij,nmj->nmi", self.rotation, x) + self.center[:, None]

    def height(self, d: Array) -> Array:
        """The support function: the largest d . x for directions d (N, M, 3). Shape (N, M)."""
        e = np.einsum("nji,nmj->nmi", self.rotation, d)
        s = self.size[:, None]
        across, base = np.hypot(e[..., 0], e[..., 1]), np.einsum("ni,nmi->nm", self.center, d)
        if self.kind == "boxes":
            return base + (np.abs(e) * s).sum(axis=2)
        if self.kind == "hulls":
            return base + np.einsum("nmi,nki->nmk", e, self.points).max(axis=2)
        if self.kind == "spheres":
            return base + s[..., 0] * np.linalg.norm(d, axis=2)
        if self.kind == "capsules":
            return base + s[..., 0] * np.linalg.norm(d, axis=2) + s[..., 1] * np.abs(e[..., 2])
        if self.kind == "cylinders":
            return base + s[..., 0] * across + s[..., 1] * np.abs(e[..., 2])
        if self.kind == "cones":
            rim = s[..., 0] * across - s[..., 1] * e[..., 2]
            return base + np.maximum(s[..., 1] * e[..., 2], rim)
        return base + np.linalg.norm(e * s, axis=2)

    def outside(self, x: Array) -> Array:
        """A bound on how far points (N, 3) are outside of the sets; 0 inside. Not for hulls."""
        y, s = np.einsum("nji,nj->ni", self.rotation, x - self.center), self.size
        across = np.hypot(y[:, 0], y[:, 1])
        if self.kind == "boxes":
            return np.maximum(np.abs(y) - s, 0).max(axis=1)
        if self.kind == "spheres":
            return np.maximum(np.linalg.norm(y, axis=1) - s[:, 0], 0)
        if self.kind == "capsules":
            z = np.maximum(np.abs(y[:, 2]) - s[:, 1], 0)
            return np.maximum(np.hypot(across, z) - s[:, 0], 0)
        if self.kind == "cylinders":
            return np.maximum(np.maximum(across - s[:, 0], np.abs(y[:, 2]) - s[:, 1]), 0)
        if self.kind == "cones":
            length = np.hypot(s[:, 0], 2 * s[:, 1])
            side = (2 * s[:, 1] * across - s[:, 0] * (s[:, 1] - y[:, 2])) / length
            return np.maximum(np.maximum(side, -s[:, 1] - y[:, 2]), 0)
        if self.kind == "ellipsoids":  # to first order: the value over the gradient
            q = y / s
            value, slope = (q**2).sum(axis=1) - 1, 2 * np.linalg.norm(q / s, axis=1)
            return np.maximum(value, 0) / np.maximum(slope, 1e-300)
        raise ValueError(self.kind)


def separation(a: Sets, b: Sets, n: Array) -> Array:
    """How far directions n (N, M, 3) separate the sets; negative: the translation that does."""
    return -a.height(n) - b.height(-n)


def sphere(count: int) -> Array:
    """Directions spread over the sphere (a Fibonacci lattice). Shape (count, 3)."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


def best_separation(
    a: Sets, b: Sets, start: Array, directions: int = 300, kept: int = 4, rounds: int = 60
) -> Array:
    """The largest separation found by a compass search from a lattice and from ``start`` (N, 3)."""
    lattice = np.broadcast_to(sphere(directions), (a.n, directions, 3))
    values = separation(a, b, lattice)
    rows = np.argsort(-values, axis=1)[:, :kept]
    n = np.concatenate([np.take_along_axis(lattice, rows[..., None], axis=1), start[:, None]], 1)
    value = separation(a, b, n)
    step = np.full(value.shape, 0.1)
    step[:, kept:] = 1e-3
    for _ in range(rounds):
        u = np.cross(n, np.eye(3)[np.abs(n).argmin(axis=2)])
        u /= np.linalg.norm(u, axis=2, keepdims=True)
        v = np.cross(n, u)
        better = np.zeros(value.shape, dtype=bool)
        for angle in np.arange(8) * np.pi / 4:
            m = n + step[..., None] * (np.cos(angle) * u + np.sin(angle) * v)
            m /= np.linalg.norm(m, axis=2, keepdims=True)
            x = separation(a, b, m)
            up = x > value
            n, value = np.where(up[..., None], m, n), np.where(up, x, value)
            better |= up
        step = np.where(better, step, 0.5 * step)
    return value.max(axis=1)


def errors_of(a: Sets, b: Sets, got: Distances, searched: int) -> Array:
    """Errors of distances relative to the size of each pair. Shape (4, N).

    The separation along the normal, points outside of their body, the segment between the points
    (apart), and a shorter translation that a search finds for the first ``searched`` overlaps.
    """
    reach = np.linalg.norm(a.size, axis=1) + np.linalg.norm(b.size, axis=1)
    size = np.linalg.norm(a.center - b.center, axis=1) + reach
    low = np.abs(got.distance - separation(a, b, got.normal[:, None])[:, 0]) / size
    outside = np.zeros(a.n)
    for sets, point in ((a, got.point_a), (b, got.point_b)):
        if sets.kind != "hulls":
            outside = np.maximum(outside, sets.outside(point) / size)
    segment = np.linalg.norm(got.point_b - got.point_a, axis=1)
    high = np.where(got.distance > 0, np.abs(segment - got.distance) / size, 0)
    rows, missed = np.flatnonzero(got.distance <= 0)[:searched], np.zeros(a.n)
    if len(rows):
        best = best_separation(a.at(rows), b.at(rows), got.normal[rows])
        missed[rows] = (best - got.distance[rows]) / size[rows]
    return np.stack([low, outside, high, missed])
