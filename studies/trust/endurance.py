"""Hours without a pause: memory, drift and latency of an environment with a detector online.

One environment runs without a reset; another is reset over and over. The detector is trained, and
its fault checks run with it. Ctrl-C ends a run and shows what there is until then.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from studies.small_detector import trained
from tauguard.report import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tauguard.envs.gym.base import ArmEnv


#: Simulated hours and resets of a full and of a quick run; rows of the table in each.
HOURS, RESETS, PARTS = (10.0, 0.02), (100_000, 500), (20, 4)
#: Physics and samples a second, actions a second, and the percentiles of their times.
SAMPLES, RATE, PERCENTILES = 250.0, 50.0, (50.0, 99.0, 99.9, 99.99)
#: Training: collision-free seconds, speeds, and false alarms an hour that it aims at.
SECONDS, EPISODES, SPEEDS, PER_HOUR = 20.0, 12, (20.0, 40.0, 60.0), 1.0
#: The arm turns about home by so much [rad], in so many seconds a joint.
SWING, PERIODS = 0.4, (3.1, 4.3, 5.9, 2.3, 7.1, 3.7)
#: How the arm comes back to its path [1/s]; it begins the motion over so long [s].
FOLLOW, BEGIN = 2.0, 5.0
#: Simulated time of an action [us].
PERIOD = 1e6 / RATE

NOTES = {
    "online": "one environment with a trained detector and its fault checks, measured signals at "
    "250 Hz, no reset: hours so far, memory, rms residual, alarms and faults of collision-free "
    "motion, time of an action (20 ms): cpu is what the processor gave it, the others are wall "
    "time, other programs' turns included.",
    "resets": "the same environment reset over and over, every tenth time with an action: resets "
    "so far, memory, time of one.",
    "growth": "memory at the end less that after the first tenth; drift: rms residual of the last "
    "part over that of the first tenth.",
}


def run(quick: bool, seed: int) -> list[Row]:
    """A row a part of the run, and one for each kind's growth."""
    alarm = detector(seed)
    return [*resets(quick, seed, alarm), *online(quick, seed, alarm)]


def detector(seed: int) -> Any:
    """A detector trained on simulated collision-free motion of the same arm."""
    from tauguard.datasets.plans import free_episodes
    from tauguard.envs import simulate

    episodes = free_episodes(seed, EPISODES, SECONDS, SPEEDS, (0.0,), None)
    return trained([simulate(episode) for episode in episodes], SAMPLES, PER_HOUR)


def environment(alarm: Any) -> ArmEnv:
    """An arm alone, with the detector."""
    made = gymnasium.make(
        "tauguard:tauguard/Reach-v0",
        obstacles=(),
        detector=alarm,
        noise=True,
        timestep=1 / SAMPLES,
        control_rate=RATE,
    )
    inner: Any = made.unwrapped
    env: ArmEnv = inner
    return env


