"""
A person beside the arm
=======================

A person made of capsules reaches, walks and draws back after a touch. The environment reports the
force on each region of the body, and the largest ratio of a force to its limit.
"""

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np

env = gym.make("tauguard:tauguard/Reach-v0", control="cartesian", render_mode="rgb_array")
observation, info = env.reset(seed=6)
names = [region.name for region in env.unwrapped.regions]
joints = len(env.unwrapped.scene.joint_names)
worst, ratio, picture = np.zeros(len(names)), [], env.render()
for _ in range(400):
    path = observation[3 * joints + 3 : 3 * joints + 6]  # from the tool to the target [m]
    action = np.concatenate([np.clip(path / 0.1, -1, 1), np.zeros(3)])
    observation, reward, terminated, truncated, info = env.step(action)
    worst = np.maximum(worst, info["region_force"])
    ratio.append(info["limit_ratio"])
    if info["limit_ratio"] == max(ratio) > 0:
        picture = env.render()
    if terminated or truncated:
        break
env.close()
for k in np.flatnonzero(worst):
    print(f"{names[k]:<20} {worst[k]:6.0f} N")

# %%

figure, (left, right) = plt.subplots(1, 2, figsize=(7, 3.4), layout="constrained")
left.imshow(picture)
left.set_axis_off()
left.set_title("at the largest force")
right.plot(np.arange(len(ratio)) / env.unwrapped.metadata["render_fps"], ratio)
right.axhline(1.0, color="black", linewidth=0.8)
right.set(xlabel="time [s]", ylabel="force over the region's limit")
