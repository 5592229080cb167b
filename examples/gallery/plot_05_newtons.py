"""
Newtons against limits
======================

How fast may an arm be when it meets a person? ISO/TS 15066 limits the force on each region of the
body and predicts the force from two masses and a spring. The effective mass of the arm depends on
its pose and on the direction of the impact.
"""

import matplotlib.pyplot as plt
import mujoco
import numpy as np

from tauguard.models import BODY_REGIONS, SceneSpec, compose
from tauguard.models.impact import reflected_mass

scene = compose(SceneSpec())
tool = int(scene.link_bodies[-1])
data = mujoco.MjData(scene.model)
data.qpos[scene.qpos_adr] = scene.home
mujoco.mj_forward(scene.model, data)
directions = {"forward": [1, 0, 0], "sideways": [0, 1, 0], "down": [0, 0, -1]}

figure, axes = plt.subplots(figsize=(6.4, 4), layout="constrained")
names = [name for name, region in BODY_REGIONS.items() if region.transient]
for k, (label, direction) in enumerate(directions.items()):
    mass = reflected_mass(scene, scene.home, tool, data.xpos[tool], direction)
    limits = [BODY_REGIONS[name].speed_limit(mass) for name in names]
    axes.bar(np.arange(len(names)) + 0.25 * (k - 1), limits, 0.25, label=f"{label}: {mass:.1f} kg")
axes.set_xticks(np.arange(len(names)), [name.replace("_", " ") for name in names], rotation=45)
axes.set_ylabel("largest speed [m/s]")
axes.legend(title="the tool moves")

# %%
# The simulated force of an impact agrees with this model within 2 % at a step of 1 ms (``tauguard
# bench simulation``). A simulated force replaces no measurement, and some limits are unconfirmed:

for name in names:
    print(f"{name}:", ", ".join(BODY_REGIONS[name].unconfirmed) or "confirmed")
