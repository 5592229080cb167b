"""A rod that is twisted until it coils up and touches itself."""

import numpy as np

from tauguard.cloth.scenes.scene import Points, Scene, frames_for, sheet, smooth_step

HALF = 0.05  #: half the side of the rod's square section [m]; the rod's half length is 1 m
COILS = 6.0


def twisting_rod(triangles: int = 20_000, seed: int = 0) -> Scene:
    """A square rod is twisted about its axis; its middle buckles into a coil whose turns touch.

    The rod is one surface, open at both ends, and is tested against itself.
    """
    rng = np.random.default_rng(seed)
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

    faces = sheet(rows, around, closed=True)
    return Scene("twisting_rod", faces, None, positions, frames_for(triangles))
