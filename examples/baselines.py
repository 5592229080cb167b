"""Baselines of the tasks: zero and random actions, scripted controllers, learned policies.

    python examples/baselines.py [EPISODES] [FIRST_SEED] [TASK ...] [POLICY.npz ...] [--robot R]

Prints a Markdown table of means over episodes of 5 s: success with its 95 % interval, targets,
reward, largest force divided by its limit, and cost [N s] (`info["cost_sum"]`). The last column
counts the episodes in which some force exceeded its limit.
`fast` moves straight to the target. The other controllers do so, too, but protect people:

* `power and force`: limits the speed, so that an impact with any region and a lasting push stay
  below the region's quasi-static limit (two-mass model of ISO 10218-2).
* `separation`: stops while somebody is within the protective distance.
* `admittance`: yields to the force that the momentum observer finds at the tool.
* `ppo`, `ppo, budget`: trained by `examples/learn.py`, loaded from `examples/policies`.
"""

import argparse
import sys
import warnings
from pathlib import Path

import gymnasium as gym
import mujoco
import numpy as np

from tauguard.envs.policies import MlpPolicy
from tauguard.envs.wrappers import SpeedAndSeparation
from tauguard.models import standard_mass
from tauguard.report import rate

TASKS = ("Reach-v0", "React-v1", "ClothReach-v1", "TwoArms-v1")
#: Tool velocities, 20 actions per second.
KEYWORDS = {"control": "cartesian", "control_rate": 20.0, "max_episode_steps": 100}
POLICIES = Path(__file__).with_name("policies")
#: Tool speed where no region limits it [m/s].
UNLIMITED = 0.25
#: Admittance: damping [N s/m], dead band [N], and speed relative to `power and force`.
DAMPING, DEAD, YIELDING = 250.0, 15.0, 1.5


def zero(env, info):
    return np.zeros(env.action_space.shape)


def random(env, info):
    return env.action_space.sample()


def velocity(env, speed):
    """Velocity of each tool towards its target [m/s], slower near it, shape (arms, 3)."""
    arms, n = env.unwrapped.compiled.arms, len(env.unwrapped.scene.joint_names)
    first = 3 * n + 3 * arms
    left = env.unwrapped.batch.observation[0, first : first + 3 * arms].reshape(arms, 3)
    distance = np.linalg.norm(left, axis=1, keepdims=True)
    return left / np.maximum(distance, 1e-9) * np.minimum(speed, 5 * distance)


def action(env, wanted):
    """The action for tool velocities [m/s]."""
    largest = np.array([e.high for e in env.unwrapped.batch.actions]).reshape(len(wanted), 6)
    full = largest[:, :3] * env.unwrapped.compiled.settings.control_rate
    out = np.zeros((len(wanted), 6))
    out[:, :3] = np.clip(wanted / full, -1, 1)
    return out.ravel()


def fast(env, info):
    return action(env, velocity(env, 1.0))


def limited_speed(env):
    """Speed at which impacts and pushes keep the quasi-static limits of all regions [m/s]."""
    arm = standard_mass(env.unwrapped.scene)
    speeds = [UNLIMITED]
    for region in env.unwrapped.regions:
        mass = float(env.unwrapped.model.body_subtreemass[region.body])
        reduced = 1 / (1 / arm + 1 / mass)
        speeds.append(region.quasi_static / np.sqrt(reduced * region.stiffness))
    return min(speeds)


def power_and_force(env, info):
    return action(env, velocity(env, limited_speed(env)))


def admittance(env, info):
    inner = env.unwrapped
    wanted = velocity(env, YIELDING * limited_speed(env))
    each = len(inner.scene.joint_names) // len(wanted)
    jac = np.zeros((3, inner.model.nv))
    for a, (site, body, first) in enumerate(inner.compiled.tools):
        place = inner.data.site_xpos[site] if site >= 0 else inner.data.xpos[body]
        mujoco.mj_jac(inner.model, inner.data, jac, None, place.copy(), body)
        dofs = inner.scene.dof_adr[first : first + each]
        force = np.linalg.lstsq(jac[:, dofs].T, info["residual"][first : first + each])[0]
        size = np.linalg.norm(force)
        wanted[a] += force * max(0.0, size - DEAD) / max(size, 1e-9) / DAMPING
    return action(env, wanted)


def learned(file):
    policy = MlpPolicy.load(file)
    return lambda env, info: policy(env.unwrapped.batch.observation[0])


def baselines(task, files=(), robot="cura6"):
    """By name: the policy, and keywords and wrapper of its environment; policy files come last.

    The files in `examples/policies` are for the arm cura6.
    """
    found = {
        "zero": (zero, {}, None),
        "random": (random, {}, None),
        "fast": (fast, {}, None),
        "power and force": (power_and_force, {}, None),
        "separation": (fast, {}, SpeedAndSeparation),
        "admittance": (admittance, {"detector": "observer"}, None),
    }
    if task in ("ClothReach-v1", "TwoArms-v1"):  # nobody is there
        del found["separation"]
    for name, end in (("ppo", ""), ("ppo, budget", "-budget")):
        if robot == "cura6" and (file := POLICIES / f"{task}{end}.npz").is_file():
            found[name] = (learned(file), {}, None)
    return found | {str(file): (learned(file), {}, None) for file in files}


def play(task, name, episodes, first=0, files=(), **keywords):
    """Success, targets, reward, force over limit and cost [N s], one row per episode."""
    act, more, wrapper = baselines(task, files)[name]
    keywords = KEYWORDS | more | keywords
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        env = gym.make(f"tauguard:tauguard/{task}", disable_env_checker=True, **keywords)
    env = env if wrapper is None else wrapper(env)
    env.action_space.seed(first)
    rows = []
    for seed in range(first, first + episodes):
        _, info = env.reset(seed=seed)
        targets = reward = worst = 0.0
        over = False
        while not over:
            _, gained, ended, cut, info = env.step(act(env, info))
            over, reward = ended or cut, reward + gained
            targets += info["success"]
            worst = max(worst, info["limit_ratio"])
        rows.append((targets > 0, targets, reward, worst, info["cost_sum"]))
    env.close()
    return np.array(rows, dtype=float)


def main(episodes, first, names, robot):
    files = [name for name in names if name.endswith(".npz")]
    tasks = [name for name in names if name not in files]
    if unknown := sorted({*tasks} - {*TASKS}):
        sys.exit(f"{', '.join(unknown)}: no such task; there are {', '.join(TASKS)}")
    print(
        "| task | policy | success | targets | reward | force / limit | cost [N s] | over a limit |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for task in tasks or TASKS:
        for name in baselines(task, files, robot):
            rows = play(task, name, episodes, first, files, robot=robot)
            interval = rate(int(rows[:, 0].sum()), len(rows))
            low, high = interval["low"], interval["high"]
            success, targets, reward, worst, cost = rows.mean(axis=0)
            above = int((rows[:, 3] > 1).sum())
            print(
                f"| {task} | {name} | {success:.2f} [{low:.2f}, {high:.2f}] | {targets:.1f} | "
                f"{reward:.2f} | {worst:.2f} | {cost:.2f} | {above} of {len(rows)} |",
                flush=True,
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("episodes", nargs="?", type=int, default=20)
    parser.add_argument(
        "first", nargs="?", type=int, default=1000, help="seed of the first episode"
    )
    parser.add_argument("names", nargs="*", help="tasks (default: all), and policy files")
    parser.add_argument("--robot", default="cura6", help="arm: a name, or a file")
    main(**vars(parser.parse_args()))
