"""Which queries break a narrow phase? Vertex-face and edge-edge queries near every degeneracy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Positions = NDArray[np.float64]  # (n, 2, 4, 3): both ends of the step, four vertices
Make = Callable[[np.random.Generator, int, bool], Positions]


def _random(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    return rng.normal(size=(n, 2, 4, 3))


def _lattice(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    """Small integers: many touch, are coplanar, parallel, or have no area or length."""
    return rng.integers(-2, 3, size=(n, 2, 4, 3)).astype(float)


def _rounded_lattice(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    return _lattice(rng, n, vertex) / 3


def _flat(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    """All points stay in one plane, so that the coplanarity cubic vanishes identically."""
    return np.asarray(_random(rng, n, vertex) * np.array([1, 1, 0]))


def _tilted(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    """In one plane except for rounding."""
    axes, _ = np.linalg.qr(rng.normal(size=(n, 1, 3, 3)))
    return np.asarray(_flat(rng, n, vertex) @ axes)


def _touching(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    """Touch at a random time on the boundary of both features, up to rounding."""
    x = _random(rng, n, vertex)
    t = rng.random((n, 1))
    w = rng.random((n, 2)) * rng.integers(0, 2, size=(n, 2))
    now = (1 - t[..., None]) * x[:, 0] + t[..., None] * x[:, 1]
    if vertex:
        point = now[:, 1] + w[:, :1] * (now[:, 2] - now[:, 1])
    else:
        other = now[:, 2] + w[:, 1:] * (now[:, 3] - now[:, 2])
        point = (other - w[:, :1] * now[:, 1]) / (1 - w[:, :1])
    x[:, 1, 0] = (point - (1 - t) * x[:, 0, 0]) / t
    return x


def _parallel(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    """Moving parallel edges, or a moving face without area."""
    x = _random(rng, n, vertex)
    x[:, :, 3] = x[:, :, 2] + rng.normal(size=(n, 1, 1)) * (x[:, :, 1] - x[:, :, 0])
    if vertex:
        x[:, :, 3] = x[:, :, 1] + rng.normal(size=(n, 1, 1)) * (x[:, :, 2] - x[:, :, 1])
    x[::2] *= np.array([1, 1, 0])  # half of them in one plane, where they can meet
    return x


def _still(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    """No motion; some touch, some do not."""
    x = rng.integers(-2, 3, size=(n, 2, 4, 3)).astype(float)
    x[:, 1] = x[:, 0]
    return x


def _slow(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    """Like :func:`_still`, followed by a tiny motion."""
    x = _still(rng, n, vertex)
    x[:, 1] += 10.0 ** rng.integers(-14, -1, size=(n, 1, 1)) * rng.normal(size=(n, 4, 3))
    return x


def _thin(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    return np.asarray(_random(rng, n, vertex) * np.array([1, 1, 1e-9]))


def _far(offset: float) -> Make:
    return lambda rng, n, vertex: _random(rng, n, vertex) + offset


#: By name: a function of a generator, a count and whether vertex-face; gives positions.
KINDS: dict[str, Make] = {
    "random": _random,
    "lattice": _lattice,
    "lattice / 3": _rounded_lattice,
    "flat": _flat,
    "flat, tilted": _tilted,
    "touching": _touching,
    "parallel": _parallel,
    "still": _still,
    "slow": _slow,
    "thin": _thin,
    "offset 1e6": _far(1e6),
    "offset 1e10": _far(1e10),
}
