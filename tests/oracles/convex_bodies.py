"""Pairs of convex bodies for tests and studies: random ones and hard cases, by name."""

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from tauguard.rigid import Boxes, Parallelepipeds, Tetrahedra
from tauguard.rigid.shapes import Bodies

Pair = tuple[Bodies, Bodies]


def tetrahedra(rng: np.random.Generator, n: int) -> Tetrahedra:
    """Vertices uniform in the cube [-1, 1]^3."""
    return Tetrahedra(rng.uniform(-1, 1, (n, 4, 3)))


def boxes(rng: np.random.Generator, n: int) -> Boxes:
    """Half extents U[0.2, 1], any turn, centres uniform in the cube [-1, 1]^3."""
    return Boxes(
        rng.uniform(-1, 1, (n, 3)),
        rng.uniform(0.2, 1, (n, 3)),
        Rotation.random(n, random_state=int(rng.integers(1 << 31))).as_matrix(),
    )


def parallelepipeds(rng: np.random.Generator, n: int) -> Parallelepipeds:
    """Origin and edges uniform in the cube [-1, 1]^3: the "cubes" of the published table."""
    return Parallelepipeds(rng.uniform(-1, 1, (n, 3)), rng.uniform(-1, 1, (n, 3, 3)))


KINDS: dict[str, Callable[[np.random.Generator, int], Bodies]] = {
    "tetrahedra": tetrahedra,
    "boxes": boxes,
    "parallelepipeds": parallelepipeds,
}


def grid(rng: np.random.Generator, n: int, offset: float = 0.0) -> Pair:
    """Small integers: contacts at vertices, edges and faces, coplanar faces, coincident bodies."""
    return (
        Tetrahedra(rng.integers(0, 3, (n, 4, 3)).astype(np.float64) + offset),
        Tetrahedra(rng.integers(0, 3, (n, 4, 3)).astype(np.float64) + offset),
    )


def grid_boxes(rng: np.random.Generator, n: int, offset: float = 0.0) -> Pair:
    """Axis-aligned boxes on a grid, some turned by quarter turns, some without thickness."""
    quarter = np.array([Rotation.from_euler("xyz", k, degrees=True).as_matrix().round() for k in
                        [(0, 0, 0), (90, 0, 0), (0, 90, 0), (0, 0, 90), (90, 90, 0)]])  # fmt: skip

    def side() -> Boxes:
        return Boxes(
            rng.integers(-2, 3, (n, 3)).astype(np.float64) + offset,
            rng.integers(0, 3, (n, 3)) / 2,
            quarter[rng.integers(0, 5, n)],
        )

    return side(), side()


def grid_mixed(rng: np.random.Generator, n: int, offset: float = 0.0) -> Pair:
    """A grid box against a grid tetrahedron."""
    return grid_boxes(rng, n, offset)[0], grid(rng, n, offset)[1]


def grid_parallelepipeds(rng: np.random.Generator, n: int) -> Pair:
    """Unit grid edges: parallel faces and edges, many bodies flat or less."""

    def side() -> Parallelepipeds:
        numbers = rng.integers(-1, 2, (n, 4, 3)).astype(np.float64)
        return Parallelepipeds(numbers[:, 0], numbers[:, 1:])

    return side(), side()


def slivers(rng: np.random.Generator, n: int) -> Pair:
    """Aspect ratio 1 : 1e6."""
    squeeze = np.array([1.0, 1.0, 1e-6])
    turn = Rotation.random(2 * n, random_state=int(rng.integers(1 << 31))).as_matrix()
    v = rng.uniform(-1, 1, (2 * n, 4, 3)) * squeeze @ turn.transpose(0, 2, 1)
    return Tetrahedra(v[:n]), Tetrahedra(v[n:] + rng.uniform(-0.2, 0.2, (n, 1, 3)))


def size_ratio(rng: np.random.Generator, n: int) -> Pair:
    """A body a million times smaller, at the surface of the other."""
    a = rng.uniform(-1, 1, (n, 4, 3))
    weights = rng.dirichlet(np.ones(3), n)
    at = np.einsum("nk,nkc->nc", weights, a[:, :3])
    return Tetrahedra(a), Tetrahedra(at[:, None] + 1e-6 * rng.uniform(-1, 1, (n, 4, 3)))


