"""What an environment costs beside its physics, many at once, and what reactions are worth."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import gymnasium
import mujoco
import numpy as np
from gymnasium.vector import SyncVectorEnv
from mujoco import rollout
from mujoco.batch import Batch

from studies.framework import time_in_turn
from studies.simulation.reactions import reactions, trained_detector
from tauguard.contacts import registered
from tauguard.envs.adapters.reactions import REACTIONS
from tauguard.envs.gym.base import ArmEnv
from tauguard.models import body_region
from tauguard.report import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REACH = "tauguard:tauguard/Reach-v0"
#: Copies in the vector study.
COPIES = 16
#: The peers of one environment: MuJoCo's own loop with the forces given, and with the drives.
ROLLOUT, PHYSICS = "mujoco.rollout, forces given", "physics and drives, no environment"
WHOLE, THREADED = "the environment", "make_vec, 2 threads"

#: What the columns of each table mean.
NOTES = {
    "step": "processor time of an action (10 ms) of one Reach environment, one thread. The peers: "
    "MuJoCo's rollout of the same scene and forces; the same physics and drives in a bare loop. "
    "added_us: over the environment. q_difference_rad: largest, of rollout's joints. "
    "Rows below the environment change one thing of it; a checker's price grows with the scene.",
    "vector": "wall time of 16 copies; ratio_to_sync: over Gymnasium's SyncVectorEnv; mujoco.batch "
    "alone: physics without drives, observations or rewards; q_difference_rad: of its copies from "
    "mj_step of one. Means little on a loaded machine.",
    "reaction": "swings into the chest, median [least, most] over them; false_alarms: swings with "
    "an alarm before the touch, left out of the rest. delay_s: from the touch to the reaction; "
    "farthest_m, end_m: of the tool from where it touched; force_over_limit: of the standard's for "
    "a transient contact. Known from the contact: no detector is as fast.",
    "asked": "what was asked of the environments, beside what this run measured.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """Rows of three studies, ``step``, ``vector`` and ``reaction``, and what was asked of them.

    The full run trains a detector first, on the motions of ``tauguard demo``.
    """
    # Many short blocks in turn: whatever else the machine does hits every competitor alike.
    rows = steps(50, 5 if quick else 60, seed)
    rows += vectors(50, 5 if quick else 40, seed)
    known: dict[str, Any] = {"contact": None, "observer": "observer"}
    if not quick:
        known["trained detector"] = trained_detector(seed)
    rows += reactions(1 if quick else 10, seed, known)
    return rows + answers(rows)


def answers(rows: list[Row]) -> list[Row]:
    """What an environment must show, beside what was measured."""
    step = {row["what"]: row for row in rows if row["study"] == "step"}
    vector = {row["what"]: row for row in rows if row["study"] == "vector"}
    peaks = {
        (row["speed_m_s"], row["known_from"], row["reaction"]): row["peak_force_N"]["median"]
        for row in rows
        if row["study"] == "reaction"
    }
    worst = max(
        force / peaks[speed, "contact", "continue"]
        for (speed, _, reaction), force in peaks.items()
        if reaction != "continue" and force is not None
    )
    found = [
        ("an action over that of the physics loop", "<= 1.07", step[WHOLE]["ratio_to_physics"]),
        ("make_vec over SyncVectorEnv, 2 threads", ">= 2", vector[THREADED]["ratio_to_sync"]),
        (
            "vector environments with the bits of the single ones",
            "all",
            f"{sum(row['same_bits_as_sync'] is True for row in vector.values())} of 3",
        ),
        ("a reaction's peak force over that of going on, worst", "< 1", worst),
    ]
    return [
        {"study": "asked", "what": what, "asked": asked, "measured": measured}
        for what, asked, measured in found
    ]


# -- one environment -------------------------------------------------------------------------------


def steps(count: int, repeats: int, seed: int) -> list[Row]:
    """Microseconds an action at 100 Hz: the same motion as bare physics and with ever more."""
    env = made(seed)
    actions = np.random.default_rng(seed).uniform(-0.5, 0.5, (count, 6)).astype(np.float32)
    forces, error = recorded(env, actions, seed)
    calls: dict[str, Callable[[], object]] = {
        ROLLOUT: bare(env, forces, seed),
        PHYSICS: driven(env, actions, seed),
        WHOLE: acting(env, actions, seed),
        "through gymnasium.make": acting(gymnasium.make(REACH), actions, seed),
        "without labels": acting(made(seed, labels=False), actions, seed),
        "with an ideal drive": acting(made(seed, ideal_drive=True), actions, seed),
        "measured observations": acting(made(seed, noise=True), actions, seed),
        "the observer as detector": acting(made(seed, detector="observer"), actions, seed),
    }
    for name in registered():
        calls[f"checker {name}"] = acting(made(seed, checkers=(name,)), actions, seed)
    taken = time_in_turn(calls, repeats, time.process_time)  # of one thread's work
    rollout_time, base = taken[ROLLOUT]["median"], taken[PHYSICS]["median"]
    whole = taken[WHOLE]["median"]
    return [
        {
            "study": "step",
            "what": name,
            "us_per_action": {k: 1e6 * v / count for k, v in figure.items()},
            "ratio_to_physics": figure["median"] / base,
            "ratio_to_rollout": figure["median"] / rollout_time,
            "added_us": 1e6 * (figure["median"] - whole) / count,
            "q_difference_rad": error if name == ROLLOUT else None,
        }
        for name, figure in taken.items()
    ]


def made(seed: int, **keywords: Any) -> ArmEnv:
    """A Reach environment without Gymnasium's own wrappers."""
    env = gymnasium.make(REACH, **keywords).unwrapped
    assert isinstance(env, ArmEnv)
    env.reset(seed=seed)
    return env


