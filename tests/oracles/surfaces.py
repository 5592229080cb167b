"""A generated surface of the Stanford bunny's size, random poses of two copies, and its pieces."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation


def bumpy_surface(rows: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
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
    return (radius[..., None] * direction).reshape(-1, 3), faces


def poses_near(
    vertices: NDArray[np.float64], rng: np.random.Generator, n: int
) -> NDArray[np.float64]:
    """Any rotation, centers 0.35 to 0.85 sizes apart: about a third of them collide."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    center, size = 0.5 * (low + high), np.linalg.norm(high - low)
    pose = np.tile(np.eye(4), (n, 1, 1))
    seed = int(rng.integers(1 << 31))
    pose[:, :3, :3] = Rotation.random(n, random_state=seed).as_matrix()
    offset = rng.normal(size=(n, 3))
    offset *= (rng.uniform(0.35, 0.85, n) * size / np.linalg.norm(offset, axis=1))[:, None]
    pose[:, :3, 3] = center + offset - pose[:, :3, :3] @ center
    return np.asarray(pose)


def pieces(
    corners: NDArray[np.float64], most: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Triangles split at the median of the longest axis until a piece has at most ``most`` faces.

    Returns:
        Corners of the triangles about each piece's mean, shape (T, 3, 3), and the first triangle of
        every piece, shape (B + 1,).
    """
    middle = corners.mean(axis=1)
    done, left = [], [np.arange(len(corners))]
    while left:
        part = left.pop()
        if len(part) <= most:
            done.append(corners[part] - corners[part].mean(axis=(0, 1)))
            continue
        axis = np.ptp(middle[part], axis=0).argmax()
        order = part[np.argsort(middle[part, axis], kind="stable")]
        left += [order[: len(order) // 2], order[len(order) // 2 :]]
    return np.concatenate(done), np.cumsum([0, *map(len, done)]).astype(np.int64)
