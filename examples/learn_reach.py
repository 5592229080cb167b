"""Learn to reach by the cross-entropy method, in a minute and without a deep-learning library.

A policy is a matrix: joint velocities = tanh(W e), where e is the vector from tool to target in
the frame of the first joint. Every generation draws matrices around the best of the last one,
lets all of them play the same episodes side by side in the vector environment, and keeps the
best quarter (Rubinstein 1999; Mannor, Rubinstein & Gat 2003). The cost of collisions with a
person is subtracted from the return.
"""

import argparse
import time
from pathlib import Path

import gymnasium as gym
import numpy as np

PRICE = 1.0  # penalty per N s beyond the limits; a reached target is worth 1
EPISODES, ELITE = 4, 0.25


def act(weights, observation, joints):
    """Actions, one policy per row: weights (N, n, 3), observations (N, ...) -> (N, n)."""
    x, y, z = observation[:, 3 * joints + 3 : 3 * joints + 6].T / 0.1
    cos, sin = np.cos(observation[:, 0]), np.sin(observation[:, 0])
    error = np.column_stack([cos * x + sin * y, cos * y - sin * x, z])
    return np.tanh(np.einsum("pij,pj->pi", weights, error))


def returns(envs, weights, seeds, steps, joints):
    """Return and targets reached of every policy, mean over the episodes, shape (P,) each."""
    spread = np.repeat(weights, len(seeds), axis=0)
    observation, _ = envs.reset(seed=[int(s) for s in np.tile(seeds, len(weights))])
    total, reached = np.zeros(len(spread)), np.zeros(len(spread))
    for _ in range(steps):
        observation, reward, *_, info = envs.step(act(spread, observation, joints))
        total += reward - PRICE * info["cost"]
        reached += info["success"]
    shape = (len(weights), len(seeds))
    return total.reshape(shape).mean(axis=1), reached.reshape(shape).mean(axis=1)


def learn(generations=30, population=24, steps=250, seed=0):
    """The learned matrix (n, 3), and for each generation: return, targets, seconds."""
    rng = np.random.default_rng(seed)
    envs = gym.make_vec(
        "tauguard:tauguard/Reach-v0",
        num_envs=population * EPISODES,
        vectorization_mode="vector_entry_point",
        autoreset_mode="Disabled",
        max_episode_steps=steps,
        max_speed=1.0,
    )
    joints = envs.single_action_space.shape[0]
    mean = np.zeros((joints, 3))
    spread = np.full_like(mean, 0.3)
    curve, start = [], time.perf_counter()
    for generation in range(generations):
        drawn = mean + spread * rng.standard_normal((population, *mean.shape))
        drawn[0] = mean  # the present policy, whose return is plotted
        seeds = rng.integers(2**31, size=EPISODES)
        value, reached = returns(envs, drawn, seeds, steps, joints)
        best = drawn[np.argsort(-value)[: round(ELITE * population)]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 0.05 * 0.8**generation
        curve.append((value[0], reached[0], time.perf_counter() - start))
    envs.close()
    return mean, np.array(curve)


def record(weights, folder, seed=0, steps=1000):
    """One episode of the policy, ten seconds, as an MCAP recording: `tauguard replay` shows it."""
    from tauguard.envs.wrappers import RecordMcap

    env = RecordMcap(gym.make("tauguard:tauguard/Reach-v0", max_speed=1.0), folder)
    joints = env.action_space.shape[0]
    observation, _ = env.reset(seed=seed)
    reached, worst = 0, 0.0
    for _ in range(steps):
        action = act(weights[None], observation[None], joints)[0]
        observation, _, terminated, truncated, info = env.step(action)
        reached += info["success"]
        worst = max(worst, info["limit_ratio"])
        if terminated or truncated:
            break
    env.close()
    return env.files[0], reached, worst


def main():
    """Learn, print the curve, draw it, and keep the policy."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--generations", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("learned"))
    parser.add_argument("--record", action="store_true", help="record an episode of the policy")
    options = parser.parse_args()
    weights, curve = learn(options.generations, seed=options.seed)
    options.out.mkdir(parents=True, exist_ok=True)
    np.save(options.out / "policy.npy", weights)
    for generation, (value, reached, seconds) in enumerate(curve):
        line = f"generation {generation:3d}: return {value:6.2f}, targets {reached:.2f}"
        print(f"{line}, {seconds:5.1f} s")

    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(layout="constrained")
    axes.plot(curve[:, 2], curve[:, 0])
    axes.set(xlabel="wall clock [s]", ylabel="return of the mean policy", title="Reach-v0")
    figure.savefig(options.out / "curve.png", dpi=120)
    print(f"policy and curve: {options.out}")
    if options.record:
        path, reached, worst = record(weights, options.out, options.seed)
        print(f"recording: {path}: {reached} targets, largest force {worst:.0%} of its limit")


if __name__ == "__main__":
    main()
