"""Small triangle meshes, and whether two triangles share a point, in rational arithmetic."""

from fractions import Fraction
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation


def solve(columns, right):
    """The exact solution of columns x = right, None where it is not unique or there is none."""
    rows = [[c[i] for c in columns] + [right[i]] for i in range(len(right))]
    n, rank = len(columns), 0
    for k in range(n):
        pivot = next((i for i in range(rank, len(rows)) if rows[i][k] != 0), None)
        if pivot is None:
            return None
        rows[rank], rows[pivot] = rows[pivot], rows[rank]
        rows[rank] = [x / rows[rank][k] for x in rows[rank]]
        for i in range(len(rows)):
            if i != rank and rows[i][k] != 0:
                rows[i] = [x - rows[i][k] * y for x, y in zip(rows[i], rows[rank], strict=True)]
        rank += 1
    return None if any(row[n] != 0 for row in rows[rank:]) else [row[n] for row in rows[:n]]


def triangles_meet(a, b) -> bool:
    """Exact: the hulls of a and b share a point iff a basic solution of their weights is >= 0."""
    one, zero = Fraction(1), Fraction(0)
    columns = [[*map(Fraction, map(float, p)), one, zero] for p in a]
    columns += [[*(-Fraction(float(x)) for x in p), zero, one] for p in b]
    right = [zero, zero, zero, one, one]
    for size in range(2, 6):
        for chosen in combinations(columns, size):
            x = solve(chosen, right)
            if x is not None and all(w >= 0 for w in x):
                return True
    return False


def icosphere(level: int = 1, radius: float = 1.0):
    """Vertices and faces of a subdivided octahedron projected to a sphere."""
    vertices = [tuple(s * np.eye(3)[k]) for k in range(3) for s in (1, -1)]
    faces = [(x, y, z) for x in (0, 1) for y in (2, 3) for z in (4, 5)]
    faces = [f if (sum(f) - 6) % 2 == 0 else (f[0], f[2], f[1]) for f in faces]
    for _ in range(level):
        index = {v: i for i, v in enumerate(vertices)}

        def middle(i, j, index=index):
            m = np.add(vertices[i], vertices[j])
            key = tuple(m / np.linalg.norm(m))
            if key not in index:
                index[key] = len(vertices)
                vertices.append(key)
            return index[key]

        split = []
        for a, b, c in faces:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            split += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = split
    return radius * np.array(vertices), np.array(faces)


def cube(half: float = 0.5):
    """Vertices and the twelve outward faces of an axis-aligned cube."""
    vertices = half * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return vertices, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def soup(rng, n: int, size: float = 0.3):
    """n random triangles in the unit box, every tenth one degenerate."""
    corners = rng.uniform(-1, 1, (n, 1, 3)) + rng.uniform(-size, size, (n, 3, 3))
    corners[::10, 2] = corners[::10, 1]
    corners[5::20, 1:] = corners[5::20, :1]
    return corners.reshape(-1, 3), np.arange(3 * n).reshape(n, 3)


def random_poses(rng, n: int, reach: float):
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, :3] = Rotation.random(n, random_state=rng).as_matrix()
    poses[:, :3, 3] = rng.uniform(-reach, reach, (n, 3))
    return poses


def transform(pose, points):
    """R p + t in the order of operations that the mesh queries document."""
    r, t = pose[:3, :3], pose[:3, 3]
    return np.stack(
        [
            ((r[i, 0] * points[..., 0] + r[i, 1] * points[..., 1]) + r[i, 2] * points[..., 2])
            + t[i]
            for i in range(3)
        ],
        axis=-1,
    )
