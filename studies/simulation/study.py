"""What each listed thing of a scene costs per step, and what the time step costs in accuracy."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from oracles.bare_physics import rollout_along
from studies.framework import time_in_turn
from tauguard.envs import Motion, SimulationLoop, random_motion
from tauguard.envs.episodes.simulate import workspace
from tauguard.models import (
    BodyProxy,
    Clamp,
    Cloth,
    Drive,
    Scene,
    SceneSpec,
    Striker,
    Table,
    compose,
    cura6_drive,
)
from tauguard.report import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Time step of the reference [s].
REFERENCE = 1e-4

#: What the columns of each table mean.
NOTES = {
    "cost": "wall time of a step of 1 ms along one motion, one thread, median [least, most]. The "
    "peer is MuJoCo's own rollout of the bare arm, given the motion's torques; each other row is "
    "the arm under position control with what it names. Composing the scene is not in it.",
    "timestep": "largest joint error of the whole drive along one motion, every 2 ms, against the "
    "same at 0.1 ms: a difference of time steps, not from a real arm.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """Tables ``cost`` (what a thing adds) and ``timestep`` (error against cost)."""
    seconds = 5.0 if quick else 60.0
    bare = compose(SceneSpec(labels=False))
    motion = random_motion(np.random.default_rng(seed), workspace(bare), seconds, 30.0)
    return costs(motion, 5 if quick else 15) + timesteps(seed, 3.0 if quick else 10.0)


def costs(motion: Motion, repeats: int) -> list[Row]:
    """Microseconds a step: MuJoCo alone, then with one thing more each."""
    drive = cura6_drive()
    ideal = replace(drive, friction=None, ripple=None, sensors=None, electrical_time_constant=None)
    bare = SceneSpec(labels=False)
    hand, cloth = BodyProxy("hand", (2.5, 0, 0.8)), Cloth(count=8, position=(2.5, 0, 0.8))
    scenes: dict[str, tuple[SceneSpec, Drive]] = {
        "ideal drive": (bare, ideal),
        "+ friction": (bare, replace(ideal, friction=drive.friction)),
        "+ ripple": (bare, replace(ideal, ripple=drive.ripple)),
        "whole drive": (bare, drive),
        "whole drive, labels": (SceneSpec(), drive),
        "whole drive, payload": (SceneSpec(labels=False, payload=True), drive),
        "whole drive, labels, striker": (SceneSpec(striker=Striker()), drive),
        "whole drive, labels, clamp": (SceneSpec(clamp=Clamp()), drive),
        "whole drive, labels, hand proxy": (SceneSpec(proxies=(hand,)), drive),
        "whole drive, labels, table": (SceneSpec(table=Table((2.5, 0, 0.1))), drive),
        "whole drive, labels, cloth 8 x 8": (SceneSpec(cloth=cloth), drive),
    }
    calls: dict[str, Any] = {"mujoco.rollout, torques given": rollout_along(motion)}
    for name, (spec, parts) in scenes.items():
        calls[name] = loop_call(replace(compose(spec), drive=parts), motion)
    taken = time_in_turn(calls, repeats)
    steps = len(motion.t)
    base = taken["mujoco.rollout, torques given"]["median"]
    return [
        {
            "study": "cost",
            "scene": name,
            "us_per_step": {k: 1e6 * v / steps for k, v in figure.items()},
            "ratio_to_rollout": figure["median"] / base,
        }
        for name, figure in taken.items()
    ]


def loop_call(scene: Scene, motion: Motion) -> Any:
    """One run of the simulation loop along the motion."""
    loop = SimulationLoop(scene, cura6_drive())
    still = np.zeros_like(motion.q)

    def call() -> None:
        loop.reset(motion.q[0])
        loop.run(motion.q, motion.qd, still)

    return call


def timesteps(seed: int, seconds: float) -> list[Row]:
    """Largest joint error at the end of each millisecond against the reference step, and cost."""
    rows: list[Row] = []
    reference = follow(seed, seconds, REFERENCE)
    for timestep in (2e-4, 5e-4, 1e-3, 2e-3):
        scene, motion = moved(seed, seconds, timestep)
        call = loop_call(scene, motion)
        taken = time_in_turn({"loop": call}, 3)["loop"]
        got = follow(seed, seconds, timestep)
        coarse, fine = round(2e-3 / timestep), round(2e-3 / REFERENCE)
        n = min(len(got[::coarse]), len(reference[::fine]))
        error = np.abs(got[::coarse][:n] - reference[::fine][:n]).max()
        rows.append(
            {
                "study": "timestep",
                "timestep_ms": 1e3 * timestep,
                "us_per_simulated_ms": {k: 1e3 * v / seconds for k, v in taken.items()},
                "q_error_rad": float(error),
            }
        )
    return rows


def moved(seed: int, seconds: float, timestep: float) -> tuple[Scene, Motion]:
    """A scene at a time step and the same motion sampled at it."""
    scene = compose(SceneSpec(labels=False, timestep=timestep))
    rng = np.random.default_rng(seed)
    return scene, random_motion(rng, workspace(scene), seconds, 30.0, timestep)


def follow(seed: int, seconds: float, timestep: float) -> np.ndarray:
    """Joint positions of a run at a time step, shape (T, n)."""
    scene, motion = moved(seed, seconds, timestep)
    loop = SimulationLoop(scene, cura6_drive())
    loop.reset(motion.q[0])
    return loop.run(motion.q, motion.qd, np.zeros_like(motion.q)).q


def draw(rows: list[Row], figure: Figure) -> None:
    """Cost of each thing as bars; error against cost over the time step."""
    from matplotlib.ticker import LogLocator, NullFormatter

    left, right = figure.subplots(1, 2)
    cost = [row for row in rows if row["study"] == "cost"]
    names = [row["scene"] for row in cost]
    left.barh(names, [row["us_per_step"]["median"] for row in cost], color="C0")
    left.invert_yaxis()
    left.set(xlabel="microseconds a step", title="What a scene's parts cost")
    steps = [row for row in rows if row["study"] == "timestep"]
    x = [row["us_per_simulated_ms"]["median"] for row in steps]
    y = [row["q_error_rad"] for row in steps]
    right.loglog(x, y, "o", color="C1")
    right.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    right.xaxis.set_major_formatter("{x:g}")
    right.xaxis.set_minor_formatter(NullFormatter())
    right.margins(x=0.15)
    for row, a, b in zip(steps, x, y, strict=True):
        right.annotate(f" {row['timestep_ms']:g} ms", (a, b))
    right.set(
        xlabel="microseconds per simulated millisecond",
        ylabel="largest joint error against 0.1 ms [rad]",
        title="Time step: speed against error",
    )
    right.grid(alpha=0.3)