def acting(env: gymnasium.Env[Any, Any], actions: np.ndarray, seed: int) -> Callable[[], object]:
    """An episode with the given actions."""

    def call() -> None:
        env.reset(seed=seed)
        for action in actions:
            env.step(action)

    return call


def driven(env: ArmEnv, actions: np.ndarray, seed: int) -> Callable[[], object]:
    """The bare physics loop: mj_step and the drives, natively; no observation, no reward."""
    plant, steps = env.batch.plants[0], env.compiled.settings.substeps
    rows = actions.astype(np.float64)

    def call() -> None:
        env.reset(seed=seed)
        for action in rows:
            plant.begin(action)
            plant.run(steps)

    return call


def recorded(env: ArmEnv, actions: np.ndarray, seed: int) -> tuple[np.ndarray, float]:
    """The forces that the drives apply at every physics step, and how far a replay strays [rad]."""
    env.reset(seed=seed)
    plant, data, found = env.batch.plants[0], env.batch.datas[0], []
    for action in actions.astype(np.float64):
        plant.begin(action)
        for _ in range(env.compiled.settings.substeps):
            plant.run(1)
            found.append(data.qfrc_applied.copy())
        plant.finish()
    assert not env.batch.metrics["diverged"][0]
    last = data.qpos[env.compiled.scene.qpos_adr].copy()
    forces = np.array(found)
    states, _ = bare(env, forces, seed)()
    model, adr = env.compiled.scene.model, env.compiled.scene.qpos_adr
    return forces, float(np.abs(states[0, -1, 1 : 1 + model.nq][adr] - last).max())


def bare(env: ArmEnv, forces: np.ndarray, seed: int) -> Callable[[], Any]:
    """MuJoCo's own compiled loop over the same scene, start and forces."""
    model = env.compiled.scene.model
    env.reset(seed=seed)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, env.batch.datas[0], state, kind)
    data = mujoco.MjData(model)
    applied = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)

    def call() -> Any:
        env.reset(seed=seed)  # as the others do
        return rollout.rollout(
            model, data, initial_state=state, control=forces[None], control_spec=applied
        )

    return call


# -- many environments -----------------------------------------------------------------------------


