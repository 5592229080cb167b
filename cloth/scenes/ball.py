"""A sheet that falls over a ball and is wound up as the ball turns."""

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

RADIUS = 0.5
GAP = 0.005
FLUTES = 9


def turning_ball(triangles: int = 20_000, seed: int = 0) -> Scene:
    """A square sheet drapes over a ball that then turns and winds it up.

    The hanging part forms flutes. Winding drags them sideways until their flanks meet, first at the
    corners. Group 0 is the sheet, group 1 the ball, which is not tested against itself.
    """
    rng = np.random.default_rng(seed)
    ripple = rng.uniform(0, 2 * np.pi, 2)
    rows, columns = grid_size(int(triangles * 0.8), 1.0)
    ball, ball_faces = sphere(int(triangles * 0.2))
    u, v = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    reach = np.hypot(u, v).ravel() * 1.15  # arc length from the top [m]
    around = np.arctan2(v, u).ravel()

    def positions(time: float) -> Points:
        draped = smooth_step(time, 0.0, 0.35)
        wound = 3.5 * smooth_step(time, 0.3, 1.0)
        r = RADIUS + GAP
        bend = np.pi / 2 * r  # arc length at the equator
        on_ball = np.minimum(reach, bend)
        hang = np.maximum(reach - bend, 0.0)
        wave = FLUTES * around + ripple[0]
        flute = draped * hang * (0.32 * np.cos(wave) + 0.06 * np.cos(2 * wave + ripple[1]))
        out = r * np.sin(on_ball / r) + 0.15 * hang + flute
        height = r * np.cos(on_ball / r) - hang
        # Interpolate between the flat sheet above the ball and the draped one.
        out = (1 - draped) * reach + draped * out
        height = (1 - draped) * (r + 0.05 + 0.01 * np.cos(5 * around) * reach) + draped * height
        swing = wound + 2.2 * wound * hang + draped * 0.9 * hang * np.sin(wave + wound)
        angle = around + swing
        body = ball * RADIUS
        c, s = np.cos(wound), np.sin(wound)
        body = body @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        cloth = np.stack([out * np.cos(angle), out * np.sin(angle), height], axis=-1)
        return np.concatenate([cloth, body])

    count = rows * columns
    faces = np.concatenate([sheet(rows, columns), ball_faces + count]).astype(np.int32)
    ids = np.repeat([0, 1], [count, len(ball)])
    return Scene(
        "turning_ball",
        faces,
        Groups(ids, [[True, True], [True, False]]),
        positions,
        frames_for(triangles),
    )
