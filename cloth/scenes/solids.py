"""Solid bodies: cubes, a soft body between rollers, and a rod."""

import numpy as np
from numpy.typing import NDArray

from tauguard.cloth.scenes.scene import (
    Parts,
    Points,
    grid_size,
    scene,
    sheet,
    smooth_step,
    sphere,
    square,
)
from tauguard.cloth.topology import Groups

RADIUS, HALF_GAP = 0.5, 0.12  #: radius of the rollers, and half of the gap between them [m]
BODY, BUMPS = 0.32, 24
HALF = 0.05  #: half the side of the rod's square section [m]; the rod's half length is 1 m
COILS = 6.0
SIZE = 0.25  #: side of a packed cube [m]: a power of two, so that faces touch without rounding
GAP = 0.125
DROPPED = 4


@scene
def cubes_on_cloth(triangles: int, rng: np.random.Generator) -> Parts:
    """Four cubes fall on a hanging cloth, tumbling, and press dents into it.

    Group 0 is the cloth, which is tested against itself. The cubes are tested against the cloth and
    against each other.
    """
    rows, columns = grid_size(int(triangles * 0.7), 1.0)
    cube, faces = _cube(max(1, round(np.sqrt(0.3 * triangles / (12 * DROPPED)))))
    flat = np.stack(square(rows, columns), axis=1)
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
    dropped = count + _copies(faces, len(cube), DROPPED)
    return np.concatenate([sheet(rows, columns), dropped]), Groups(ids, meets), positions


@scene
def packed_cubes(triangles: int, rng: np.random.Generator) -> Parts:
    """Rigid cubes of a lattice approach until their faces touch exactly; then the layers slide.

    In the second half of the time, neighbours have coplanar, touching faces. Every cube is a group
    that is not tested against itself.
    """
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

    rigid = Groups(np.repeat(np.arange(side**3), len(cube)), ~np.eye(side**3, dtype=bool))
    return _copies(faces, len(cube), side**3), rigid, positions


@scene
def rollers(triangles: int, rng: np.random.Generator) -> Parts:
    """A bumpy body is pressed flat between turning rollers, and its bumps fold over each other.

    Group 0 is the body, which is tested against itself. Groups 1 and 2 are the rollers, which are
    tested against the body.
    """
    ball, ball_faces = sphere(int(triangles * 0.6))
    places = rng.standard_normal((BUMPS, 3))
    places /= np.linalg.norm(places, axis=1, keepdims=True)
    bumps = np.exp(12 * (ball @ places.T - 1)) @ rng.uniform(0.2, 0.55, BUMPS)
    body = BODY * ball * (1 + bumps)[:, None]
    rows, around = grid_size(int(triangles * 0.2), 1.6)
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)
    width = np.linspace(-0.9, 0.9, rows)[:, None]

    def roller(centre: float, turned: float) -> Points:
        x, z = RADIUS * np.cos(angle + turned), centre + RADIUS * np.sin(angle + turned)
        return np.stack(np.broadcast_arrays(x, width, z), axis=-1).reshape(-1, 3)

    def positions(time: float) -> Points:
        drawn = 1.2 * time
        x = body[:, 0] - 0.95 + drawn
        inside = np.sqrt(np.maximum(RADIUS**2 - x**2, 0.0))
        room = 1.03 * (RADIUS + HALF_GAP - inside)
        z = room * np.tanh(body[:, 2] / room)
        flat = np.clip(np.abs(body[:, 2]) - np.abs(z), 0.0, None)
        # Flattened parts are drawn back in folds by the surfaces of the rollers.
        x = x - 0.5 * flat + 0.35 * flat * np.sin(40 * body[:, 0] + 9 * body[:, 1])
        soft = np.column_stack([x, body[:, 1] * (1 + 0.6 * flat), z])
        turned, centre = drawn / RADIUS, RADIUS + HALF_GAP
        return np.concatenate([soft, roller(centre, turned), roller(-centre, -turned)])

    one = sheet(rows, around, closed=True)
    count = rows * around
    faces = np.concatenate([ball_faces, one + len(ball), one + len(ball) + count])
    ids = np.repeat([0, 1, 2], [len(ball), count, count])
    meets = [[True, True, True], [True, False, False], [True, False, False]]
    return faces, Groups(ids, meets), positions


@scene
def twisting_rod(triangles: int, rng: np.random.Generator) -> Parts:
    """A square rod is twisted about its axis; its middle buckles into a coil whose turns touch.

    The rod is one surface, open at both ends, and is tested against itself.
    """
    phase = rng.uniform(0, 2 * np.pi)
    # The sides of the grid's squares have about the same length along the rod and around it.
    around = max(8, 4 * round(float(np.sqrt(triangles * HALF)) / 2 / np.sqrt(2)))
    rows = max(12, round(triangles / (2 * around)) + 1)
    along = np.linspace(-1, 1, rows)
    edge = np.linspace(0, 4, around, endpoint=False)
    side, rest = np.divmod(edge, 1.0)
    corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
    before, after = corner[side.astype(int)], corner[(side.astype(int) + 1) % 4]
    section = HALF * (before + (after - before) * rest[:, None])

    def positions(time: float) -> Points:
        coiled = smooth_step(time, 0.25, 1.0)
        middle = np.exp(-((along / 0.62) ** 6))
        radius = 1.3 * HALF * coiled * middle
        turn = 2 * np.pi * COILS * along * coiled + phase
        axis = along * (1 - 0.42 * coiled)
        line = np.stack([axis, radius * np.cos(turn), radius * np.sin(turn)], axis=1)
        ahead = np.gradient(line, along, axis=0)
        ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
        first = np.cross(ahead, [0.0, 0.0, 1.0])
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        second = np.cross(ahead, first)
        twist = 5 * np.pi * smooth_step(time, 0.0, 1.0) * along
        c, s = np.cos(twist)[:, None], np.sin(twist)[:, None]
        a, b = c * first + s * second, c * second - s * first
        skin = section[:, 0, None] * a[:, None] + section[:, 1, None] * b[:, None]
        return np.asarray((line[:, None] + skin).reshape(-1, 3))

    return sheet(rows, around, closed=True), None, positions


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


def _rotation(axis: Points, angle: float) -> Points:
    """Rodrigues' formula."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k)
