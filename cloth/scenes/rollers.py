"""A soft, bumpy body that passes between two rollers."""

import numpy as np

from tauguard.cloth.groups import Groups
from tauguard.cloth.scenes.scene import Points, Scene, frames_for, grid_size, sheet, sphere

RADIUS, HALF_GAP = 0.5, 0.12  #: radius of the rollers, and half of the gap between them [m]
BODY, BUMPS = 0.32, 24


def rollers(triangles: int = 20_000, seed: int = 0) -> Scene:
    """A bumpy body is pressed flat between turning rollers, and its bumps fold over each other.

    Group 0 is the body, which is tested against itself. Groups 1 and 2 are the rollers, which are
    tested against the body.
    """
    rng = np.random.default_rng(seed)
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
    return Scene(
        "rollers", faces.astype(np.int32), Groups(ids, meets), positions, frames_for(triangles)
    )