def vectors(count: int, repeats: int, seed: int) -> list[Row]:
    """Actions a second of :data:`COPIES` environments, beside Gymnasium's and MuJoCo's own form."""
    sync = SyncVectorEnv([lambda: gymnasium.make(REACH)] * COPIES)
    native = {
        threads: gymnasium.make_vec(REACH, num_envs=COPIES, threads=threads) for threads in (1, 2)
    }
    actions = np.random.default_rng(seed).uniform(-0.5, 0.5, (count, COPIES, 6))
    rows = actions.astype(np.float32)

    def vector(env: gymnasium.vector.VectorEnv[Any, Any, Any]) -> Callable[[], object]:
        def call() -> None:
            env.reset(seed=seed)
            for action in rows:
                env.step(action)

        return call

    calls: dict[str, Callable[[], object]] = {"SyncVectorEnv": vector(sync)}
    for threads, env in native.items():
        calls[f"make_vec, {threads} threads"] = vector(env)
    strayed = {}
    for threads in (1, 2):
        name = f"mujoco.batch alone, {threads} threads"
        calls[name], strayed[name] = batched(seed, count, threads)
    forms = {"SyncVectorEnv": sync} | {f"make_vec, {t} threads": e for t, e in native.items()}
    last = {}
    for name, env in forms.items():
        calls[name]()
        last[name] = env.step(rows[0])[0]
    taken = time_in_turn(calls, repeats)
    base = taken["SyncVectorEnv"]["median"]
    return [
        {
            "study": "vector",
            "what": name,
            "copies": COPIES,
            "actions_per_second": COPIES * count / figure["median"],
            "ratio_to_sync": base / figure["median"],
            "same_bits_as_sync": bool(np.array_equal(last[name], last["SyncVectorEnv"]))
            if name in last
            else None,
            "q_difference_rad": strayed.get(name),
        }
        for name, figure in taken.items()
    ]


def batched(seed: int, count: int, threads: int) -> tuple[Callable[[], object], float]:
    """Physics alone: every copy of the scene holds the arm with constant forces.

    Returns:
        The call, and its copies' largest joint difference from ``mj_step`` of one of them [rad].
    """
    env = made(seed)
    model, data = env.compiled.scene.model, env.batch.datas[0]
    env.step(np.zeros(6))
    batch = Batch(model, COPIES, threads)
    start, force = data.qpos.copy(), data.qfrc_applied.copy()
    substeps = env.compiled.settings.substeps

    def call() -> None:
        batch.qpos[:], batch.qvel[:], batch.qfrc_applied[:] = start, 0.0, force
        for _ in range(count):
            batch.step(nstep=substeps)

    single = mujoco.MjData(model)
    single.qpos[:], single.qfrc_applied[:] = start, force
    for _ in range(count * substeps):
        mujoco.mj_step(model, single)
    call()
    return call, float(np.abs(batch.qpos - single.qpos).max())


# -- the figure ------------------------------------------------------------------------------------


def draw(rows: list[Row], figure: Figure) -> None:
    """What a step costs, what many cost, and force over speed for each reaction."""
    top, vector, plain, detected = figure.subplots(2, 2).ravel()
    for axes, study, key, label in (
        (top, "step", "us_per_action", "microseconds an action"),
        (vector, "vector", "actions_per_second", "actions a second"),
    ):
        chosen = [row for row in rows if row["study"] == study]
        values = [row[key]["median"] if isinstance(row[key], dict) else row[key] for row in chosen]
        axes.barh([row["what"] for row in chosen], values, color="C0")
        axes.invert_yaxis()
        axes.set(xlabel=label)
    limit = body_region("chest").transient_force
    last = [row["known_from"] for row in rows if row["study"] == "reaction"][-1]
    for axes, known in ((plain, "contact"), (detected, last)):
        for reaction in REACTIONS:
            line = [
                row
                for row in rows
                if row["study"] == "reaction"
                and row["known_from"] == known
                and row["reaction"] == reaction
            ]
            axes.plot(
                [row["speed_m_s"] for row in line],
                [row["peak_force_N"]["median"] for row in line],
                "o-",
                label=reaction,
            )
        axes.axhline(limit, color="black", lw=0.8, ls="--")
        axes.set(xlabel="tool speed [m/s]", ylabel="peak force on the chest [N]")
        axes.set_title(f"Reaction known from the {known}")
        axes.legend(fontsize=8)
