"""Cost of each part of a scene per step, and error against cost of the time step."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from oracles.bare_physics import rollout_along
from studies.framework import per, time_in_turn
from tauguard.arrays import Array
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

#: Time step of the reference [s].
REFERENCE = 1e-4
NOTES = {
    "cost": "wall time of a step of 1 ms along one motion, one thread, median [least, most]. The "
    "peer is MuJoCo's own rollout of the bare arm, given the motion's torques; each other row is "
    "the arm under position control with the named things. Composing the scene is not timed.",
    "timestep": "largest joint error of the whole drive along one motion, every 2 ms, relative "
    "to the same simulation at 0.1 ms. It compares time steps, not the simulation with a real "
    "arm.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """Tables ``cost`` (time added by each part) and ``timestep`` (error against cost)."""
    seconds = 5.0 if quick else 60.0
    bare = compose(SceneSpec(labels=False))
    motion = random_motion(np.random.default_rng(seed), workspace(bare), seconds, 30.0)
    return costs(motion, 5 if quick else 15) + timesteps(seed, 3.0 if quick else 10.0)


def costs(motion: Motion, repeats: int) -> list[Row]:
    """Time of a step [us]: MuJoCo alone, then the arm, then the arm with one more part."""
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
            "us_per_step": per(one, steps, 1e6),
            "ratio_to_rollout": one["median"] / base,
        }
        for name, one in taken.items()
    ]


def loop_call(scene: Scene, motion: Motion) -> Callable[[], Any]:
    """One run of the simulation loop along the motion."""
    loop = SimulationLoop(scene, cura6_drive())
    still = np.zeros_like(motion.q)

    def call() -> Any:
        loop.reset(motion.q[0])
        return loop.run(motion.q, motion.qd, still)

    return call


def timesteps(seed: int, seconds: float) -> list[Row]:
    """Largest joint error against the reference time step, compared every 2 ms, and the cost."""
    rows: list[Row] = []
    paths: dict[float, Array] = {}
    for timestep in (REFERENCE, 2e-4, 5e-4, 1e-3, 2e-3):
        scene = compose(SceneSpec(labels=False, timestep=timestep))
        rng = np.random.default_rng(seed)
        motion = random_motion(rng, workspace(scene), seconds, 30.0, timestep)
        call = loop_call(scene, motion)
        paths[timestep] = call().q[:: round(2e-3 / timestep)].copy()
        if timestep == REFERENCE:
            continue
        n = min(len(paths[timestep]), len(paths[REFERENCE]))
        error = np.abs(paths[timestep][:n] - paths[REFERENCE][:n]).max()
        taken = time_in_turn({"loop": call}, 3)["loop"]
        rows.append(
            {
                "study": "timestep",
                "timestep_ms": 1e3 * timestep,
                "us_per_simulated_ms": per(taken, 1, 1e3 / seconds),
                "q_error_rad": float(error),
            }
        )
    return rows
