"""Guarded steps on scenes drawn at random, beside plain steps, MuJoCo's own modes and fine steps.

Studies. ``thrown``: families of scenes (:mod:`studies.contacts.draws`), each scene at
one timestep of 0.5 to 10 ms, by every method, judged from outside
(:mod:`studies.contacts.referee`). ``overhead``: scenes in which nothing is to be
guarded. Which scenes come follows from the seed alone; none of them was chosen.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from studies.contacts.draws import FAMILIES
from studies.contacts.play import Line, Played, lines
from studies.framework import answer
from tauguard.contacts import GuardedStepper
from tauguard.contacts.scenes import arm_boxes, arm_cloth
from tauguard.report import Row, rate

#: Scenes of each family: in a full run, in a quick one.
COUNTS = {
    "plate": (400, 16),
    "pair": (250, 12),
    "chain": (70, 4),
    "cup": (8, 1),
    "arm": (40, 4),
    "cloth": (20, 2),
    "composite": (150, 8),
    "stack": (80, 4),
    "joined": (80, 4),
    "spin": (60, 4),
    "soft": (20, 2),
    "mill": (60, 2),
    "grid": (40, 2),
    "small": (40, 2),
    "door": (40, 2),
    "servo": (40, 1),
    "whips": (40, 2),
    "paddle": (80, 3),
    "squeeze": (20, 1),
    "needles": (60, 2),
}
#: What cannot be held: something goes on by itself through what is in its way.
HOPELESS = ("squeeze",)
#: Fixed steps that are tried, with stiff contacts [s].
FIXED = (5e-4, 2e-4, 1e-4, 5e-5)
#: Energy that counts as added: more than this times what there was.
ADDED = 1.02

NOTES = {
    "thrown": "held: nothing passed; silent: it did, unreported; arrested: scenes with partners "
    "stopped; energy: the most over that at first (mocap: over all bodies at twice its speed); "
    f"above: scenes with more than {ADDED:g}; redone above: of those redone, with more than plain "
    "steps; redone added: most that redone steps gave, rebound and mocap's work included; over "
    "plain: time over plain steps'; over fixed: over the largest fixed step (stiff contacts) from "
    "which all finer ones hold, fixed_ms, one scene in four; unknown: none holds; error: of the "
    "first body's last velocity against the finest step's, over the speed. Medians. Squeeze cannot "
    "be held.",
    "overhead": "a step of a scene in which nothing is to be guarded, plain and guarded.",
}


def measure(quick: bool, seed: int, keep: str | None = None) -> list[Row]:
    """Rows of both studies and of what they say together.

    Scenes that the folder ``keep`` holds are not played again.
    """
    rows: list[Row] = []
    for family, counts in COUNTS.items():
        rows += _family_rows(family, seed, counts[quick], quick, Path(keep) if keep else None)
    return [*rows, *_overhead_rows(quick), *_summary(rows)]


def _family_rows(
    family: str, seed: int, count: int, quick: bool, keep: Path | None = None
) -> list[Row]:
    """One row a method and timestep, and one of all timesteps."""
    methods = ["plain", "speculative", "guarded"]
    if family in ("cloth", "soft"):
        methods.insert(2, "ipc")
    fixed = FIXED[1:3] if quick else FIXED
    table = list(lines(family, seed, count, methods, fixed, keep))
    groups = [*sorted({line.timestep for line in table}), None]
    return [_row(family, seed, method, group, table) for method in methods for group in groups]


def _row(
    family: str,
    seed: int,
    method: str,
    timestep: float | None,
    table: list[Line],
) -> Row:
    chosen = [t for t in table if timestep is None or t.timestep == timestep]
    runs: list[Played] = [t.runs[method] for t in chosen]
    known = [(t, t.first) for t in chosen if t.first is not None]
    lost = [r for r in runs if not r.held]
    redone = [r for r in runs if r.touched]
    return {
        "study": "thrown",
        "family": family,
        "seeds": f"{seed}, 0 to {len(table) - 1}",
        "method": method,
        "timestep_ms": "all" if timestep is None else 1e3 * timestep,
        "held": rate(len(runs) - len(lost), len(runs)),
        "silent": sum(not r.exhausted for r in lost),
        "exhausted": sum(r.exhausted for r in runs),
        "arrested": sum(r.arrested for r in runs),
        "energy": max(r.energy for r in runs),
        "energy_above": sum(r.energy > ADDED for r in runs),
        "energy_redone": max((r.energy for r in redone), default=None),
        "redone_above": _above(chosen) if method == "guarded" else None,
        "redone_added": max(r.added for r in runs) if method == "guarded" else None,
        "calls": float(np.mean([r.calls for r in runs])) if method == "guarded" else None,
        "over_plain": _median(t.runs[method].seconds / t.runs["plain"].seconds for t in chosen),
        "over_fixed": _median(t.runs[method].seconds / t.fine[first].seconds for t, first in known),
        "fixed_ms": _median(1e3 * first for _, first in known),
        "unknown": sum(bool(t.fine) and t.first is None for t in chosen),
        "error": _median(_error(t, method) for t, _ in known if t.speed > 0),
    }


def _above(chosen: list[Line]) -> int:
    """In how many scenes with redone steps energy is above what there was, and plain steps'."""
    pairs = [(t.runs["guarded"], t.runs["plain"]) for t in chosen]
    return sum(a.touched and a.energy > max(ADDED, b.energy) for a, b in pairs)


