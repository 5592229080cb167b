"""Pairs of bodies whose sizes differ by any factor, and the errors of their signed distances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from oracles.convex_distance import exact_distance, extent
from oracles.convex_impact import exact_toi
from tauguard.arrays import Array
from tauguard.rigid import (
    Boxes,
    Capsules,
    Hulls,
    MeshTree,
    Motion,
    Parallelepipeds,
    Rounded,
    Spheres,
    Tetrahedra,
    distance,
    time_of_impact,
)
from tauguard.rigid.rounded import Solid
from tauguard.rigid.shapes import Bodies

KINDS = (
    "tetrahedra",
    "boxes",
    "parallelepipeds",
    "hulls",
    "segments",
    "spheres",
    "capsules",
    "rounded tetrahedra",
    "rounded boxes",
)
#: Larger body over smaller: powers of ten.
RATIOS = (-12.0, 12.0)
#: Share of an error of the pair's extent that the query's documentation allows.
BOUND = 3e-14


def _numbers(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Small integers for one half of the draws, which touch and are flat often, else reals."""
    if rng.random() < 0.5:
        return rng.integers(-7, 8, shape).astype(float)
    return rng.uniform(-7, 7, shape)


def _turn(rng: np.random.Generator) -> Array:
    if rng.random() < 0.3:
        return np.eye(3)
    return np.asarray(Rotation.random(random_state=int(rng.integers(1 << 31))).as_matrix())


def drawn(rng: np.random.Generator, kind: str, size: float, shift: Array) -> Solid:
    """One body of about ``size`` [m], its numbers moved by ``shift``."""
    if kind.startswith("rounded"):
        core = drawn(rng, kind.removeprefix("rounded "), size, shift)
        return Rounded(core, _radius(rng, size))  # type: ignore[arg-type]
    if kind == "boxes":
        half = np.abs(_numbers(rng, (1, 3))) * size * 10.0 ** -rng.integers(0, 4, 3)
        return Boxes(_numbers(rng, (1, 3)) * size + shift, half, _turn(rng)[None])
    if kind == "parallelepipeds":
        edges = _numbers(rng, (1, 3, 3)) * size
        return Parallelepipeds(_numbers(rng, (1, 3)) * size + shift, edges)
    count = {"tetrahedra": 4, "segments": 2, "spheres": 1, "capsules": 2}.get(
        kind, int(rng.integers(1, 8))
    )
    points = _numbers(rng, (count, 3)) * size + shift
    if kind == "tetrahedra":
        return Tetrahedra(points[None])
    if kind == "spheres":
        return Spheres(points, _radius(rng, size))
    if kind == "capsules":
        return Capsules(points[:1], points[1:], _radius(rng, size))
    return Hulls(points, [0, count])


def _radius(rng: np.random.Generator, size: float) -> float:
    return float(size * 10.0 ** rng.uniform(-9, 1)) if rng.random() < 0.8 else 0.0


def moved(solid: Solid, shift: Array) -> Solid:
    """The same body at another place."""
    if isinstance(solid, Rounded):
        return replace(solid, core=moved(solid.core, shift))
    names = ("center", "origin", "vertices", "start", "end")
    return replace(
        solid, **{name: getattr(solid, name) + shift for name in names if hasattr(solid, name)}
    )


def pair(rng: np.random.Generator, kinds: tuple[str, str]) -> tuple[Solid, Solid]:
    """Two bodies, the second larger by a factor of 1e-12 to 1e12, most of them near contact."""
    ratio = float(10.0 ** rng.uniform(*RATIOS))
    sizes = (1.0, ratio) if rng.random() < 0.5 else (float(2.0 ** rng.integers(-20, 21)), ratio)
    a = drawn(rng, kinds[0], sizes[0], np.zeros(3))
    # Bodies of one origin are in each other or near; the smaller one may lie on the larger.
    b = drawn(rng, kinds[1], sizes[1], np.zeros(3))
    if rng.random() < 0.6:
        near = distance(a, b)
        if np.isfinite(near.normal).all():
            gap = -near.distance[0] * near.normal[0]
            small = min(sizes) * 10.0 ** rng.uniform(-6, 1)
            b = moved(b, gap + small * rng.choice([-1, 0, 1]) * near.normal[0])
    return a, b


def swapped(a: Solid, b: Solid) -> tuple[Solid, Solid]:
    """The same pair in the other order."""
    return b, a


def scaled(power: int) -> Callable[[Solid, Solid], tuple[Solid, Solid]]:
    """The same pair, all lengths times a power of two."""
    names = ("center", "half_extents", "origin", "edges", "vertices", "start", "end", "radius")

    def one(solid: Solid) -> Solid:
        if isinstance(solid, Rounded):
            return Rounded(one(solid.core), solid.radius * 2.0**power)  # type: ignore[arg-type]
        fields = {name: getattr(solid, name) * 2.0**power for name in names if hasattr(solid, name)}
        return replace(solid, **fields)

    return lambda a, b: (one(a), one(b))


