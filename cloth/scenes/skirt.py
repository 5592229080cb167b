"""A long skirt whose wearer sits down: the cloth gathers in folds that lie on one another."""

import numpy as np

from tauguard.cloth.scenes.scene import Points, Scene, frames_for, grid_size, sheet, smooth_step

FOLDS = 7
HEM_PLEATS = 12


def seated_skirt(triangles: int = 20_000, seed: int = 0) -> Scene:
    """An underskirt and an overskirt sink to the floor and stack up in horizontal folds.

    Sitting lowers the waist while the skirt keeps its length, so the profile buckles into folds
    that come to lie on one another. The folds differ around the body: some meet early, others not
    at all. Both layers are tested against themselves and each other.
    """
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 2 * np.pi, (2, 3))
    rows, columns = grid_size(triangles // 2, 2.5)
    down = np.linspace(0, 1, rows)[:, None]
    turn = np.linspace(0, 2 * np.pi, columns, endpoint=False)

    def layer(i: int, time: float) -> Points:
        seated = smooth_step(time, 0.15, 0.9)
        uneven = (
            1 + 0.25 * np.sin(3 * turn + phase[i, 0]) * down + 0.1 * np.sin(7 * turn + 3 * time)
        )
        squeeze = np.clip(0.93 * seated * uneven, 0.0, 0.985)
        fold = 2 * np.pi * FOLDS * down + phase[i, 1] + 0.6 * np.sin(2 * turn + phase[i, 2])
        # As the height is squeezed, the folds swing out further and overhang.
        swing = 0.09 * np.sqrt(squeeze * (2 - squeeze)) * down**0.5
        pleat = 0.04 * down * np.cos(HEM_PLEATS * turn + phase[i, 0] + 2 * np.sin(4 * time))
        radius = 0.22 + 0.03 * i + 0.42 * down + swing * np.sin(fold) + pleat
        height = (1 - down) * (1 - squeeze) + 0.035 * squeeze * np.sin(2 * fold) * down
        lean = 0.25 * seated * (1 - down)
        x = radius * np.cos(turn) + lean
        y = radius * np.sin(turn) + 0.05 * np.sin(5 * time) * (1 - down)
        return np.stack(np.broadcast_arrays(x, y, height), axis=-1).reshape(-1, 3)

    def positions(time: float) -> Points:
        return np.concatenate([layer(0, time), layer(1, time)])

    one = sheet(rows, columns, closed=True)
    faces = np.concatenate([one, one + rows * columns]).astype(np.int32)
    return Scene("seated_skirt", faces, None, positions, frames_for(triangles))
