"""Guarded steps on random scenes, beside plain steps, MuJoCo's own modes and fine fixed steps.

The tunnelling oracle checks every scene, at one time step of 0.5 to 10 ms. The scenes depend only
on the seed. Table ``overhead`` has scenes without fast contacts.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from oracles.energy import EnergyGain
from oracles.tunnelling import Tunnelling
from scenes import rigid, soft
from scenes.drawing import Drawn
from studies.framework import JobCache, answer, table_rows
from tauguard.contacts import GuardedStepper
from tauguard.contacts.scenes import arm_boxes, arm_cloth
from tauguard.report import Row, rate

#: Families by name: the function that draws a scene, and the number of scenes in a full and a quick
#: run. Seeds depend on this order, so a new family goes at the end.
FAMILIES: dict[str, tuple[Callable[[np.random.Generator], Drawn], int, int]] = {
    draw.__name__: (draw, full, quick)
    for draw, full, quick in (
        *((rigid.plate, 400, 16), (rigid.pair, 250, 12), (rigid.chain, 70, 4), (rigid.cup, 8, 1)),
        *((rigid.arm, 40, 4), (soft.cloth, 20, 2), (rigid.composite, 150, 8), (rigid.stack, 80, 4)),
        *((rigid.joined, 80, 4), (rigid.spin, 60, 4), (soft.soft, 20, 2), (rigid.mill, 60, 2)),
        *((rigid.grid, 40, 2), (rigid.small, 40, 2), (rigid.door, 40, 2), (rigid.servo, 40, 1)),
        *((rigid.whips, 40, 2), (rigid.paddle, 80, 3), (rigid.squeeze, 20, 1)),
        (soft.needles, 60, 2),
    )
}
#: Fixed steps with stiff contacts [s]; only every fourth scene tries them, because they are slow.
FIXED, FIXED_EVERY = (5e-4, 2e-4, 1e-4, 5e-5), 4
#: A scene gains energy if its largest energy exceeds this factor times its initial energy.
ADDED = 1.02
METHODS = ("plain", "speculative", "ipc", "guarded")

NOTES = {
    "thrown": "numbers of scenes. held: nothing tunnelled; silent: tunnelling without a report; "
    "exhausted: the guard reported that it may tunnel; impact_zones: pairs were moved rigidly. "
    "energy: largest / initial energy (with a mocap body: / energy of all bodies at twice its "
    f"speed); energy_above: energy above {ADDED:g}; rolled_back_above: the same, with a rollback "
    "and more than in plain steps; rolled_back_added: most energy from rollbacks. Medians: "
    "over_plain: time / time of plain steps; over_fixed: time / time of fixed steps of fixed_ms, "
    "the largest with which, and with finer ones, nothing tunnels (stiff; one scene in 4).",
    "overhead": "a step of a scene without fast contacts, plain and guarded.",
}


@dataclass(frozen=True)
class Outcome:
    """The result of one scene with one method."""

    held: bool
    exhausted: bool
    impact_zones: bool
    rolled_back: bool  #: the guard rolled back a step
    energy: float  #: largest energy, as a multiple of the initial energy (see NOTES)
    seconds: float  #: processor time of the steps alone
    calls: float  #: calls of ``mj_step`` per step
    added: float = 0.0  #: largest sum of energies that rollbacks added; 0 with actuators


@dataclass(frozen=True)
class Played:
    """One scene with every method."""

    timestep: float  #: time step of every method except the fixed steps [s]
    runs: dict[str, Outcome]  #: outcome of each method
    fixed: dict[float, Outcome]  #: outcomes by fixed step [s]; empty if none was tried

    @property
    def first(self) -> float | None:
        """The largest fixed step [s] such that nothing tunnels with it or with a finer step."""
        return max((step for step, run in self.fixed.items() if run.held), default=None)


def measure(quick: bool, seed: int, keep: str | None = None) -> list[Row]:
    """Measure every family, then the overhead; ``keep`` is the folder of the job cache."""
    cache, rows = JobCache.of(keep, "guard", seed, quick), []
    for family, (_, full, few) in FAMILIES.items():
        soft = family in ("cloth", "soft")
        methods = [name for name in METHODS if name != "ipc" or soft]
        fixed = FIXED[1:3] if quick else FIXED
        jobs = [
            (family, seed, k, methods, () if k % FIXED_EVERY else fixed)
            for k in range(few if quick else full)
        ]
        played = list(cache.over(map, family)(_play, jobs))
        for method in methods:
            for timestep in (*sorted({one.timestep for one in played}), None):
                chosen = [one for one in played if timestep in (None, one.timestep)]
                when = "all" if timestep is None else 1e3 * timestep
                here = {"study": "thrown", "family": family, "method": method}
                rows.append({**here, "timestep_ms": when, **_figures(chosen, method)})
    examples = [arm_boxes(), arm_cloth(15)] + ([] if quick else [arm_cloth(40)])
    return rows + [_overhead(scene, 60 if quick else 300) for scene in examples]


def _play(job: tuple[str, int, int, Sequence[str], Sequence[float]]) -> Played:
    family, seed, number, methods, fixed = job
    rng = np.random.default_rng([seed, list(FAMILIES).index(family), number])
    scene = FAMILIES[family][0](rng)
    runs = {method: play(scene, method, scene.timestep) for method in methods}
    return Played(scene.timestep, runs, fixed_steps(scene, fixed) if fixed else {})


def fixed_steps(scene: Drawn, fixed: Sequence[float]) -> dict[float, Outcome]:
    """Simulate with stiff fixed steps, from fine to coarse, up to the first with tunnelling.

    The finest step is tried only if something tunnels with the next one.
    """
    out: dict[float, Outcome] = {}
    finest, *coarser = sorted(fixed)
    for step in coarser:
        out[step] = play(scene, "plain", step, stiff=True)
        if not out[step].held:
            break
    if not coarser or not out[coarser[0]].held:
        out[finest] = play(scene, "plain", finest, stiff=True)
    return out


@contextmanager
def unwarned() -> Iterator[None]:
    """Silence MuJoCo's warnings: plain steps are expected to diverge here."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


