"""Swings of the arm into the chest, with a reaction to the contact: peak force and stopping."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from tauguard.envs.adapters.reactions import Reaction
from tauguard.envs.gym.react import ReactEnv
from tauguard.models import body_region

REACT = "tauguard:tauguard/React-v0"
#: Speeds of the swings [m/s].
SPEEDS = (0.25, 0.5, 1.0)
#: Results of a swing.
OUTCOMES = (
    "peak_force_N", "energy_J", "delay_s", "stopping_time_s", "stopping_distance_m", "end_m",
    "force_over_limit",
)  # fmt: skip
#: The tool has stopped within this distance of its farthest position [m].
NEAR = 5e-4


def swing(speed: float, detector: Any, reaction: str, arm: int, seed: int) -> dict[str, float]:
    """One swing into the chest: peak force, energy, stopping time and distance.

    ``arm`` is the seed of the arm's deviation from its nominal model, the same as in a detector's
    training; ``seed`` is that of the swing.
    """
    made = gymnasium.make(
        REACT,
        speed=speed,
        detector=detector,
        mismatch=arm,
        approach=False,
        max_episode_steps=10**6,
    )
    env = Reaction(made, reaction, "contact" if detector is None else "alarm")
    env.reset(seed=seed)
    inner = env.unwrapped
    assert isinstance(inner, ReactEnv)
    path = np.diff(inner.task.swing[0], axis=0) * 100 / inner.compiled.max_speed  # type: ignore[attr-defined]
    n = len(inner.compiled.scene.joint_names)
    tools, times, force, onset, begun = [], [], 0.0, -1.0, -1.0
    for step in range(len(path) + 150):
        action = path[step] if step < len(path) else np.zeros(n)
        observation, _, _, _, info = env.step(action)
        tools.append(observation[3 * n : 3 * n + 3].copy())
        times.append(info["time"])
        force, onset = max(force, info["force"]), info["onset_time"] if onset < 0 else onset
        if begun < 0 and info["reacting"]:
            begun = info["time"]
    return swing_metrics(np.array(tools), np.array(times), force, onset, begun)


def swing_metrics(
    tools: np.ndarray, times: np.ndarray, force: float, onset: float, begun: float
) -> dict[str, float]:
    """The metrics of one swing, which goes along y.

    ``end_m`` is the tool's final position relative to the contact.
    """
    if 0 <= begun < (onset if onset >= 0 else np.inf):
        return dict.fromkeys(OUTCOMES, np.nan) | {"delay_s": -np.inf}
    touch = int(np.searchsorted(times, onset))
    gone = tools[touch:, 1] - tools[touch, 1]
    stop = touch + int(np.flatnonzero(gone >= gone.max() - NEAR)[0])
    region = body_region("chest")
    found = (
        force,
        force**2 / (2 * region.stiffness),
        begun - onset if begun >= 0 else np.nan,
        float(times[stop] - onset),
        float(gone.max()),
        float(gone[-1]),
        force / region.transient_force,
    )
    return dict(zip(OUTCOMES, found, strict=True))


def spread(values: list[float]) -> dict[str, float | None]:
    """Median, smallest and largest of those that are finite."""
    known = [v for v in values if np.isfinite(v)]
    if not known:
        return {"median": None, "low": None, "high": None}
    return {"median": float(np.median(known)), "low": min(known), "high": max(known)}
