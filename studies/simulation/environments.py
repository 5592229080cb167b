"""Cost of one and of many environments beside bare physics, and effect of reactions."""

import time
from collections.abc import Callable, Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import SyncVectorEnv

from oracles.bare_physics import REACH, bare, batched, driven, reach, recorded
from oracles.reaction_swings import SPEEDS, spread, swing
from studies.framework import answer, number, per, table_rows, time_in_turn
from tauguard.contacts import registered
from tauguard.datasets import demo_plan, simulate_all
from tauguard.detectors import CollisionAlarm, make_detector
from tauguard.detectors.alarms.training import train
from tauguard.detectors.calibration.nominal import nominal_arm
from tauguard.envs.adapters.reactions import REACTIONS
from tauguard.models import body_region
from tauguard.report import Row, rate

#: Number of copies in a vector environment.
COPIES = 16
#: The peers of one environment: MuJoCo's rollout with given forces, and a bare loop with the
#: drives.
ROLLOUT, PHYSICS = "mujoco.rollout, forces given", "physics and drives, no environment"
WHOLE, THREADED = "the environment", "make_vec, 2 threads"
NOTES = {
    "step": "processor time of an action (10 ms) of one Reach environment, one thread. The peers: "
    "MuJoCo's rollout of the same scene and forces; the same physics and drives in a bare loop. "
    "added_us: additional time. q_difference_rad: largest difference from rollout's joints. "
    "Each row below the environment changes one option of it.",
    "vector": "wall time of 16 copies; ratio_to_sync: over Gymnasium's SyncVectorEnv; mujoco.batch "
    "alone: physics without drives, observations or rewards; q_difference_rad: of its copies from "
    "mj_step of one. Times on a loaded machine mean little.",
    "reaction": "swings into the chest, median [least, most]. false_alarms: swings with an alarm "
    "before the contact, which are left out of the rest. delay_s: from the contact to the "
    "reaction; stopping_distance_m, end_m: distance of the tool from the first contact; "
    "force_over_limit: peak force / the standard's limit for a transient contact. A reaction "
    "to the true contact is a bound for every detector.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """Tables ``step``, ``vector`` and ``reaction``; the full run trains the demo's detector."""
    # Many short blocks in turn: the load of other programs affects every method alike.
    rows = steps(50, 5 if quick else 60, seed) + vectors(50, 5 if quick else 40, seed)
    known: dict[str, Any] = {"contact": None, "observer": "observer"}
    if not quick:
        known["trained detector"] = trained_detector(seed)
    return rows + reactions(1 if quick else 10, seed, known)


def judge(rows: list[Row]) -> list[Row]:
    """The targets of an environment beside the measured values."""
    step = {row["what"]: row for row in table_rows(rows, "step")}
    vector = {row["what"]: row for row in table_rows(rows, "vector")}
    swings = table_rows(rows, "reaction")
    on = {
        row["speed_m_s"]: number(row["peak_force_N"]) or np.nan
        for row in swings
        if (row["known_from"], row["reaction"]) == ("contact", "continue")
    }
    reacted = [(number(r["peak_force_N"]), r) for r in swings if r["reaction"] != "continue"]
    worst = max(force / on[row["speed_m_s"]] for force, row in reacted if force is not None)
    same = sum(row["same_bits_as_sync"] is True for row in vector.values())
    overhead, gain = step[WHOLE]["ratio_to_physics"], vector[THREADED]["ratio_to_sync"]
    return [
        answer("an action over that of the physics loop", "<= 1.07", f"{overhead:.3g}"),
        answer("make_vec over SyncVectorEnv, 2 threads", ">= 2", f"{gain:.3g}"),
        answer("vector environments with the bits of single ones", "3", f"{same}", same == 3),
        answer(
            "peak force of a reaction over no reaction, worst", "< 1", f"{worst:.3g}", worst < 1
        ),
    ]


def steps(count: int, repeats: int, seed: int) -> list[Row]:
    """Time of an action at 100 Hz [us]: bare physics, the environment, and each option added."""
    env = reach(seed)
    actions = np.random.default_rng(seed).uniform(-0.5, 0.5, (count, 6)).astype(np.float32)
    forces, error = recorded(env, actions, seed)
    variants: dict[str, dict[str, Any]] = {
        "without labels": {"labels": False},
        "with an ideal drive": {"ideal_drive": True},
        "measured observations": {"noise": True},
        "the observer as detector": {"detector": "observer"},
    }
    variants |= {f"checker {name}": {"checkers": (name,)} for name in registered()}
    calls: dict[str, Callable[[], object]] = {
        ROLLOUT: bare(env, forces, seed),
        PHYSICS: driven(env, actions, seed),
        WHOLE: acting(env, actions, seed),
        "through gymnasium.make": acting(gymnasium.make(REACH), actions, seed),
    }
    calls |= {name: acting(reach(seed, **own), actions, seed) for name, own in variants.items()}
    taken = time_in_turn(calls, repeats, time.process_time)
    rollout, base, whole = (taken[name]["median"] for name in (ROLLOUT, PHYSICS, WHOLE))
    return [
        {
            "study": "step",
            "what": name,
            "us_per_action": per(seconds, count, 1e6),
            "ratio_to_physics": seconds["median"] / base,
            "ratio_to_rollout": seconds["median"] / rollout,
            "added_us": 1e6 * (seconds["median"] - whole) / count,
            "q_difference_rad": error if name == ROLLOUT else None,
        }
        for name, seconds in taken.items()
    ]


def acting(env: Any, actions: np.ndarray, seed: int) -> Callable[[], object]:
    """A function that runs an episode with these actions in one or many environments."""

    def call() -> None:
        env.reset(seed=seed)
        for action in actions:
            env.step(action)

    return call


def vectors(count: int, repeats: int, seed: int) -> list[Row]:
    """Actions per second of many environments, compared with Gymnasium and MuJoCo."""
    envs: dict[str, Any] = {
        "SyncVectorEnv": SyncVectorEnv([lambda: gymnasium.make(REACH)] * COPIES)
    }
    for threads in (1, 2):
        made = gymnasium.make_vec(REACH, num_envs=COPIES, threads=threads)
        envs[f"make_vec, {threads} threads"] = made
    actions = np.random.default_rng(seed).uniform(-0.5, 0.5, (count, COPIES, 6))
    rows = actions.astype(np.float32)
    calls = {name: acting(env, rows, seed) for name, env in envs.items()}
    last, differs = {}, {}
    for name, env in envs.items():
        calls[name]()
        last[name] = env.step(rows[0])[0]
    for threads in (1, 2):
        name = f"mujoco.batch alone, {threads} threads"
        calls[name], differs[name] = batched(seed, COPIES, count, threads)
    taken = time_in_turn(calls, repeats)
    base, sync = taken["SyncVectorEnv"]["median"], last["SyncVectorEnv"]
    return [
        {
            "study": "vector",
            "what": name,
            "copies": COPIES,
            "actions_per_second": COPIES * count / seconds["median"],
            "ratio_to_sync": base / seconds["median"],
            "same_bits_as_sync": np.array_equal(last[name], sync) if name in last else None,
            "q_difference_rad": differs.get(name),
        }
        for name, seconds in taken.items()
    ]


def trained_detector(seed: int) -> CollisionAlarm:
    """The demo's detector; it was not trained on swings of this study."""
    episodes = list(simulate_all(demo_plan(seed).train, None, "simulate training"))
    return train(make_detector("srq-svr"), episodes, nominal_arm(episodes), 10.0)


def reactions(count: int, seed: int, known: Mapping[str, Any]) -> list[Row]:
    """Each reaction at three speeds; ``known`` names the detectors (None: the contact itself)."""
    rows: list[Row] = []
    for speed in SPEEDS:
        for source, detector in known.items():
            for reaction in REACTIONS:
                runs = [swing(speed, detector, reaction, seed, seed + k) for k in range(count)]
                valid = [run for run in runs if not run["delay_s"] < 0]
                rows.append(
                    {
                        "study": "reaction",
                        "speed_m_s": speed,
                        "known_from": source,
                        "reaction": reaction,
                        "false_alarms": rate(count - len(valid), count),
                        **{key: spread([run[key] for run in valid]) for key in runs[0]},
                    }
                )
    return rows


def draw(rows: list[Row], figure: Any) -> None:
    """Time of an action, rate of many environments, and force over speed for each reaction."""
    top, vector, plain, detected = figure.subplots(2, 2).ravel()
    for axes, study, key, label in (
        (top, "step", "us_per_action", "microseconds an action"),
        (vector, "vector", "actions_per_second", "actions a second"),
    ):
        chosen = table_rows(rows, study)
        axes.barh([row["what"] for row in chosen], [number(row[key]) or 0 for row in chosen])
        axes.invert_yaxis()
        axes.set(xlabel=label)
    swings = table_rows(rows, "reaction")
    for axes, known in ((plain, "contact"), (detected, swings[-1]["known_from"])):
        for reaction in REACTIONS:
            line = [r for r in swings if (r["known_from"], r["reaction"]) == (known, reaction)]
            forces = [row["peak_force_N"]["median"] for row in line]
            axes.plot([row["speed_m_s"] for row in line], forces, "o-", label=reaction)
        axes.axhline(body_region("chest").transient_force, color="black", lw=0.8, ls="--")
        axes.set(xlabel="tool speed [m/s]", ylabel="peak force on the chest [N]")
        axes.set_title(f"known from the {known}")
        axes.legend(fontsize=8)