@unwarned()
def play(scene: Drawn, method: str, timestep: float, stiff: bool = False) -> Outcome:
    """Simulate ``scene`` to its end; ``method`` is ``guarded`` or one of MuJoCo's modes."""
    flag = getattr(mujoco.mjtEnableBit, f"mjENBL_{method.upper()}", 0)
    model, data = scene.start(timestep, int(flag), stiff)
    tunnelling, energy = Tunnelling(model, data), EnergyGain(model, data, scene.energy_unit)
    guard = GuardedStepper(model, data) if method == "guarded" else None
    every, steps = max(1, round(5e-4 / timestep)), round(scene.seconds / timestep) + 1
    spent, paused, calls, change, added = 0.0, 0.0, 0, 0.0, 0.0
    exhausted = impact_zones = rolled_back = False

    def observe() -> None:
        nonlocal paused
        begin = time.thread_time()
        energy.observe(data)
        tunnelling.observe(data)
        paused += time.thread_time() - begin

    for k in range(steps):
        if scene.move is not None:
            scene.move(data, data.time + timestep)
        begin, paused = time.thread_time(), 0.0
        if guard is None:
            mujoco.mj_step(model, data)
        else:
            report = guard.step(observe)
            calls += report.steps
            exhausted |= report.exhausted
            impact_zones |= bool(report.impact_zones)
            rolled_back |= report.steps > 1
        spent += time.thread_time() - begin - paused
        if guard is not None and not model.nu and (balance := report.balance) is not None:
            change += float(np.diff(balance.energy.sum(axis=1))[0]) / energy.unit
            added = max(added, change)
        if k % every == every - 1 or k == steps - 1:
            observe()
            if not np.isfinite(energy.most):
                break
    most, held = float(energy.most), not tunnelling.pairs and bool(np.isfinite(energy.most))
    return Outcome(held, exhausted, impact_zones, rolled_back, most, spent, calls / steps, added)


