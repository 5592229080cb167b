"""The part of a step without contact, found by looking at growing parts of the step."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from tauguard.cloth import _mesh
from tauguard.cloth.frame import Frame
from tauguard.cloth.impacts import Impacts

Array = NDArray[np.float64]

#: Bound on rounding of a projected difference of positions, relative to the largest coordinate:
#: three differences, three products, two sums and the normalisation, each with an error of 2^-53.
ROUNDING = 2.0**-48


def safe_fraction(
    find: Callable[[Array, int], Frame],
    parts_of: Callable[[Frame], list[tuple[NDArray[np.int32], int, Impacts]]],
    start: Array,
    end: Array,
    edges: NDArray[np.int32],
    fraction: float,
    budget: int,
    most: int,
) -> float:
    """A fraction ``s`` such that the step from ``start``, scaled by ``s``, has no contact.

    The whole step is tried first. If it has more than ``budget`` collisions, the search continues
    with a part in which a vertex moves, on average, by a quarter of an edge; this part is doubled
    until it has a collision. So computing time and memory are in proportion to what happens before
    the first collision.

    Args:
        find: Collisions of the step to given positions, with a limit of their number.
        parts_of: The collisions by kind: vertices (N, k), how many of them belong to the first
            feature, and impacts.
        start, end: Positions, shape (V, 3).
        edges: Vertices of edges, shape (E, 2).
        fraction: Part of the time until the first contact that is used.
        budget: Number of collisions of a kind that a part may have before it is divided.
        most: The limit of the number of collisions, if a part cannot be divided.

    Raises:
        TooManyError: more than ``most`` collisions in the smallest part.
    """
    move = end - start
    scale, safe, reduced = 1.0, 0.0, False
    while scale > 0:
        reach = end if scale == 1 else start + scale * move
        if np.array_equal(reach, start) and scale < 1:
            return 0.0
        try:
            first = _first_time(parts_of(find(reach, budget)), start, reach)
        except _mesh.TooManyError:
            smaller = scale / 8 if scale < 1 else _quarter_of_an_edge(start, move, edges)
            if safe == 0 and not np.array_equal(start + smaller * move, start):
                scale = smaller
            elif budget < most:
                budget = min(most, 4 * budget)
            else:
                raise
            continue
        if first <= 1:
            scale *= fraction * first
            reduced = True
        elif scale == 1 or reduced:
            return scale
        else:
            safe, scale = scale, min(1.0, 2 * scale)
    return 0.0


def _quarter_of_an_edge(start: Array, move: Array, edges: NDArray[np.int32]) -> float:
    """The part of the step in which a vertex moves by a quarter of an edge, on average."""
    with np.errstate(all="ignore"):
        length = np.abs(start[edges[:, 1]] - start[edges[:, 0]]).max(axis=1).mean()
        share = 0.25 * length / np.abs(move - move.mean(axis=0)).max(axis=1).mean()
    return float(share) if 0 < share < 0.125 else 0.125


def _first_time(
    kinds: list[tuple[NDArray[np.int32], int, Impacts]], start: Array, end: Array
) -> float:
    """The first contact; features that touch at the start and move apart have none."""
    first = np.inf
    for vertices, count, impacts in kinds:
        toi = impacts.toi
        at_start = np.flatnonzero(toi == 0)
        if len(at_start):
            rows = vertices[at_start]
            ends = start[rows], end[rows]
            apart = moving_apart(*ends, count, impacts.weights[at_start])
            toi = np.delete(toi, at_start[apart])
        first = min(first, float(toi.min(initial=np.inf)))
    return first


def moving_apart(start: Array, end: Array, count: int, weights: Array) -> NDArray[np.bool_]:
    """Whether the distance of two features never shrinks, and they are apart at the end.

    It is so if all differences between a vertex of one feature and one of the other, projected on
    a direction along which the features are apart (or touch) at the start, do not shrink. For
    features that are apart the direction is that of their nearest points. For features that touch,
    the directions along which all differences and their changes are at least 0 form a cone. The
    sum of its edges is used.

    Args:
        start, end: Positions at both ends of the step, shape (N, k, 3).
        count: The first ``count`` of the k vertices belong to the first feature.
        weights: Those of the nearest points at the start, shape (N, k).
    """
    k = start.shape[1]
    pairs = [(i, j) for i in range(count) for j in range(count, k)]
    a, b = np.transpose(pairs)
    gaps, later = start[:, b] - start[:, a], end[:, b] - end[:, a]
    rounding = ROUNDING * np.abs(np.stack([start, end])).max(axis=(0, 2, 3), initial=0)
    signed = np.where(np.arange(k) < count, -weights, weights)
    nearest = np.einsum("nk,nkj->nj", signed, start)
    touching = np.linalg.norm(nearest, axis=1) <= 16 * rounding
    direction = np.where(touching[:, None], _inner_direction(gaps, later - gaps, rounding), nearest)
    direction = _unit(direction[:, None])[:, 0]
    before, after = (np.einsum("nmj,nj->nm", x, direction) for x in (gaps, later))
    opens = (after - before >= -rounding[:, None]).all(axis=1)
    clear = (before >= -16 * rounding[:, None]).all(axis=1)
    return np.asarray(opens & clear & (after.min(axis=1) > 16 * rounding))


def _inner_direction(gaps: Array, change: Array, rounding: Array) -> Array:
    """A direction inside the cone of those on which no gap and no change is negative; 0: none."""
    h = np.concatenate([gaps, change], axis=1)
    crosses = [np.cross(h[:, i], h[:, j]) for i, j in combinations(range(h.shape[1]), 2)]
    normals = np.stack(crosses, axis=1)
    largest = np.linalg.norm(normals, axis=2).argmax(axis=1)
    plane = normals[np.arange(len(h)), largest]
    rays = np.concatenate([normals, h, np.cross(plane[:, None], h)], axis=1)
    rays = _unit(np.concatenate([rays, -rays], axis=1))
    inside = (np.einsum("nrj,nmj->nrm", rays, h) >= -rounding[:, None, None]).all(axis=2)
    return np.asarray(np.einsum("nr,nrj->nj", inside.astype(float), rays))


def _unit(vectors: Array) -> Array:
    """Vectors divided by their lengths; those of length 0 stay 0. Shape (N, m, 3)."""
    vectors = vectors / np.maximum(np.abs(vectors).max(axis=2, keepdims=True), 2.0**-1022)
    length = np.linalg.norm(vectors, axis=2, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1))
