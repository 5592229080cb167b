"""Sheets and garments that fold, drape, twist and crumple."""

import numpy as np

from tauguard.cloth.scenes.scene import (
    Parts,
    Points,
    grid_size,
    on_body,
    scene,
    sheet,
    smooth_step,
    sphere,
    square,
)

LAYERS = 3
PLEATS = 22
BODY_FRACTION = 0.1  # fraction of the triangles that form the body
RADIUS = 0.5
GAP = 0.005
FLUTES = 9
FOLDS = 7
HEM_PLEATS = 12
MATS = 4
WAVES = 28


@scene
def pleats(triangles: int, rng: np.random.Generator) -> Parts:
    """Three layers of ruffles, each a ring of S-shaped pleats, on a swaying body.

    The pleats deepen until neighbouring folds and layers meet. The dress follows the body with a
    lag that grows towards the hem. Group 0 is the dress, group 1 the body, which is not tested
    against itself.
    """
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
    faces = np.concatenate([*dress, ball_faces + LAYERS * count])
    return faces, on_body(LAYERS * count, len(ball)), positions


@scene
def turning_ball(triangles: int, rng: np.random.Generator) -> Parts:
    """A square sheet drapes over a ball that then turns and winds it up.

    The hanging part forms flutes. Winding drags them sideways until their flanks meet, first at the
    corners. Group 0 is the sheet, group 1 the ball, which is not tested against itself.
    """
    ripple = rng.uniform(0, 2 * np.pi, 2)
    rows, columns = grid_size(int(triangles * 0.8), 1.0)
    ball, ball_faces = sphere(int(triangles * 0.2))
    u, v = square(rows, columns)
    reach = np.hypot(u, v) * 1.15  # arc length from the top [m]
    around = np.arctan2(v, u)

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
    faces = np.concatenate([sheet(rows, columns), ball_faces + count])
    return faces, on_body(count, len(ball)), positions


@scene
def seated_skirt(triangles: int, rng: np.random.Generator) -> Parts:
    """An underskirt and an overskirt sink to the floor and stack up in horizontal folds.

    Sitting lowers the waist while the skirt keeps its length, so the profile buckles into folds
    that come to lie on one another. The folds differ around the body: some meet early, others not
    at all. Both layers are tested against themselves and each other.
    """
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
    return np.concatenate([one, one + rows * columns]), None, positions


@scene
def twisting_mats(triangles: int, rng: np.random.Generator) -> Parts:
    """Four stacked mats with gaps between them are twisted by two turns and curled at the waist.

    The twist alone keeps the gaps. The curl at the waist presses the mats together, and ripples
    that differ from mat to mat make them pass through each other. Everything is tested.
    """
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
    faces = np.concatenate([one + i * rows * columns for i in range(MATS)])
    return faces, None, positions


@scene
def crumpling(triangles: int, rng: np.random.Generator) -> Parts:
    """A flat sheet is drawn together from all sides and forms creases.

    The creases are random waves of the sheet in random directions of space, 4 to 30 across its
    width. Their slopes grow as the width shrinks, so the area stays about the same. At a fifth of
    its width the sheet passes through itself in many places. It is tested against itself.
    """
    rows, columns = grid_size(triangles, 1.0)
    flat = np.stack(square(rows, columns), axis=1)
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

    return sheet(rows, columns), None, positions
