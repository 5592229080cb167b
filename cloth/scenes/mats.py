"""Stacked mats that are twisted about their long axis."""

import numpy as np

from tauguard.cloth.scenes.scene import Points, Scene, frames_for, grid_size, sheet, smooth_step

MATS = 4


def twisting_mats(triangles: int = 20_000, seed: int = 0) -> Scene:
    """Four stacked mats with gaps between them are twisted by two turns and curled at the waist.

    The twist alone keeps the gaps. The curl at the waist presses the mats together, and ripples
    that differ from mat to mat make them pass through each other. Everything is tested.
    """
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 2 * np.pi, (MATS, 2))
    rows, columns = grid_size(triangles // MATS, 0.5)
    along = np.linspace(-1, 1, rows)[:, None]
    across = np.linspace(-0.4, 0.4, columns)

    def mat(i: int, time: float) -> Points:
        ripples = smooth_step(time, 0.2, 0.9)
        waist = np.exp(-((along / 0.45) ** 2))
        curl = 9.0 * smooth_step(time, 0.1, 1.0) * waist + 1e-9
        offset = (i - (MATS - 1) / 2) * 0.04 * (1 - 0.6 * waist * ripples)
        offset = offset + 0.02 * ripples * np.sin(17 * along + phase[i, 0] + 6 * time) * np.cos(
            9 * across + phase[i, 1]
        )
        # The cross-section is an arc of curvature `curl`; the mats are stacked along its normal.
        bend = across * curl
        y = np.sin(bend) / curl - offset * np.sin(bend)
        z = (1 - np.cos(bend)) / curl + offset * np.cos(bend)
        twist = 4 * np.pi * smooth_step(time, 0.0, 1.0) * along / 2
        c, s = np.cos(twist), np.sin(twist)
        x = along * (1 - 0.15 * ripples)
        return np.stack(np.broadcast_arrays(x, c * y - s * z, s * y + c * z), axis=-1).reshape(
            -1, 3
        )

    def positions(time: float) -> Points:
        return np.concatenate([mat(i, time) for i in range(MATS)])

    one = sheet(rows, columns)
    faces = np.concatenate([one + i * rows * columns for i in range(MATS)]).astype(np.int32)
    return Scene("twisting_mats", faces, None, positions, frames_for(triangles))
