"""
A policy under a cost budget
============================

The cost of a step is the impulse of the arm's forces above the limits of the body regions. A
controller that slows down near people has less cost, but reaches fewer targets. What is the
trade-off?
"""

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np

COPIES, STEPS = 96, 300
envs = gym.make_vec(
    "tauguard:tauguard/Reach-v0",
    num_envs=COPIES,
    vectorization_mode="vector_entry_point",
    autoreset_mode="Disabled",
    control="cartesian",
    max_episode_steps=STEPS,
)
joints = 6


def play(near):
    """Mean targets and cost of an episode, and errors; slower within ``near`` [m] of a person."""
    observation, info = envs.reset(seed=[1000 + k for k in range(COPIES)])
    reached = np.zeros(COPIES)
    for _ in range(STEPS):
        tool = observation[:, 3 * joints : 3 * joints + 3]
        path = observation[:, 3 * joints + 3 : 3 * joints + 6]
        regions = observation[:, 3 * joints + 6 :].reshape(COPIES, -1, 6)[:, :, :3]
        distance = np.linalg.norm(tool[:, None] - regions, axis=2).min(axis=1)
        slow = np.clip(distance / near, 0.1, 1.0) if near else np.ones(COPIES)
        action = np.zeros((COPIES, 6))
        action[:, :3] = np.clip(path / 0.1, -1, 1) * slow[:, None]
        observation, *_, info = envs.step(action)
        reached += info["success"]
    both = np.array([reached, info["cost_sum"]])
    return both.mean(axis=1), both.std(axis=1) / np.sqrt(COPIES)


for near in (0.0, 0.2, 0.6):
    (targets, cost), error = play(near)
    print(f"slower within {near:.2f} m: {targets:.1f} targets, {cost:.3f} +- {error[1]:.3f} N s")
    plt.errorbar(cost, targets, error[0], error[1], "o", label=f"{near:.2f} m")
envs.close()
plt.xlabel("cost of an episode [N s]")
plt.ylabel("targets reached")
plt.legend(title="slower within")

# %%
# ``examples/learn.py --budget`` learns a policy that keeps such a budget.
