"""Pleated ruffles around a body that sways and turns, like a dancer's dress."""

import numpy as np

from tauguard.cloth.groups import Groups
from tauguard.cloth.scenes.scene import (
    Points,
    Scene,
    frames_for,
    grid_size,
    sheet,
    smooth_step,
    sphere,
)

LAYERS = 3
PLEATS = 22
BODY_FRACTION = 0.1  # fraction of the triangles that form the body


def pleats(triangles: int = 20_000, seed: int = 0) -> Scene:
    """Three layers of ruffles, each a ring of S-shaped pleats, on a swaying body.

    The pleats deepen until neighbouring folds and layers meet. The dress follows the body with a
    lag that grows towards the hem. Group 0 is the dress, group 1 the body, which is not tested
    against itself.
    """
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 2 * np.pi, LAYERS)
    rows, columns = grid_size(int(triangles * (1 - BODY_FRACTION) / LAYERS), 5.0)
    ball, ball_faces = sphere(int(triangles * BODY_FRACTION))
    down = np.linspace(0, 1, rows)[:, None]
    turn = np.linspace(0, 2 * np.pi, columns, endpoint=False)

    def layer(i: int, time: float) -> Points:
        depth = 0.02 + 0.09 * smooth_step(time, 0.0, 0.7) * down * (
            1 + 0.15 * np.sin(40 * time + i)
        )
        wave = PLEATS * turn + phase[i] + 2.5 * down * np.sin(5 * time + i)
        # The angle swings with the pleat, so that the flanks of the pleats overhang.
        overhang = (0.3 + 1.1 * smooth_step(time, 0.1, 0.8)) * down * np.sin(wave) / PLEATS
        radius = 0.30 + 0.05 * i + 0.35 * down + depth * np.cos(wave)
        lag = time - 0.05 * down
        angle = turn + overhang + 1.2 * np.sin(6 * lag)
        x = radius * np.cos(angle) + 0.12 * np.sin(9 * lag)
        y = radius * np.sin(angle) + 0.08 * np.sin(7 * lag + 1)
        z = 1.0 - 0.18 * i - 0.5 * down + 0.03 * np.sin(wave + 8 * time) * down
        return np.stack([x, y, z + np.zeros_like(x)], axis=-1).reshape(-1, 3)

    def positions(time: float) -> Points:
        body = ball * [0.27, 0.27, 0.75] + [0, 0, 0.75]
        body[:, 0] += 0.12 * np.sin(9 * time)
        body[:, 1] += 0.08 * np.sin(7 * time + 1)
        return np.concatenate([*(layer(i, time) for i in range(LAYERS)), body])

    count = rows * columns
    dress = [sheet(rows, columns, closed=True) + i * count for i in range(LAYERS)]
    faces = np.concatenate([*dress, ball_faces + LAYERS * count]).astype(np.int32)
    ids = np.repeat([0, 1], [LAYERS * count, len(ball)])
    return Scene(
        "pleats",
        faces,
        Groups(ids, [[True, True], [True, False]]),
        positions,
        frames_for(triangles),
    )