def permuted(a: Solid, b: Solid) -> tuple[Solid, Solid]:
    """The same pair with the axes x, y, z renamed y, z, x."""

    def one(solid: Solid) -> Solid:
        if isinstance(solid, Rounded):
            return replace(solid, core=one(solid.core))
        if isinstance(solid, Boxes):
            turned = solid.rotation[:, [1, 2, 0]]
            return Boxes(solid.center[:, [1, 2, 0]], solid.half_extents, turned)
        names = ("origin", "edges", "vertices", "center", "start", "end")
        fields = {
            name: getattr(solid, name)[..., [1, 2, 0]] for name in names if hasattr(solid, name)
        }
        return replace(solid, **fields)

    return one(a), one(b)


class Judged(NamedTuple):
    """Answers to one pair in all its forms, beside the truth."""

    error: float  #: largest, as a share of the pair's extent
    signs: int  #: wrong ones
    answers: int  #: how many forms were asked


def judged(a: Solid, b: Solid, power: int) -> Judged:
    """Ask for the distance of a pair as it is, swapped, scaled by ``2 ** power`` and permuted."""
    truth, size = exact_distance(a, b, 0), extent(a, b, 0)
    forms = [(a, b), swapped(a, b), scaled(power)(a, b), permuted(a, b)]
    got = np.array([distance(*form).distance[0] for form in forms])
    # Before the scale is taken back: the least double above zero would be zero after it.
    wrong = int((np.sign(got) != np.sign(truth)).sum())
    got[2] *= 2.0**-power
    error: NDArray[Any] = np.abs(got - truth)
    share = float(error.max()) / size if size else float(np.inf if error.any() else 0.0)
    return Judged(share, wrong, len(forms))


def mesh_error(rng: np.random.Generator, kind: str) -> Judged:
    """A body beside a mesh of four triangles of another size, both ways round."""
    ratio = float(10.0 ** rng.uniform(*RATIOS))
    vertices = _numbers(rng, (6, 3)) * ratio
    faces = np.array([rng.permutation(6)[:3] for _ in range(4)])
    body = drawn(rng, kind, 1.0, _numbers(rng, (3,)) * ratio * 10.0 ** rng.uniform(-12, 0))
    mesh = MeshTree(vertices, faces)
    triangles = [Hulls(vertices[face], [0, 3]) for face in faces]
    truth = min(exact_distance(triangle, body, 0) for triangle in triangles)
    size = max(extent(triangle, body, 0) for triangle in triangles)
    got = np.array([distance(mesh, body).distance[0], distance(body, mesh).distance[0]])
    wrong = int((np.sign(got) != np.sign(truth)).sum())
    return Judged(float(np.abs(got - truth).max()) / size, wrong, 2)


class Timed(NamedTuple):
    """Answers of ``time_of_impact`` to one moving pair in all its forms."""

    hit: bool
    missed: int
    late: int
    false: int
    early: float  #: largest, as the way left to the contact, a share of the pair's extent
    apart: float  #: largest distance at a false hit, as a share of the pair's extent


def timed(rng: np.random.Generator, kinds: tuple[str, str], power: int) -> Timed:
    """A body that moves straight towards another of any size, so far that most of them touch."""
    a, b = pair(rng, kinds)
    apart = distance(a, b)
    size = extent(a, b, 0)
    aside = rng.normal(size=3) * abs(apart.distance[0]) * rng.choice([0, 0.1, 1])
    way = apart.point_a[0] - apart.point_b[0] + aside
    path = way * rng.uniform(0.9, 3) if apart.distance[0] > 0 else rng.normal(size=3) * size
    truth = exact_toi(cast(Bodies, a), cast(Bodies, b), path[None], 0)
    rest = np.zeros(3)
    cycle, factor = path[[1, 2, 0]], 2.0**power
    asked = [
        (*pair_, Motion(np.eye(4), first, rest), Motion(np.eye(4), second, rest))
        for pair_, first, second in (
            ((a, b), rest, path),
            (swapped(a, b), path, rest),
            (scaled(power)(a, b), rest, path * factor),
            (permuted(a, b), rest, cycle),
        )
    ]
    found = [float(time_of_impact(*given).time_of_impact[0]) for given in asked]
    if truth is None:
        false = [t for t in found if np.isfinite(t)]
        gaps = [exact_distance(a, moved(b, t * path), 0) / size for t in false]
        return Timed(False, 0, 0, len(false), 0.0, max(gaps, default=0.0))
    missed = sum(not np.isfinite(t) for t in found)
    off = [truth - Fraction(t) for t in found if np.isfinite(t)]
    length = float(np.linalg.norm(path))
    early = max((float(x) for x in off), default=0.0) * length / size
    return Timed(True, missed, sum(x < 0 for x in off), 0, early, 0.0)
