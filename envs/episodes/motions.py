"""Smooth joint motions whose speed is given as a percentage of the largest speed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array, in_a_line
from tauguard.findings import ArgumentError

#: Peak velocity and peak acceleration of 10 s^3 - 15 s^4 + 6 s^5 for s from 0 to 1.
_PEAK_VELOCITY = 1.875
_PEAK_ACCELERATION = 5.7735026918962575
SINGLE_JOINT = 0.2  # fraction of the random segments that move only one joint
DWELL = (0.1, 0.8)  # shortest and longest pause [s]


@dataclass(frozen=True)
class Motion:
    """References of a joint motion, one row per sample."""

    __repr__ = in_a_line

    t: Array  #: [s], shape (T,)
    q: Array  #: [rad], shape (T, n)
    qd: Array  #: [rad/s], shape (T, n)
    qdd: Array  #: [rad/s^2], shape (T, n)


def point_to_point(
    waypoints: ArrayLike, durations: ArrayLike, dwells: ArrayLike, dt: float
) -> Motion:
    """Quintic rest-to-rest segments (Flash & Hogan 1985) with a dwell at each waypoint.

    Args:
        waypoints: shape (W, n) [rad].
        durations: durations of the segments, shape (W - 1,) [s].
        dwells: time at rest at each waypoint, shape (W,) [s].
        dt: sample interval [s].

    Raises:
        ArgumentError: lengths that do not match, a duration that is not above 0, or a negative
            dwell.
    """
    points = np.asarray(waypoints, dtype=float)
    spans, pauses = np.asarray(durations, dtype=float), np.asarray(dwells, dtype=float)
    if len(spans) != len(points) - 1 or len(pauses) != len(points):
        raise ArgumentError(
            f"{len(points)} waypoints need {len(points) - 1} durations and {len(points)} dwells, "
            f"not {len(spans)} and {len(pauses)}"
        )
    if (spans <= 0).any() or (pauses < 0).any():
        raise ArgumentError("durations must be positive and dwells not negative")
    blocks: list[tuple[Array, Array, Array]] = []
    for i in range(len(points)):
        rest = np.repeat(points[i : i + 1], round(pauses[i] / dt), axis=0)
        blocks.append((rest, np.zeros_like(rest), np.zeros_like(rest)))
        if i < len(spans):
            blocks.append(_segment(points[i], points[i + 1], spans[i], dt))
    q, qd, qdd = (np.concatenate([block[k] for block in blocks]) for k in range(3))
    return Motion(np.arange(len(q), dtype=np.float64) * dt, q, qd, qdd)


def _segment(start: Array, stop: Array, span: float, dt: float) -> tuple[Array, Array, Array]:
    rows = max(int(np.ceil(span / dt)), 1)
    s = (np.arange(rows) / rows)[:, None]
    scale, path = 1 / (rows * dt), stop - start
    return (
        start + path * (10 * s**3 - 15 * s**4 + 6 * s**5),
        path * (30 * s**2 - 60 * s**3 + 30 * s**4) * scale,
        path * (60 * s - 180 * s**2 + 120 * s**3) * scale**2,
    )


def segment_time(path: Array, speed: float, max_speed: Array, max_acceleration: Array) -> float:
    """Duration of a quintic over ``path`` [rad] within the joints' limits [s], at least 0.2 s.

    The percentage ``speed`` scales only the velocity limits.
    """
    by_speed = np.abs(path) * _PEAK_VELOCITY / (max_speed * speed / 100)
    by_acceleration = np.sqrt(np.abs(path) * _PEAK_ACCELERATION / max_acceleration)
    return float(max(by_speed.max(), by_acceleration.max(), 0.2))


def check_load(grams: float) -> None:
    """Raise an ``ArgumentError`` unless ``grams`` is a possible payload."""
    if not 0 <= grams <= 1e6:
        why = "" if grams > 0 else "a load has 0 or more grams; "
        raise ArgumentError(f"payload_g {grams}: {why}expected 0 to 1,000,000 grams")


def check_percent(speed: float) -> None:
    """Raise an ``ArgumentError`` unless ``speed`` is a percentage above 1, so not a fraction."""
    if not 1 < speed <= 100:
        hint = f"; for {100 * speed:g} percent say {100 * speed:g}" if 0 < speed <= 1 else ""
        raise ArgumentError(
            f"speed {speed}: expected percent of the largest joint speeds, above 1 and at most 100"
            f"{hint}"
        )


@dataclass(frozen=True)
class Workspace:
    """The space in which random motions are drawn."""

    low: Array  #: [rad], shape (n,)
    high: Array  #: [rad], shape (n,)
    max_speed: Array  #: [rad/s], shape (n,)
    max_acceleration: Array  #: [rad/s^2], shape (n,)
    allowed: Callable[[Array], bool] = lambda q: True
    """Whether the pose ``q`` is free of contact with the arm itself, the floor and objects."""


def random_motion(
    rng: np.random.Generator,
    space: Workspace,
    seconds: float,
    speed: float,
    dt: float = 1e-3,
) -> Motion:
    """A random motion from point to point with dwells; some segments move a single joint.

    Args:
        rng: source of the waypoints.
        space: joint box, limits, and which poses are allowed.
        seconds: exact length of the motion [s].
        speed: percent of ``space.max_speed``, above 1 to 100.
        dt: sample interval [s].

    Raises:
        ArgumentError: a speed outside (1, 100], or too few allowed poses in ``space``.
    """
    check_percent(speed)
    points = [_free_point(rng, space)]
    spans: list[float] = []
    dwells = [float(rng.uniform(*DWELL))]
    total = dwells[0]
    while total < seconds:
        target = _next_point(rng, space, points[-1])
        spans.append(
            segment_time(target - points[-1], speed, space.max_speed, space.max_acceleration)
        )
        dwells.append(float(rng.uniform(*DWELL)))
        total += spans[-1] + dwells[-1]
        points.append(target)
    motion = point_to_point(points, spans, dwells, dt)
    rows = round(seconds / dt)
    return Motion(motion.t[:rows], motion.q[:rows], motion.qd[:rows], motion.qdd[:rows])


def _free_point(rng: np.random.Generator, space: Workspace) -> Array:
    for _ in range(1000):
        q = rng.uniform(space.low, space.high)
        if space.allowed(q):
            return q
    raise ArgumentError("no allowed pose found in 1000 draws: widen the workspace")


def _next_point(rng: np.random.Generator, space: Workspace, start: Array) -> Array:
    """A target whose straight joint path is allowed at eight points along it."""
    for _ in range(1000):
        target = rng.uniform(space.low, space.high)
        if rng.random() < SINGLE_JOINT:
            joint = int(rng.integers(len(start)))
            target = np.where(np.arange(len(start)) == joint, target, start)
        if np.abs(target - start).max() < 0.15:
            continue
        if all(space.allowed(start + (target - start) * s) for s in np.linspace(0.125, 1, 8)):
            return target
    raise ArgumentError("no allowed path found in 1000 draws: widen the workspace")
