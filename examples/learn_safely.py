"""Learn to reach beside a person, with and without a budget of force; compare on fresh episodes.

A policy is joint velocities = tanh(W e + V r) (1 - slow c). e is the vector from tool to target,
r the vector from the person's nearest region to the tool, both in the frame of the first joint.
c, from 0 to 1, says how close that region is. Without a budget, the cross-entropy method ranks
policies by return. With a budget, it ranks those whose mean cost keeps the budget by return, and
by cost while these are too few (Wen & Topcu, "Constrained Cross-Entropy Method", 2018). It first
learns to reach, then continues twice, with and without the budget.
"""

import argparse
import json
import time
from pathlib import Path

import gymnasium as gym
import numpy as np

ELITE = 0.25
EPISODES, MORE = 4, 12  # of each policy: while it learns to reach, and while cost counts
NEAR = 0.4  # a region this far from the tool [m] counts as far
FRESH = 1_000_000  # seeds of the comparison begin here; training draws below


def unpack(policies, joints):
    """W and V (P, n, 3) and the slowing (P,) of rows of numbers."""
    n = 3 * joints
    shape = (len(policies), joints, 3)
    slow = 1 / (1 + np.exp(-policies[:, -1]))
    return policies[:, :n].reshape(shape), policies[:, n : 2 * n].reshape(shape), slow


def act(policies, observation, joints):
    """Actions of one policy a row: (N, 6 n + 1) and (N, ...) -> (N, n)."""
    tool = observation[:, 3 * joints : 3 * joints + 3]
    target = observation[:, 3 * joints + 3 : 3 * joints + 6]
    regions = observation[:, 3 * joints + 6 :].reshape(len(tool), -1, 6)[:, :, :3]
    away = tool[:, None] - regions
    distance = np.linalg.norm(away, axis=2)
    nearest = distance.argmin(axis=1)
    rows = np.arange(len(tool))
    close = np.clip(1 - distance[rows, nearest] / NEAR, 0, 1)
    cos, sin = np.cos(observation[:, 0]), np.sin(observation[:, 0])

    def seen(v):
        x, y, z = v.T
        return np.column_stack([cos * x + sin * y, cos * y - sin * x, z])

    reach, avoid, slow = unpack(policies, joints)
    push = seen(away[rows, nearest] / np.maximum(distance[rows, nearest], 1e-9)[:, None])
    drive = np.einsum("pij,pj->pi", reach, seen(target / 0.1))
    drive += np.einsum("pij,pj->pi", avoid, close[:, None] * push)
    return np.tanh(drive) * (1 - slow * close)[:, None]


def play(envs, policies, seeds, steps, joints):
    """Return, cost [N], worst force over its limit and targets of every policy: (P, seeds)."""
    spread = np.repeat(policies, len(seeds), axis=0)
    observation, _ = envs.reset(seed=[int(s) for s in np.tile(seeds, len(policies))])
    total, worst, reached = (np.zeros(len(spread)) for _ in range(3))
    for _ in range(steps):
        observation, reward, *_, info = envs.step(act(spread, observation, joints))
        total += reward
        worst = np.maximum(worst, info["cost"])
        reached += info["success"]
    shape = (len(policies), len(seeds))
    return [x.reshape(shape) for x in (total, info["cost_sum"], worst, reached)]


def ranked(value, cost, budget):
    """Policies from best to worst; without a budget by return."""
    if budget is None:
        return np.argsort(-value)
    good = cost <= budget
    if good.sum() < max(1, round(ELITE * len(value))):
        return np.argsort(cost, kind="stable")
    return np.argsort(np.where(good, -value, np.inf), kind="stable")


def make(copies, steps):
    """Copies of Reach-v0 with a person."""
    return gym.make_vec(
        "tauguard:tauguard/Reach-v0",
        num_envs=copies,
        vectorization_mode="vector_entry_point",
        autoreset_mode="Disabled",
        max_episode_steps=steps,
        max_speed=1.0,
    )


