"""
Your URDF
=========

Every environment and the simulation take a URDF or MJCF file of a serial arm. What the file does
not state, such as the drives, comes from defaults that ``tauguard robot FILE`` prints with their
source, or from a small TOML file.
"""

import tempfile
from pathlib import Path

import gymnasium as gym
import matplotlib.pyplot as plt

folder = Path(tempfile.mkdtemp())


def link(name, length, mass):
    """A cylinder along z."""
    size = mass * length**2 / 12
    return f"""<link name="{name}">
      <inertial><origin xyz="0 0 {length / 2}"/><mass value="{mass}"/>
        <inertia ixx="{size}" iyy="{size}" izz="{mass * 0.002}" ixy="0" ixz="0" iyz="0"/></inertial>
      <collision><origin xyz="0 0 {length / 2}"/>
        <geometry><cylinder radius="0.05" length="{length}"/></geometry></collision></link>"""


def joint(number, parent, child, height, axis, torque):
    """A hinge at the end of the parent."""
    return f"""<joint name="joint{number}" type="revolute"><parent link="{parent}"/>
      <child link="{child}"/><origin xyz="0 0 {height}"/><axis xyz="{axis}"/>
      <limit lower="-2.8" upper="2.8" effort="{torque}" velocity="2"/></joint>"""


links = [("base", 0.15, 4.0), ("shoulder", 0.12, 3.5), ("upper", 0.38, 5.0), ("fore", 0.33, 3.0)]
links += [("wrist1", 0.1, 1.2), ("wrist2", 0.1, 1.2), ("tool", 0.08, 0.4)]
axes, torques = ["0 0 1", "0 1 0", "0 1 0", "0 1 0", "0 0 1", "0 1 0"], [150, 150, 120, 30, 30, 30]
parts = [link(*one) for one in links]
parts += [
    joint(k + 1, links[k][0], links[k + 1][0], links[k][1], axes[k], torques[k]) for k in range(6)
]
(folder / "arm.urdf").write_text(f'<robot name="my_arm">{"".join(parts)}</robot>')

# %%
# Drives with friction, ripple and noise like those of the bundled arm.

(folder / "arm.toml").write_text('file = "arm.urdf"\n[drive]\nlike = "cura6"\ngear = 100\n')
env = gym.make(
    "tauguard:tauguard/Reach-v0",
    robot=str(folder / "arm.toml"),
    detector="observer",
    render_mode="rgb_array",
)
observation, info = env.reset(seed=1)
for _ in range(50):
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
print("largest residual", abs(info["residual"]).max().round(2), "N m; alarm:", info["alarm"])

plt.imshow(env.render())
plt.axis("off")
env.close()
