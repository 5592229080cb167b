"""Pick from a bin beside a person, with a part in the gripper: a scene of your own.

    python examples/bin_picking.py [PICTURE.png]
The bin, a loose part, the held part and a cart are in `bin_picking.toml`.
"""

import sys
from pathlib import Path

import gymnasium as gym
import numpy as np

PLACES = np.array([[0.55, -0.35, 0.28], [0.55, 0.25, 0.35]])  # above the bin, beside the person


def main(picture=None, seconds=8.0):
    mode = picture and "rgb_array"
    scene = {"obstacles": ("person",), "objects": Path(__file__).with_suffix(".toml")}
    env = gym.make("tauguard:tauguard/Reach-v0", control="cartesian", render_mode=mode, **scene)
    env.reset(seed=0)
    arm, goal, forces = env.unwrapped, 0, []
    largest = np.array([entry.high for entry in arm.batch.actions])
    for _ in range(round(seconds * 100)):
        left = PLACES[goal] - arm.batch.observation[0, 18:21]  # from the tool
        goal = (goal + 1) % len(PLACES) if np.linalg.norm(left) < 0.03 else goal
        action = np.clip(0.05 * np.append(left, np.zeros(3)) / largest, -1, 1)
        info = env.step(action)[4]
        forces.append(info["region_force"])
    worst = dict(zip([region.name for region in arm.regions], np.max(forces, axis=0), strict=True))
    pressed = {name: f"{force:.0f} N" for name, force in worst.items() if force}
    print(pressed, f"cost {info['cost_sum']:.2f} N s")
    if picture:
        import matplotlib.pyplot as plt

        plt.imsave(picture, env.render())
    return worst


if __name__ == "__main__":
    main(*sys.argv[1:2])