def _figures(chosen: list[Played], method: str) -> Row:
    """Compute the columns of one method over some scenes."""
    runs = [one.runs[method] for one in chosen]
    known = [(one, one.first) for one in chosen if one.first is not None]
    lost, guarded = [run for run in runs if not run.held], method == "guarded"
    pairs = [(one.runs[method], one.runs["plain"]) for one in chosen]
    above = sum(a.rolled_back and a.energy > max(ADDED, b.energy) for a, b in pairs)
    return {
        "held": rate(len(runs) - len(lost), len(runs)),
        "silent": sum(not run.exhausted for run in lost),
        "exhausted": sum(run.exhausted for run in runs),
        "impact_zones": sum(run.impact_zones for run in runs),
        "energy": max(run.energy for run in runs),
        "energy_above": sum(run.energy > ADDED for run in runs),
        "rolled_back_above": above if guarded else None,
        "rolled_back_added": max(run.added for run in runs) if guarded else None,
        "calls": float(np.mean([run.calls for run in runs])) if guarded else None,
        "over_plain": _median(a.seconds / b.seconds for a, b in pairs),
        "over_fixed": _median(
            one.runs[method].seconds / one.fixed[first].seconds for one, first in known
        ),
        "fixed_ms": _median(1e3 * first for _, first in known),
    }


def _median(values: Iterable[float]) -> float | None:
    found = list(values)
    return float(np.median(found)) if found else None


def _overhead(scene: Any, steps: int) -> Row:
    """Time plain and guarded steps in turn."""
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
    low, middle, high = np.quantile(list(times.values()), [0.1, 0.5, 0.9], axis=1)
    plain, guarded = (
        {"median": middle[k], "low": low[k], "high": high[k]} for k in range(len(times))
    )
    fields, ends = ("qpos", "qvel", "qacc_warmstart"), [data for _, data in states.values()]
    return {
        "study": "overhead",
        "scene": scene.name,
        "plain_us": plain,
        "guarded_us": guarded,
        "over_plain": guarded["median"] / plain["median"],
        "cuts": cuts,
        "same_bits": all(np.array_equal(*(getattr(d, name) for d in ends)) for name in fields),
    }


def judge(rows: Sequence[Row]) -> list[Row]:
    """Judge scenes held (except `squeeze`, which no method holds), silent tunnelling and time."""
    whole = [row for row in table_rows(rows, "thrown") if row["timestep_ms"] == "all"]
    out: list[Row] = []
    for method in METHODS:
        mine = [r for r in whole if r["method"] == method and r["family"] != "squeeze"]
        runs = sum(r["held"]["n"] for r in mine)
        held = sum(round(r["held"]["value"] * r["held"]["n"]) for r in mine)
        asked, met = ("all", held == runs) if method == "guarded" else ("figure", None)
        out.append(answer(f"{method}: held", asked, f"{held} of {runs}", met))
    mine = [row for row in whole if row["method"] == "guarded"]
    silent = sum(row["silent"] for row in mine)
    out.append(answer("guarded: tunnelling without a report", "0", f"{silent}", not silent))
    for key, most in (("over_plain", 3.0), ("over_fixed", 1.0)):
        known = [row for row in mine if row[key] is not None]
        text = ", ".join(f"{row['family']} {row[key]:.3g}" for row in known)
        met = all(row[key] <= most for row in known)
        out.append(answer(f"guarded: {key.replace('_', ' ')}", f"<= {most:g}", text, met))
    return out


def table(rows: Sequence[Row]) -> list[Row]:
    """The rows over all time steps, and the guard's rows at each time step."""
    return [r for r in rows if r.get("timestep_ms", "all") == "all" or r["method"] == "guarded"]
