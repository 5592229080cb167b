"""
A step that does not tunnel
===========================

A ball at 50 m/s moves 25 cm in a step of 5 ms and the cloth is 2 mm thick. MuJoCo looks for
contacts at one time per step, so the ball passes through the cloth. The guarded step stops the ball
and reports the contact.
"""

import matplotlib.pyplot as plt
import mujoco

from tauguard.contacts import GuardedStepper
from tauguard.contacts.scenes import ball_cloth

heights = {}
for name in ("MuJoCo", "guarded"):
    model, data = ball_cloth(speed=50.0).start(timestep=5e-3)
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE  # MuJoCo 4.0.0 errs with the sparse one
    guard = GuardedStepper(model, data)
    heights[name] = [data.qpos[-5]]
    for _ in range(12):
        if name == "MuJoCo":
            mujoco.mj_step(model, data)
        else:
            for cut in guard.step().cuts:
                print(f"held at {cut.time:.3f} of the step:", *guard.partners(cut.pair))
        heights[name].append(data.qpos[-5])

# %%

for name, rows in heights.items():
    plt.plot([5 * k for k in range(len(rows))], rows, "o-", label=name)
plt.xlabel("time [ms]")
plt.ylabel("height of the ball [m]")
plt.legend()
