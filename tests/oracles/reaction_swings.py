"""Swings of the arm into the chest, with a reaction to the contact: peak force and stopping."""

from __future__ import annotations

from typing import Any

import gymnasium
import mujoco
import numpy as np

from tauguard.envs.adapters.reactions import Reaction
from tauguard.envs.gym.compiled import tool_position
from tauguard.envs.gym.react import ReactEnv
from tauguard.models import body_region

REACT = "tauguard:tauguard/React-v1"
#: Length of a swing, its acceleration over half its speed squared [1/m], and spread of its speed.
LENGTH, STEEPNESS, SPREAD = 0.5, 10.0, 0.2
#: Speeds of the swings [m/s].
SPEEDS = (0.25, 0.5, 1.0)
#: Results of a swing.
OUTCOMES = (
    "peak_force_N", "energy_J", "delay_s", "stopping_time_s", "stopping_distance_m", "end_m",
    "force_over_limit",
)  # fmt: skip
#: The tool has stopped within this distance of its farthest position [m].
NEAR = 5e-4


def planned(inner: Any, speed: float) -> np.ndarray:
    """Joint speeds [rad/s], one row an action, of a straight swing along the path of React-v1."""
    model, scene, period = inner.model, inner.scene, 1 / inner.compiled.settings.control_rate
    data, jac = mujoco.MjData(model), np.zeros((3, model.nv))
    data.qpos[:] = inner.data.qpos
    mujoco.mj_kinematics(model, data)
    begin = tool_position(inner.compiled, data)
    rows, travelled = [data.qpos[scene.qpos_adr].copy()], 0.0
    while travelled < LENGTH:
        ramp = speed * np.sqrt(STEEPNESS * max(travelled, 1e-4))
        travelled += min(speed, ramp) * period
        for _ in range(2):
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            tool = tool_position(inner.compiled, data)
            mujoco.mj_jac(model, data, jac, None, tool, inner.compiled.tools[0][1])
            part = jac[:, scene.dof_adr]
            left = begin + travelled * inner.task.along - tool
            change = part.T @ np.linalg.solve(part @ part.T + 1e-4 * np.eye(3), left)
            data.qpos[scene.qpos_adr] += np.clip(change, -0.2, 0.2)
        rows.append(data.qpos[scene.qpos_adr].copy())
    return np.asarray(np.diff(rows, axis=0) / period)


def swing(speed: float, detector: Any, reaction: str, arm: int, seed: int) -> dict[str, float]:
    """One swing into the chest: peak force, energy, stopping time and distance.

    ``arm`` is the seed of the arm's deviation from its nominal model, the same as in a detector's
    training; ``seed`` is that of the swing.
    """
    made = gymnasium.make(
        REACT,
        detector=detector,
        mismatch=arm,
        disable_env_checker=True,
        max_episode_steps=10**6,
    )
    env = Reaction(made, reaction, "contact" if detector is None else "alarm")
    env.reset(seed=seed)
    inner = env.unwrapped
    assert isinstance(inner, ReactEnv)
    speed *= 1 + np.random.default_rng(seed).uniform(-SPREAD, SPREAD)
    path = planned(inner, speed) / inner.compiled.max_speed
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
