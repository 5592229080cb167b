"""Degenerate pairs of a vertex and a face, or of two edges, that touch at a known time.

All coordinates are small multiples of powers of two, so that the contact is exact. Each feature
moves without deformation, in a direction of its own.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Random = np.random.Generator


def _vectors(rng: Random, n: int) -> Array:
    """Vectors of integers, none of them zero. Shape (n, 3)."""
    vectors = rng.integers(-4, 5, (n, 3)).astype(float)
    vectors[(vectors == 0).all(axis=1)] = [1, 2, -1]
    return vectors


def _quarters(rng: Random, n: int, low: int = 0, high: int = 4) -> Array:
    return rng.integers(low, high + 1, (n, 1)) / 4


def _vertex_and(face: Array, weights: Array) -> Array:
    """The point of the weights, in front of the face. Shape (n, 4, 3)."""
    return np.concatenate([np.einsum("nk,nkj->nj", weights, face)[:, None], face], axis=1)


def _weights(rng: Random, n: int, corners: int) -> Array:
    """Weights that are quarters, for the first ``corners`` of three vertices. Shape (n, 3)."""
    counts = rng.multinomial(4, np.full(corners, 1 / corners), size=n) / 4
    return np.pad(counts, ((0, 0), (0, 3 - corners)))


def _on_face(rng: Random, n: int) -> Array:
    return _vertex_and(rng.integers(-4, 5, (n, 3, 3)).astype(float), _weights(rng, n, 3))


def _on_edge_of_face(rng: Random, n: int) -> Array:
    return _vertex_and(rng.integers(-4, 5, (n, 3, 3)).astype(float), _weights(rng, n, 2))


def _on_vertex_of_face(rng: Random, n: int) -> Array:
    return _vertex_and(rng.integers(-4, 5, (n, 3, 3)).astype(float), _weights(rng, n, 1))


def _collinear_face(rng: Random, n: int) -> Array:
    along = rng.integers(-4, 5, (n, 3, 1)) * _vectors(rng, n)[:, None]
    return _vertex_and(rng.integers(-4, 5, (n, 1, 3)) + along, _weights(rng, n, 3))


def _face_of_one_point(rng: Random, n: int) -> Array:
    return np.repeat(_vectors(rng, n)[:, None], 4, axis=1)


def _sliver(rng: Random, n: int) -> Array:
    """A collinear face with one vertex moved aside by 2^-20 to 2^-40."""
    face = _collinear_face(rng, n)[:, 1:]
    face[:, 2] += np.ldexp(_vectors(rng, n), -rng.integers(20, 41, (n, 1)))
    return _vertex_and(face, _weights(rng, n, 3))


def _edges(a: Array, b: Array, along_a: Array, along_b: Array) -> Array:
    return np.stack([a, a + along_a, b, b + along_b], axis=1)


def _crossing(rng: Random, n: int) -> Array:
    first, second, at = _vectors(rng, n), _vectors(rng, n), _vectors(rng, n)
    return _edges(at - _quarters(rng, n) * first, at - _quarters(rng, n) * second, first, second)


def _nearly_parallel(rng: Random, n: int) -> Array:
    first, at = _vectors(rng, n), _vectors(rng, n)
    second = 2 * first + np.ldexp(_vectors(rng, n), -rng.integers(10, 41, (n, 1)))
    return _edges(at - _quarters(rng, n) * first, at - _quarters(rng, n) * second, first, second)


def _parallel(rng: Random, n: int) -> Array:
    """On one line, with an overlap that may be a single point; in either direction."""
    first, at = _vectors(rng, n), _vectors(rng, n)
    second = first * rng.choice([-2.0, -1.0, -0.5, 0.25, 1.0, 3.0], (n, 1))
    return _edges(at - _quarters(rng, n) * first, at - _quarters(rng, n) * second, first, second)


def _end_to_end(rng: Random, n: int) -> Array:
    at = _vectors(rng, n)
    return _edges(at, at, _vectors(rng, n), _vectors(rng, n))


def _end_on_edge(rng: Random, n: int) -> Array:
    at, second = _vectors(rng, n), _vectors(rng, n)
    return _edges(at, at - _quarters(rng, n) * second, _vectors(rng, n), second)


def _short_edge(rng: Random, n: int) -> Array:
    """The first edge has no length."""
    at, second = _vectors(rng, n), _vectors(rng, n)
    return _edges(at, at - _quarters(rng, n) * second, 0 * at, second)


def _short_edges(rng: Random, n: int) -> Array:
    at = _vectors(rng, n)
    return _edges(at, at, 0 * at, 0 * at)


#: For each kind: whether it is a vertex and a face, and the positions at contact, (n, 4, 3).
KINDS: dict[str, tuple[bool, Callable[[Random, int], Array]]] = {
    "vertex on face": (True, _on_face),
    "vertex on edge of face": (True, _on_edge_of_face),
    "vertex on vertex of face": (True, _on_vertex_of_face),
    "vertex on collinear face": (True, _collinear_face),
    "vertex on face of one point": (True, _face_of_one_point),
    "vertex on sliver": (True, _sliver),
    "crossing edges": (False, _crossing),
    "nearly parallel edges": (False, _nearly_parallel),
    "parallel edges": (False, _parallel),
    "edges end to end": (False, _end_to_end),
    "end on edge": (False, _end_on_edge),
    "edge without length": (False, _short_edge),
    "two edges without length": (False, _short_edges),
}


def touching(kind: str, seed: int, n: int) -> tuple[bool, Array, Array]:
    """Pairs of one kind: whether they are a vertex and a face, and both ends of the step.

    Returns:
        ``vertex``, and ``x_t0``, ``x_t1`` of shape (n, 4, 3). Each pair touches at t = 0, 1/4, 1/2
        or 1. A third of the pairs moves along the first edge of its second feature.
    """
    rng = np.random.default_rng(seed)
    vertex, make = KINDS[kind]
    at, first = make(rng, n), 1 if vertex else 2
    velocity = np.repeat(_vectors(rng, n)[:, None], 4, axis=1)
    velocity[:, first:] = _vectors(rng, n)[:, None]
    sliding = rng.random(n) < 1 / 3
    velocity[sliding, :first] = (at[:, -1] - at[:, -2])[sliding, None]
    velocity[rng.random(n) < 0.1] = 0
    t = rng.choice([0, 0.25, 0.5, 1], (n, 1, 1))
    return vertex, at - t * velocity, at + (1 - t) * velocity


def gap_of_weights(
    vertex: bool, x_t0: Array, x_t1: Array, toi: Array, point: Array, weights: Array
) -> tuple[Array, Array]:
    """Distances of ``point`` from the two points that the weights give at ``toi``, and a bound.

    ``toi`` may be 1e-9 of the step early. Within this time, features that move by at most M along
    each axis, relative to the first vertex, approach by 2e-9 sqrt(3) M < 2^-28 M. Rounding of
    positions and weights adds less than 2^-43 of the largest coordinate.
    """
    x = x_t0 + toi[:, None, None] * (x_t1 - x_t0)
    first = 1 if vertex else 2
    points = [
        np.einsum("nk,nkj->nj", weights[:, part], x[:, part])
        for part in (slice(0, first), slice(first, None))
    ]
    gap = np.max([np.linalg.norm(p - point, axis=1) for p in points], axis=0)
    moved = x_t1 - x_t0
    relative = np.abs(moved - moved[:, :1]).max(axis=(1, 2), initial=0)
    size = np.abs(np.stack([x_t0, x_t1])).max(axis=(0, 2, 3), initial=0)
    return gap, 2**-28 * relative + 2**-43 * size


def distance_to_feature(point: Array, corners: Array) -> Array:
    """Distance of each point (n, 3) from a point, segment or triangle, corners (n, k, 3)."""
    k = corners.shape[1]
    gaps = [np.linalg.norm(point - corners[:, i], axis=1) for i in range(k)]
    for i in range(k):
        for j in range(i):
            along = corners[:, j] - corners[:, i]
            square = np.einsum("nj,nj->n", along, along)
            s = np.einsum("nj,nj->n", point - corners[:, i], along)
            s = np.clip(s / np.where(square > 0, square, 1), 0, 1)
            foot = corners[:, i] + s[:, None] * along
            gaps.append(np.linalg.norm(point - foot, axis=1))
    if k == 3:
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = np.linalg.norm(normal, axis=1)
        inside = size > 0
        for i in range(3):
            side = np.cross(corners[:, i - 2] - corners[:, i], point - corners[:, i])
            inside &= np.einsum("nj,nj->n", side, normal) >= 0
        height = np.abs(np.einsum("nj,nj->n", point - corners[:, 0], normal))
        gaps.append(np.where(inside, height / np.where(inside, size, 1), np.inf))
    return np.min(gaps, axis=0)