def learn(budget, start, generations, population, episodes, steps, seed):
    """The mean policy (6 n + 1,) after some generations from ``start``, a policy or None."""
    rng = np.random.default_rng(seed)
    envs = make(population * episodes, steps)
    joints = envs.single_action_space.shape[0]
    mean = np.append(np.zeros(6 * joints), -3.0) if start is None else start
    spread = np.append(np.full(6 * joints, 0.3), 2.0)
    for generation in range(generations):
        drawn = mean + spread * rng.standard_normal((population, len(mean)))
        drawn[0] = mean
        seeds = rng.integers(FRESH, size=episodes)
        value, cost, _, reached = (x.mean(axis=1) for x in play(envs, drawn, seeds, steps, joints))
        best = drawn[ranked(value, cost, budget)[: round(ELITE * population)]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 0.05 * 0.8**generation
        print(
            f"  generation {generation:3d}: return {value[0]:6.2f}, targets {reached[0]:.2f}, "
            f"cost {cost[0]:8.1f} N",
            flush=True,
        )
    envs.close()
    return mean


def compare(policies, episodes, steps):
    """A row a policy on episodes that no training saw."""
    envs = make(episodes * len(policies), steps)
    joints = envs.single_action_space.shape[0]
    seeds = FRESH + np.arange(episodes)
    total, cost, worst, reached = play(envs, np.array(policies), seeds, steps, joints)
    envs.close()
    return [
        {
            "return": float(total[k].mean()),
            "return_error": float(total[k].std() / np.sqrt(episodes)),
            "targets": float(reached[k].mean()),
            "cost_n": float(cost[k].mean()),
            "cost_error_n": float(cost[k].std() / np.sqrt(episodes)),
            "episodes_over_limit": float((worst[k] > 0).mean()),
            "worst_over_limit_n": float(worst[k].max()),
        }
        for k in range(len(policies))
    ]


def main():
    """Learn twice, compare, keep both policies."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--budget", type=float, default=20.0, help="mean cost an episode [N]")
    parser.add_argument("--generations", type=int, default=20, help="of learning to reach")
    parser.add_argument("--more", type=int, default=8, help="generations where cost counts")
    parser.add_argument("--start", type=Path, help="a policy that reaches, instead of learning one")
    parser.add_argument("--population", type=int, default=20)
    parser.add_argument("--steps", type=int, default=300, help="of an episode of training")
    parser.add_argument("--fresh", type=int, default=64, help="episodes of the comparison")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("learned"))
    options = parser.parse_args()
    start, last = time.process_time(), (options.steps, options.seed)
    if options.start is None:
        print("learning to reach")
        first = learn(None, None, options.generations, options.population, EPISODES, *last)
    else:
        first = np.load(options.start)
    policies = []
    for budget in (None, options.budget):
        print("without a budget" if budget is None else f"with a budget of {budget:g} N")
        policies.append(learn(budget, first, options.more, options.population, MORE, *last))
    options.out.mkdir(parents=True, exist_ok=True)
    np.save(options.out / "first.npy", first)
    np.save(options.out / "policies.npy", policies)
    rows = compare(policies, options.fresh, options.steps)
    (options.out / "comparison.json").write_text(json.dumps(rows, indent=1))
    for name, row in zip(("without", "with   "), rows, strict=True):
        print(
            f"{name} budget, {options.fresh} fresh episodes: return {row['return']:.2f} "
            f"+- {row['return_error']:.2f}, {row['targets']:.2f} targets, cost "
            f"{row['cost_n']:.1f} +- {row['cost_error_n']:.1f} N, over a limit in "
            f"{row['episodes_over_limit']:.0%}, by {row['worst_over_limit_n']:.0f} N at worst"
        )
    print(f"{time.process_time() - start:.0f} s of processor time; policies: {options.out}")


if __name__ == "__main__":
    main()
