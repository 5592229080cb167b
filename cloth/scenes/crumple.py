"""A sheet crumpled into a ball."""

import numpy as np

from tauguard.cloth.scenes.scene import Points, Scene, frames_for, grid_size, sheet, smooth_step

WAVES = 28


def crumpling(triangles: int = 20_000, seed: int = 0) -> Scene:
    """A flat sheet is drawn together from all sides and forms creases.

    The creases are random waves of the sheet in random directions of space, 4 to 30 across its
    width. Their slopes grow as the width shrinks, so the area stays about the same. At a fifth of
    its width the sheet passes through itself in many places. It is tested against itself.
    """
    rng = np.random.default_rng(seed)
    rows, columns = grid_size(triangles, 1.0)
    u, v = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    flat = np.stack([u.ravel(), v.ravel()], axis=1)
    number = np.exp(rng.uniform(np.log(6), np.log(45), WAVES))[:, None]
    heading = rng.uniform(0, 2 * np.pi, WAVES)
    wave = number * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    phase = rng.uniform(0, 2 * np.pi, WAVES)
    drift = rng.uniform(-1.5, 1.5, WAVES)
    push = rng.standard_normal((WAVES, 3))
    # Scale the sum of the waves to a mean squared slope of one.
    push /= np.linalg.norm(push, axis=1, keepdims=True) * number * np.sqrt(WAVES / 4)

    def positions(time: float) -> Points:
        width = 1 - 0.8 * float(smooth_step(time, 0.1, 1.0))
        creases = np.sin(flat @ wave.T + phase + drift * time) @ push
        drawn_in = np.column_stack([width * flat, np.zeros(len(flat))])
        return np.asarray(drawn_in + np.sqrt(1 - width**2) * creases)

    return Scene("crumpling", sheet(rows, columns), None, positions, frames_for(triangles))