def _error(line: Line, method: str) -> float:
    """Of the first body's velocity at the end, over the speed of the thrown body at the start."""
    apart = np.subtract(line.runs[method].velocity, line.fine[min(line.fine)].velocity)
    return float(np.linalg.norm(apart) / line.speed)


def _median(values: Iterable[float]) -> float | None:
    found = list(values)
    return float(np.median(found)) if found else None


def _overhead_rows(quick: bool) -> list[Row]:
    """Plain and guarded steps of scenes in which nothing is missed, in turn."""
    rows = []
    steps = 60 if quick else 300
    for scene in (
        [arm_boxes(), arm_cloth(15)] if quick else [arm_boxes(), arm_cloth(15), arm_cloth(40)]
    ):
        times: dict[str, list[float]] = {"plain": [], "guarded": []}
        states = {name: scene.start(2e-3) for name in times}
        guard, cuts = GuardedStepper(*states["guarded"]), 0
        for _ in range(steps):
            for name, (model, data) in states.items():
                if scene.control is not None:
                    scene.control(model, data)
                begin = time.process_time()
                if name == "plain":
                    mujoco.mj_step(model, data)
                else:
                    cuts += len(guard.step().cuts)
                times[name].append(1e6 * (time.process_time() - begin))
        same = all(
            np.array_equal(getattr(states["plain"][1], f), getattr(states["guarded"][1], f))
            for f in ("qpos", "qvel", "qacc_warmstart")
        )
        plain, guarded = (
            dict(zip(("low", "median", "high"), np.quantile(t, [0.1, 0.5, 0.9]), strict=True))
            for t in times.values()
        )
        rows.append(
            {
                "study": "overhead",
                "scene": scene.name,
                "dofs": scene.model.nv,
                "plain_us": plain,
                "guarded_us": guarded,
                "over_plain": guarded["median"] / plain["median"],
                "cuts": cuts,
                "same_bits": same,
            }
        )
    return rows


def _summary(rows: list[Row]) -> list[Row]:
    """What the tables say, beside what was asked."""
    whole = [r for r in rows if r["timestep_ms"] == "all"]
    out = []
    for method in ("plain", "speculative", "ipc", "guarded"):
        mine = [r for r in whole if r["method"] == method and r["family"] not in HOPELESS]
        runs = sum(r["held"]["n"] for r in mine)
        held = sum(round(r["held"]["value"] * r["held"]["n"]) for r in mine)
        guarded = method == "guarded"
        met = held == runs if guarded else None
        out.append(
            answer(f"{method}: held", "all" if guarded else "figure", f"{held} of {runs}", met)
        )
    mine = [r for r in whole if r["method"] == "guarded"]
    for key, name in (("silent", "lost without a word"), ("exhausted", "gave up, and said so")):
        count = sum(r[key] for r in mine if key == "silent" or r["family"] not in HOPELESS)
        out.append(answer(f"guarded: {name}", "0", str(count), count == 0))
    figures = (
        ("energy_above", "scenes with added energy", None),
        ("redone_added", "energy added by redone steps", None),
        ("over_plain", "time over plain steps", 3.0),
        ("over_fixed", "time over the largest fixed step that holds", 1.0),
    )
    for key, name, bar in figures:
        text = ", ".join(f"{r['family']} {r[key]:.3g}" for r in mine if r[key] is not None)
        met = None if bar is None else all(r[key] is None or r[key] <= bar for r in mine)
        out.append(
            answer(f"guarded: {name}", "figure" if bar is None else f"<= {bar:g}", text, met)
        )
    return out


def table(rows: list[Row]) -> list[Row]:
    """The rows of all timesteps together, and those of the guard at each."""
    return [
        r
        for r in rows
        if r["study"] != "thrown" or r["timestep_ms"] == "all" or r["method"] == "guarded"
    ]


def draw(rows: list[Row], figure: Any) -> None:
    """Share that is held, and time over the first fixed step that holds, a group a family."""
    whole = [r for r in rows if r["study"] == "thrown" and r["timestep_ms"] == "all"]
    families = [f for f in FAMILIES if any(r["family"] == f for r in whole)]
    looks = {"plain": "0.6", "speculative": "C1", "ipc": "C2", "guarded": "C0"}
    top, bottom = figure.subplots(2, 1, sharex=True)
    for k, (method, color) in enumerate(looks.items()):
        mine = [r for r in whole if r["method"] == method]
        x = [families.index(r["family"]) + 0.2 * k - 0.3 for r in mine]
        top.bar(x, [100 * r["held"]["value"] for r in mine], 0.18, color=color, label=method)
        known = [(a, r["over_fixed"]) for a, r in zip(x, mine, strict=True) if r["over_fixed"]]
        bottom.bar([a for a, _ in known], [b for _, b in known], 0.18, color=color)
    top.set(ylabel="held [%]", ylim=(0, 105))
    bottom.set(ylabel="time over the first\nfixed step that holds", yscale="log")
    bottom.axhline(1.0, color="0.3", lw=0.8)
    bottom.set_xticks(range(len(families)), families)
    top.legend(ncols=4, loc="upper center", bbox_to_anchor=(0.5, 1.18), frameon=False)
    for axis in (top, bottom):
        axis.grid(axis="y", alpha=0.3)
        axis.set_axisbelow(True)