def near_parallel(rng: np.random.Generator, n: int) -> Pair:
    """Facing triangles 1e-10 apart (or overlapping by it), tilted by as much."""
    a = rng.uniform(-1, 1, (n, 4, 3))
    a[:, :3, 2] = 0.0
    a[:, 3, 2] = -rng.uniform(0.2, 1, n)
    b = rng.uniform(-1, 1, (n, 4, 3))
    b[:, :3, 2] = rng.choice([-1.0, 1.0], n)[:, None] * 1e-10 + rng.uniform(-1e-10, 1e-10, (n, 3))
    b[:, 3, 2] = rng.uniform(0.2, 1, n)
    turn = (
        Rotation.random(n, random_state=int(rng.integers(1 << 31))).as_matrix().transpose(0, 2, 1)
    )
    return Tetrahedra(a @ turn), Tetrahedra(b @ turn)


def flat(rng: np.random.Generator, n: int) -> Pair:
    """Flat tetrahedra, half of the pairs in one plane."""
    a, b = rng.integers(-4, 5, (2, n, 4, 3)).astype(float)
    a[:, :, 2] = 0.0
    b[: n // 2, :, 2] = 0.0
    b[n // 2 :, 3] = b[n // 2 :, 0] + b[n // 2 :, 1] - b[n // 2 :, 2]
    shear = np.array([[1.0, 1, 0], [0, 1, 1], [1, 0, 2]])
    return Tetrahedra(a @ shear), Tetrahedra(b @ shear)


def tiny_gaps(rng: np.random.Generator, n: int) -> Pair:
    """Random contacts pulled 1e-12 apart, or pushed 1e-12 together."""
    a = rng.uniform(-1, 1, (n, 4, 3))
    weights = rng.dirichlet(np.ones(3), n)
    normal = np.cross(a[:, 1] - a[:, 0], a[:, 2] - a[:, 0])
    normal *= np.sign(np.einsum("nc,nc->n", normal, a[:, 0] - a[:, 3]))[:, None]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    at = np.einsum("nk,nkc->nc", weights, a[:, :3]) + 1e-12 * rng.choice([-1, 1], (n, 1)) * normal
    b = at[:, None] + rng.uniform(-1, 1, (n, 4, 3))
    b[:, 0] = at
    below = np.minimum(np.einsum("nvc,nc->nv", b - at[:, None], normal), 0)
    return Tetrahedra(a), Tetrahedra(b - 2 * below[:, :, None] * normal[:, None])


def touching_boxes(rng: np.random.Generator, n: int) -> Pair:
    """A corner, an edge or a face of an oblique box on a face of another, to rounding."""
    turn = Rotation.random(n, random_state=int(rng.integers(1 << 31))).as_matrix()
    h_a, h_b = rng.uniform(0.2, 1, (2, n, 3))
    spin = Rotation.from_rotvec(rng.uniform(0, 6, (n, 1)) * [0.0, 0.0, 1.0]).as_matrix()
    shift = np.c_[rng.uniform(-1, 1, (n, 2)), h_a[:, 2] + h_b[:, 2]]
    center = np.einsum("nij,nj->ni", turn, shift)
    return Boxes(np.zeros((n, 3)), h_a, turn), Boxes(center, h_b, turn @ spin)


def points_and_segments(rng: np.random.Generator, n: int) -> Pair:
    """Bodies of lower dimension than a plane."""
    a, b = rng.integers(-2, 3, (2, n, 4, 3)).astype(float)
    a[:, 1:] = a[:, :1] + rng.integers(0, 2, (n, 3, 1)) * rng.integers(-2, 3, (n, 1, 3))
    b[: n // 3, 1:] = b[: n // 3, :1]
    b[n // 3 : n // 2] = a[n // 3 : n // 2, ::-1] + rng.integers(0, 2, (n // 2 - n // 3, 1, 1))
    return Tetrahedra(a), Tetrahedra(b)


HARD: dict[str, Callable[[np.random.Generator, int], Pair]] = {
    "grid": grid,
    "grid at 1e6": lambda rng, n: grid(rng, n, 1e6),
    "grid boxes": grid_boxes,
    "grid boxes at 1e6": lambda rng, n: grid_boxes(rng, n, 1e6),
    "grid boxes and tetrahedra": grid_mixed,
    "grid parallelepipeds": grid_parallelepipeds,
    "slivers": slivers,
    "size ratio": size_ratio,
    "near parallel": near_parallel,
    "flat": flat,
    "gaps 1e-12": tiny_gaps,
    "touching boxes": touching_boxes,
    "points and segments": points_and_segments,
}
