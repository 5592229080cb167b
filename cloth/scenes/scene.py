"""A scene: faces, groups, and the position of every vertex at any time."""

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.cloth.topology import Groups

Points = NDArray[np.float64]
#: Faces, groups, and the function from a time to positions.
Parts = tuple[NDArray[np.int32], Groups | None, Callable[[float], Points]]


@dataclass(frozen=True, eq=False)
class Scene:
    """A prescribed motion of a triangle mesh.

    Attributes:
        name: Key in ``SCENES``.
        faces: Shape (F, 3).
        groups: Groups of vertices; ``None``: everything is tested against everything.
        positions: Function from a time in [0, 1] to positions [m], shape (V, 3).
        frames: Number of steps with which a typical vertex moves by about an edge length per step.
    """

    name: str
    faces: NDArray[np.int32]
    groups: Groups | None
    positions: Callable[[float], Points]
    frames: int

    def steps(self, count: int | None = None) -> Iterator[tuple[Points, Points]]:
        """Positions at both ends of each of ``count`` equal steps (``None``: ``frames`` steps)."""
        count = self.frames if count is None else count
        end = self.positions(0.0)
        for i in range(count):
            start, end = end, self.positions((i + 1) / count)
            yield start, end


#: Builders by name: ``SCENES[name](triangles, seed)``.
SCENES: dict[str, Callable[[int, int], Scene]] = {}


def scene(parts: Callable[[int, np.random.Generator], Parts]) -> Callable[[int, int], Scene]:
    """Make the scene of these parts a builder in :data:`SCENES`, under the function's name."""
    name = parts.__name__

    @functools.wraps(parts)
    def build(triangles: int = 20_000, seed: int = 0) -> Scene:
        faces, groups, positions = parts(triangles, np.random.default_rng(seed))
        return Scene(name, faces.astype(np.int32), groups, positions, frames_for(triangles))

    SCENES[name] = build
    return build


def on_body(cloth: int, body: int) -> Groups:
    """Group 0 of ``cloth`` vertices, and group 1, which is not tested against itself."""
    return Groups(np.repeat([0, 1], [cloth, body]), [[True, True], [True, False]])


def square(rows: int, columns: int) -> tuple[Points, Points]:
    """Coordinates of the vertices of a sheet, from -1 to 1."""
    u, v = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    return u.ravel(), v.ravel()


def sheet(rows: int, columns: int, closed: bool = False) -> NDArray[np.int32]:
    """Faces of a grid of vertices, which are numbered row by row.

    ``closed`` joins the last column to the first. The diagonals of the squares alternate, so there
    is no preferred direction. Shape (2 (rows - 1) (columns - 1), 3); (2 (rows - 1) columns, 3) if
    closed.
    """
    wide = columns if closed else columns - 1
    i, j = np.divmod(np.arange((rows - 1) * wide), wide)
    right = (j + 1) % columns
    a, b = i * columns + j, i * columns + right
    c, d = a + columns, b + columns
    odd = ((i + j) % 2 == 1)[:, None]
    first = np.where(odd, np.stack([a, b, c], axis=1), np.stack([a, b, d], axis=1))
    second = np.where(odd, np.stack([b, d, c], axis=1), np.stack([a, d, c], axis=1))
    return np.concatenate([first, second]).astype(np.int32)


def grid_size(triangles: int, aspect: float) -> tuple[int, int]:
    """Rows and columns (``aspect`` times as many) of a sheet of about ``triangles`` triangles."""
    rows = max(3, round(float(np.sqrt(triangles / (2 * aspect)))) + 1)
    return rows, max(4, round((rows - 1) * aspect) + 1)


def sphere(triangles: int) -> tuple[Points, NDArray[np.int32]]:
    """A unit sphere of about ``triangles`` triangles: rings of vertices between two poles."""
    rings, around = grid_size(triangles, 2.0)
    polar = np.linspace(0, np.pi, rings + 2)[1:-1, None]
    turn = np.linspace(0, 2 * np.pi, around, endpoint=False)
    body = np.stack(
        np.broadcast_arrays(
            np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)
        ),
        axis=-1,
    ).reshape(-1, 3)
    north, south = rings * around, rings * around + 1
    j = np.arange(around)
    following = (j + 1) % around
    last = (rings - 1) * around
    caps = [
        np.stack([np.full(around, north), j, following], axis=1),
        np.stack([np.full(around, south), last + following, last + j], axis=1),
    ]
    faces = np.concatenate([sheet(rings, around, closed=True), *caps]).astype(np.int32)
    return np.concatenate([body, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]]), faces


def smooth_step(x: float | Points, start: float, stop: float) -> Points:
    """0 before ``start``, 1 after ``stop``, and a smooth cubic in between."""
    s = np.clip((np.asarray(x) - start) / (stop - start), 0.0, 1.0)
    return np.asarray(s * s * (3 - 2 * s))


def frames_for(triangles: int) -> int:
    """Number of steps that keeps motion per step proportional to edge length."""
    return max(12, round(0.6 * float(np.sqrt(triangles))))
