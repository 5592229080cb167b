"""Cubes that are pushed together until their faces touch, or dropped on a cloth."""

import numpy as np
from numpy.typing import NDArray

from tauguard.cloth.groups import Groups
from tauguard.cloth.scenes.scene import Points, Scene, frames_for, grid_size, sheet, smooth_step

SIZE = 0.25  #: side of a packed cube [m]: a power of two, so that faces touch without rounding
GAP = 0.125
DROPPED = 4


def packed_cubes(triangles: int = 20_000, seed: int = 0) -> Scene:
    """Rigid cubes of a lattice approach until their faces touch exactly; then the layers slide.

    In the second half of the time, neighbours have coplanar, touching faces. Every cube is a group
    that is not tested against itself.
    """
    rng = np.random.default_rng(seed)
    side, fine = _lattice(triangles)
    cube, faces = _cube(fine)
    cells = np.stack(np.unravel_index(np.arange(side**3), (side,) * 3), axis=-1)
    slides = rng.uniform(-1, 1, (side, 2)) * 0.6 * SIZE

    def positions(time: float) -> Points:
        spread = SIZE + GAP * (1 - smooth_step(time, 0.0, 0.5))
        shift = np.zeros((side**3, 3))
        shift[:, :2] = slides[cells[:, 2]] * smooth_step(time, 0.5, 1.2)
        placed = (cells * spread)[:, None] + cube * SIZE
        return np.asarray((placed + shift[:, None]).reshape(-1, 3))

    return Scene(
        "packed_cubes",
        _copies(faces, len(cube), side**3),
        _rigid(len(cube), side**3),
        positions,
        frames_for(triangles),
    )


def cubes_on_cloth(triangles: int = 20_000, seed: int = 0) -> Scene:
    """Four cubes fall on a hanging cloth, tumbling, and press dents into it.

    Group 0 is the cloth, which is tested against itself. The cubes are tested against the cloth and
    against each other.
    """
    rng = np.random.default_rng(seed)
    rows, columns = grid_size(int(triangles * 0.7), 1.0)
    cube, faces = _cube(max(1, round(np.sqrt(0.3 * triangles / (12 * DROPPED)))))
    u, v = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    flat = np.stack([u.ravel(), v.ravel()], axis=1)
    corner = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
    start = 0.5 * corner + rng.uniform(-0.08, 0.08, (DROPPED, 2))
    axis = rng.standard_normal((DROPPED, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    phase = rng.uniform(0, 2 * np.pi, 2)
    half = 0.2

    def positions(time: float) -> Points:
        # The cubes slide down the dents towards the middle, where they meet.
        centres = start * (1 - 0.62 * smooth_step(time, 0.35, 1.0))
        fall = smooth_step(time, 0.0, 0.45)
        low = -0.55 * float(smooth_step(time, 0.3, 0.9))
        apart = ((flat[:, None] - centres) ** 2).sum(axis=-1)
        hanging = (1 - flat[:, 0] ** 2) * (1 - flat[:, 1] ** 2)
        folds = 0.05 * smooth_step(time, 0.3, 1.0) * np.sin(14 * flat @ [1.0, 0.6] + phase[0])
        height = low * hanging + folds * hanging - 0.12 * fall * np.exp(-apart / 0.03).sum(axis=1)
        drawn = 1 - 0.25 * smooth_step(time, 0.3, 1.0)
        wave = 0.05 * fall * np.sin(22 * height + phase[1])
        cloth = np.column_stack([flat[:, 0] * drawn + wave, flat[:, 1] * drawn, height])
        under = low * (1 - (centres**2).prod(axis=1)) - 0.12 * fall
        above = (1 - fall) * 0.9 + half * 0.95
        turned = 1.2 * (1 - 0.7 * float(fall)) + time
        places = np.column_stack([centres * drawn, under + above])
        bodies = [
            np.dot(2 * half * (cube - 0.5), _rotation(axis[i], turned).T) + places[i]
            for i in range(DROPPED)
        ]
        return np.concatenate([cloth, *bodies])

    count = rows * columns
    ids = np.repeat(np.arange(DROPPED + 1), [count, *[len(cube)] * DROPPED])
    meets = ~np.eye(DROPPED + 1, dtype=bool)
    meets[0, 0] = True
    return Scene(
        "cubes_on_cloth",
        np.concatenate([sheet(rows, columns), count + _copies(faces, len(cube), DROPPED)]),
        Groups(ids, meets),
        positions,
        frames_for(triangles),
    )


def _lattice(triangles: int) -> tuple[int, int]:
    """Cubes per side, and squares per side of a face, for about this many triangles."""
    sizes = [(side, fine) for side in (2, 3, 4) for fine in range(1, 200)]
    return min(sizes, key=lambda s: abs(12 * s[0] ** 3 * s[1] ** 2 - triangles))


def _cube(fine: int) -> tuple[Points, NDArray[np.int32]]:
    """The surface of the unit cube, with ``fine`` squares along each edge."""
    square = sheet(fine + 1, fine + 1)
    i, j = np.divmod(np.arange((fine + 1) ** 2), fine + 1)
    corners: list[NDArray[np.intp]] = []
    faces: list[NDArray[np.int32]] = []
    for axis in range(3):
        for level in (0, fine):
            at = np.insert(np.stack([i, j], axis=1), axis, level, axis=1)
            faces.append(square + len(corners) * len(i))
            corners.append(at)
    grid, number = np.unique(np.concatenate(corners), axis=0, return_inverse=True)
    return grid / fine, number.reshape(-1)[np.concatenate(faces)].astype(np.int32)


def _copies(faces: NDArray[np.int32], vertices: int, count: int) -> NDArray[np.int32]:
    offsets = vertices * np.arange(count, dtype=np.int32)[:, None, None]
    return (faces + offsets).reshape(-1, 3).astype(np.int32)


def _rigid(vertices: int, count: int) -> Groups:
    return Groups(np.repeat(np.arange(count), vertices), ~np.eye(count, dtype=bool))


def _rotation(axis: Points, angle: float) -> Points:
    """Rodrigues' formula."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k)
