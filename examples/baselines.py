"""Baselines of the tasks: zero action, random, and straight to the target, fast and gently.

    python examples/baselines.py [EPISODES] [FIRST_SEED]

Prints a Markdown table: success with its 95 % interval, targets, reward, episodes with a contact.
"""

import sys
import warnings

import gymnasium as gym
import numpy as np

from tauguard.report import rate

TASKS = ("Reach-v0", "React-v1", "ClothReach-v1", "TwoArms-v1")
#: Fraction of the largest Cartesian speed at which a scripted tool goes to its target.
SPEEDS = {"straight, fast": 1.0, "straight, gentle": 0.35}


def straight(env, speed):
    """The Cartesian action that brings every tool nearer to its target."""
    batch, n, arms = env.batch, len(env.scene.joint_names), env.compiled.arms
    first = 3 * n + 3 * arms
    left = batch.observation[0, first : first + 3 * arms].reshape(arms, 3)
    largest = np.array([entry.high for entry in batch.actions]).reshape(arms, 6)[:, :3]
    step = 0.1 * left / largest
    size = np.abs(step).max(axis=1, keepdims=True)
    action = np.zeros((arms, 6))
    action[:, :3] = step * np.minimum(1, speed / np.maximum(size, 1e-9))
    return action.ravel()


def play(task, policy, episodes, first=0):
    """Successes, targets, rewards, largest force over its limit and contacts, one an episode."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        env = gym.make(f"tauguard:tauguard/{task}", control="cartesian", disable_env_checker=True)
    env.action_space.seed(first)
    rows = []
    for seed in range(first, first + episodes):
        env.reset(seed=seed)
        targets = reward = worst = force = 0.0
        over = False
        while not over:
            if policy in SPEEDS:
                action = straight(env.unwrapped, SPEEDS[policy])
            elif policy == "random":
                action = env.action_space.sample()
            else:
                action = np.zeros(env.action_space.shape)
            _, gained, ended, cut, info = env.step(action)
            over, reward = ended or cut, reward + gained
            targets += info["success"]
            worst, force = max(worst, info["limit_ratio"]), max(force, info["force"])
        rows.append((targets > 0, targets, reward, worst, force > 0))
    env.close()
    return np.array(rows, dtype=float)


def main(episodes=20, first=1000):
    print("| task | policy | success | targets | reward | force over limit | episodes in contact |")
    print("|---|---|---|---|---|---|---|")
    for task in TASKS:
        for policy in ("zero", "random", *SPEEDS):
            rows = play(task, policy, episodes, first)
            interval = rate(int(rows[:, 0].sum()), episodes)
            low, high = interval["low"], interval["high"]
            success, targets, reward, worst, touched = rows.mean(axis=0)
            print(
                f"| {task} | {policy} | {success:.2f} [{low:.2f}, {high:.2f}] | {targets:.1f} | "
                f"{reward:.2f} | {worst:.2f} | {touched:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]))
