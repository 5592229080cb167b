"""Pick from a bin beside a person, with a part in the gripper: a scene of your own.

    python examples/bin_picking.py [PICTURE.png]

`bin_picking.toml` lists the bin, a loose part, the held part and a cart. The arm carries the part
from the bin to a place beside the person and back; what it presses, and whom, is in `info`.
"""

import sys
from pathlib import Path

import gymnasium as gym
import numpy as np

SCENE = Path(__file__).with_suffix(".toml")
PLACES = np.array([[0.55, -0.35, 0.28], [0.55, 0.25, 0.35]])  # above the bin, beside the person


def main(picture=None, seconds=8.0):
    env = gym.make(
        "tauguard:tauguard/Reach-v0",
        control="cartesian",
        obstacles=("person",),
        objects=SCENE,
        render_mode="rgb_array" if picture else None,
    )
    _, info = env.reset(seed=0)
    arm, names = env.unwrapped, [region.name for region in env.unwrapped.regions]
    n, goal, worst = 6, 0, dict.fromkeys(names, 0.0)
    largest = np.array([entry.high for entry in arm.batch.actions])[:3]
    observation = arm.batch.observation[0]
    for _ in range(round(seconds * 100)):
        left = PLACES[goal] - observation[3 * n : 3 * n + 3]
        goal = (goal + 1) % len(PLACES) if np.linalg.norm(left) < 0.03 else goal
        action = np.zeros(6)
        action[:3] = np.clip(0.05 * left / largest, -1, 1)
        info = env.step(action)[4]
        for name, force in zip(names, info["region_force"], strict=True):
            worst[name] = max(worst[name], force)
    for name in (name for name in names if worst[name] > 0):
        print(f"{name:<18} {worst[name]:6.0f} N")
    print(f"cost {info['cost_sum']:.2f} N s")
    if picture:
        import matplotlib.pyplot as plt

        plt.imsave(picture, env.render())
    env.close()
    return worst


if __name__ == "__main__":
    main(*sys.argv[1:2])