def memory() -> float:
    """Resident memory of this process [MiB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def online(quick: bool, seed: int, alarm: Any) -> list[Row]:
    """Follow one periodic motion for hours."""
    env = environment(alarm)
    env.reset(seed=seed)
    parts, actions = PARTS[quick], round(HOURS[quick] * 3600 * RATE)
    rows: list[Row] = []
    each = actions // parts
    try:
        for part in tqdm(range(parts), desc="online", disable=None, leave=False):
            found = followed(env, part * each / RATE, each)
            rows.append({"study": "online", "hours": (part + 1) * each / RATE / 3600} | found)
    except KeyboardInterrupt:
        print("stopped")
    return [*rows, *growth("online", rows)]


def followed(env: ArmEnv, begin: float, count: int) -> Row:
    """So many actions of the motion from ``begin`` [s] on: what they showed and took."""
    home, top = env.world.scene.home, env.world.scene.facts.max_speed
    omega = 2 * np.pi / np.resize(PERIODS, len(home))
    spent, own = (np.zeros(count, np.int64) for _ in range(2))
    squares, up, alarms, faults = np.zeros(len(home)), False, 0, 0
    for k in range(count):
        t = begin + k / RATE
        swing = SWING * min(1.0, t / BEGIN)
        q = env.cell.datas[0].qpos[env.world.scene.qpos_adr]
        back = FOLLOW * (home + swing * np.sin(omega * t) - q)
        action = np.clip((swing * omega * np.cos(omega * t) + back) / top, -1, 1)
        wall, mine = time.perf_counter_ns(), time.thread_time_ns()
        *_, info = env.step(action)
        own[k] = time.thread_time_ns() - mine
        spent[k] = time.perf_counter_ns() - wall
        squares += np.square(info["residual"])
        alarms += bool(info["alarm"]) and not up
        up = bool(info["alarm"])
        faults += bool(info["fault"])
    rms = float(np.sqrt(squares / count).max())
    row: Row = {"memory [MiB]": memory(), "rms residual [N m]": rms, "alarms": alarms}
    return row | {"actions at fault": faults} | quantiles(spent, own)


def resets(quick: bool, seed: int, alarm: Any) -> list[Row]:
    """Begin an episode again and again."""
    env = environment(alarm)
    env.reset(seed=seed)
    each = RESETS[quick] // PARTS[quick]
    rows: list[Row] = []
    spent, own = (np.zeros(each, np.int64) for _ in range(2))
    still = np.zeros(env.action_space.shape or ())
    try:
        for part in tqdm(range(PARTS[quick]), desc="resets", disable=None, leave=False):
            for k in range(each):
                wall, mine = time.perf_counter_ns(), time.thread_time_ns()
                env.reset()
                own[k] = time.thread_time_ns() - mine
                spent[k] = time.perf_counter_ns() - wall
                if k % 10 == 0:
                    env.step(still)
            row: Row = {"study": "resets", "resets": (part + 1) * each, "memory [MiB]": memory()}
            rows.append(row | quantiles(spent, own))
    except KeyboardInterrupt:
        print("stopped")
    return [*rows, *growth("resets", rows)]


def quantiles(wall: NDArray[np.int64], cpu: NDArray[np.int64]) -> Row:
    """Percentiles of times, given in nanoseconds [us]."""
    found: Row = {}
    for name, nanoseconds in (("", wall), ("cpu ", cpu)):
        values = np.percentile(nanoseconds / 1e3, PERCENTILES)
        for p, value in zip(PERCENTILES, values, strict=True):
            found[f"{name}p{p:g} [us]"] = float(value)
    return found


def growth(study: str, rows: list[Row]) -> list[Row]:
    """What has changed from the first tenth to the last."""
    if len(rows) < 2:
        return []
    first = max(0, len(rows) // 10 - 1)
    row: Row = {
        "study": "growth",
        "of": study,
        "parts": len(rows),
        "memory [MiB]": float(rows[-1]["memory [MiB]"]) - float(rows[first]["memory [MiB]"]),
    }
    if study == "online":
        last, begin = (float(rows[k]["rms residual [N m]"]) for k in (-1, first))
        row["drift"] = last / begin
    return [row]


def draw(rows: list[Row], figure: Figure) -> None:
    """Memory, residual and latency over the run, a panel each, names of lines beside them."""
    memories, residual, latency = figure.subplots(3, 1, height_ratios=(1, 1, 2))
    for study, over, unit in (("online", "hours", "h"), ("resets", "resets", "resets")):
        own = [row for row in rows if row["study"] == study]
        if not own:
            continue
        along = np.array([float(row[over]) for row in own])
        name = f"{study}, {along[-1]:,g} {unit}"
        memories.plot(along / along[-1], [row["memory [MiB]"] for row in own], ".-", label=name)
    own = [row for row in rows if row["study"] == "online"]
    hours = [row["hours"] for row in own]
    residual.plot(hours, [row["rms residual [N m]"] for row in own], ".-")
    for k, p in enumerate(PERCENTILES):
        for kind, line in (("", "-"), ("cpu ", ":")):
            values = [float(row[f"{kind}p{p:g} [us]"]) / 1e3 for row in own]
            latency.semilogy(hours, values, line, color=f"C{k}", label=f"{kind}p{p:g}")
    latency.axhline(PERIOD / 1e3, color="black", linewidth=0.8, label=f"{PERIOD / 1e3:g} ms")
    memories.set(xlabel="share of the run", ylabel="memory [MiB]")
    residual.set(ylabel="residual, rms [N m]")
    for axes in (memories, residual):
        axes.set_ylim(0, 1.2 * axes.get_ylim()[1])
    latency.set(xlabel="simulated hours", ylabel=f"time of an action of {PERIOD / 1e3:g} ms [ms]")
    for axes in (memories, latency):
        axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="small")
