"""Hours without a pause: memory, drift and latency of an environment with a detector online.

One environment runs without a reset; another is reset over and over. Ctrl-C ends a run and shows
what there is until then.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from tauguard.report import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tauguard.envs.base import ArmEnv

Array = NDArray[np.float64]

#: Simulated hours and resets of a full and of a quick run; rows of the table in each.
HOURS, RESETS, PARTS = (10.0, 0.02), (100_000, 500), (20, 4)
#: Actions a second, and the percentiles of their times.
RATE, PERCENTILES = 100.0, (50.0, 99.0, 99.9, 99.99)
#: The arm turns about home by so much [rad], in so many seconds a joint.
SWING, PERIODS = 0.4, (3.1, 4.3, 5.9, 2.3, 7.1, 3.7)
#: How the arm comes back to its path [1/s].
FOLLOW = 2.0
#: Simulated time of an action [us].
PERIOD = 1e6 / RATE

NOTES = {
    "online": "one environment with the momentum observer, measured signals, no reset: simulated "
    "hours so far, memory of the process, rms residual and alarms of collision-free motion, time "
    "of an action (10 ms of physics, 10 samples of the observer): cpu is what the processor gave "
    "it, the others are wall time, other programs' turns included.",
    "resets": "the same environment reset over and over: resets so far, memory, time of one.",
    "growth": "memory at the end over that after the first tenth; drift: rms residual of the last "
    "tenth over the first's.",
}


def run(quick: bool, seed: int) -> list[Row]:
    """A row a part of the run, and one for each kind's growth."""
    return [*resets(quick, seed), *online(quick, seed)]


def environment() -> ArmEnv:
    """An arm alone, with a detector."""
    made = gymnasium.make(
        "tauguard:tauguard/Reach-v0", obstacles=(), detector="observer", noise=True
    )
    inner: Any = made.unwrapped
    env: ArmEnv = inner
    return env


def memory() -> float:
    """Resident memory of this process [MiB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def online(quick: bool, seed: int) -> list[Row]:
    """Follow one periodic motion for hours."""
    env = environment()
    env.reset(seed=seed)
    home = env.world.scene.home
    omega = 2 * np.pi / np.resize(PERIODS, len(home))
    top = env.world.scene.facts.max_speed
    parts, actions = PARTS[quick], round(HOURS[quick] * 3600 * RATE)
    rows: list[Row] = []
    times = np.arange(actions // parts) / RATE
    spent, own = (np.zeros(len(times), np.int64) for _ in range(2))
    squares = np.zeros(len(home))
    try:
        for part in range(parts):
            squares[:], alarms = 0.0, 0
            for k, t in enumerate(times):
                moment = omega * (t + part * times.size / RATE)
                q = env.cell.datas[0].qpos[env.world.scene.qpos_adr]
                wanted = SWING * omega * np.cos(moment) + FOLLOW * (
                    home + SWING * np.sin(moment) - q
                )
                action = np.clip(wanted / top, -1, 1)
                begin, mine = time.perf_counter_ns(), time.thread_time_ns()
                *_, info = env.step(action)
                own[k] = time.thread_time_ns() - mine
                spent[k] = time.perf_counter_ns() - begin
                squares += np.square(info["residual"])
                alarms += bool(info["alarm"])
            rms = float(np.sqrt(squares / len(times)).max())
            hours = (part + 1) * len(times) / RATE / 3600
            row: Row = {"study": "online", "hours": hours, "memory [MiB]": memory()}
            rows.append(row | {"rms residual [N m]": rms, "alarms": alarms} | quantiles(spent, own))
            print(rows[-1], flush=True)
    except KeyboardInterrupt:
        print("stopped")
    return [*rows, *growth("online", rows)]


def resets(quick: bool, seed: int) -> list[Row]:
    """Begin an episode again and again."""
    env = environment()
    env.reset(seed=seed)
    each = RESETS[quick] // PARTS[quick]
    rows: list[Row] = []
    spent, own = (np.zeros(each, np.int64) for _ in range(2))
    still = np.zeros(env.action_space.shape or ())
    try:
        for part in range(PARTS[quick]):
            for k in range(each):
                begin, mine = time.perf_counter_ns(), time.thread_time_ns()
                env.reset()
                own[k] = time.thread_time_ns() - mine
                spent[k] = time.perf_counter_ns() - begin
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
    """Memory, residual and latency over the run."""
    top, middle, low = figure.subplots(3, 1)
    for study, axes, over in (("online", low, "hours"), ("resets", None, "resets")):
        own = [row for row in rows if row["study"] == study]
        share = np.array([float(row[over]) for row in own])
        top.plot(share / share[-1], [row["memory [MiB]"] for row in own], label=f"{study}, "
                 f"{share[-1]:g} {'h' if over == 'hours' else 'resets'}")  # fmt: skip
        if axes is None:
            continue
        middle.plot(share, [row["rms residual [N m]"] for row in own])
        for k, p in enumerate(PERCENTILES):
            for kind, line in (("", "-"), ("cpu ", ":")):
                values = [row[f"{kind}p{p:g} [us]"] for row in own]
                axes.semilogy(share, values, line, color=f"C{k}", label=f"{kind}p{p:g}")
        axes.axhline(PERIOD, color="black", linewidth=0.8, label="the action's 10 ms")
    top.set(xlabel="share of the run", ylabel="memory [MiB]")
    middle.set(xlabel="simulated hours", ylabel="largest rms residual [N m]")
    for axes in (top, middle):
        axes.set_ylim(0, 1.25 * axes.get_ylim()[1])
    low.set(xlabel="simulated hours", ylabel="time of an action [us]")
    low.set_ylim(top=30 * low.get_ylim()[1])  # room for the names of the lines
    for axes in (top, low):
        axes.legend(frameon=False, ncols=5, loc="upper center", fontsize="x-small")
