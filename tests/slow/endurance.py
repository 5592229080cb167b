"""Memory, residual and latency of an environment with a detector, over many actions or resets."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from slow.small_detector import trained

if TYPE_CHECKING:
    from tauguard.envs.gym.base import ArmEnv

#: Physics steps and actions a second [Hz]; percentiles of the times of an action.
SAMPLES, RATE, PERCENTILES = 250.0, 50.0, (50.0, 99.0, 99.9, 99.99)
#: Amplitude of the motion about home [rad], and its period in each joint [s].
SWING, PERIODS = 0.4, (3.1, 4.3, 5.9, 2.3, 7.1, 3.7)
#: Gain that returns the arm to its path [1/s]; time over which the motion starts [s].
FOLLOW, BEGIN = 2.0, 5.0


def detector(
    seed: int,
    episodes: int = 12,
    seconds: float = 20.0,
    speeds: tuple[float, ...] = (20.0, 40.0, 60.0),
) -> Any:
    """A detector trained on simulated collision-free motion, for one false alarm an hour."""
    from tauguard.datasets.plans import free_episodes
    from tauguard.envs import simulate

    free = [simulate(e) for e in free_episodes(seed, episodes, seconds, speeds, (0.0,), None)]
    return trained(free, SAMPLES, 1.0, "moving-thresholds")


def environment(alarm: Any, seed: int) -> ArmEnv:
    """An arm without obstacles, with this detector and its fault checks; already reset."""
    made = gymnasium.make(
        "tauguard:tauguard/Reach-v0",
        obstacles=(),
        detector=alarm,
        noise=True,
        timestep=1 / SAMPLES,
        control_rate=RATE,
    )
    env: Any = made.unwrapped
    env.reset(seed=seed)
    return env


def moved(env: ArmEnv, begin: float, count: int) -> dict[str, float]:
    """Take ``count`` actions of one periodic motion from the time ``begin`` [s] on.

    Returns:
        Resident memory [MiB], rms residual of the worst joint [N m], alarms, actions with a fault,
        and percentiles of the time of an action [us].
    """
    home, top = env.compiled.scene.home, env.compiled.scene.facts.max_speed
    omega = 2 * np.pi / np.resize(PERIODS, len(home))
    wall, own = (np.zeros(count, np.int64) for _ in range(2))
    squares, up, alarms, faults = np.zeros(len(home)), False, 0, 0
    for k in range(count):
        t = begin + k / RATE
        swing = SWING * min(1.0, t / BEGIN)
        q = env.batch.datas[0].qpos[env.compiled.scene.qpos_adr]
        back = FOLLOW * (home + swing * np.sin(omega * t) - q)
        action = np.clip((swing * omega * np.cos(omega * t) + back) / top, -1, 1)
        start = time.perf_counter_ns(), time.thread_time_ns()
        *_, info = env.step(action)
        wall[k], own[k] = time.perf_counter_ns() - start[0], time.thread_time_ns() - start[1]
        squares += np.square(info["residual"])
        alarms += bool(info["alarm"]) and not up
        up = bool(info["alarm"])
        faults += bool(info["fault"])
    rms = float(np.sqrt(squares / count).max())
    seen = {"memory_mib": memory(), "rms_residual": rms, "alarms": alarms, "faults": faults}
    return seen | quantiles(wall, own)


def reset(env: ArmEnv, count: int) -> dict[str, float]:
    """Reset ``count`` times, every tenth time with an action after it.

    Returns:
        Resident memory [MiB] and percentiles of the time of a reset [us].
    """
    wall, own = (np.zeros(count, np.int64) for _ in range(2))
    still = np.zeros(env.action_space.shape or ())
    for k in range(count):
        start = time.perf_counter_ns(), time.thread_time_ns()
        env.reset()
        wall[k], own[k] = time.perf_counter_ns() - start[0], time.thread_time_ns() - start[1]
        if k % 10 == 0:
            env.step(still)
    return {"memory_mib": memory()} | quantiles(wall, own)


def memory() -> float:
    """Resident memory of this process [MiB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def quantiles(wall: NDArray[np.int64], own: NDArray[np.int64]) -> dict[str, float]:
    """Percentiles of wall and processor times given in nanoseconds [us]."""
    found = {}
    for name, nanoseconds in (("wall", wall), ("cpu", own)):
        for p, value in zip(PERCENTILES, np.percentile(nanoseconds, PERCENTILES), strict=True):
            found[f"{name}_p{p:g}_us"] = round(float(value) / 1e3, 1)
    return found
