"""
Strike an arm and see the residual
==================================

A ball strikes a simulated arm. The momentum observer estimates the torque of the contact at each
joint from positions, velocities and motor currents; the simulation knows the true torque.
"""

import matplotlib.pyplot as plt

import tauguard
from tauguard.envs import CollisionPlan, Episode, simulate

trace = simulate(
    Episode(seed=1, seconds=6, collisions=(CollisionPlan("strike", time=3.0, link=4),))
)
print(trace)
print(trace.truth.collisions[0])

# %%
# The residual follows the truth with the lag of the observer. While nothing touches the arm, it
# shows friction and model error. A detector has to distinguish these from contact.

residual = tauguard.residual(trace)
figure, panels = plt.subplots(
    2, 1, figsize=(6.4, 4.4), sharex=True, sharey=True, layout="constrained"
)
panels[0].plot(trace.t, trace.truth.tau_ext, linewidth=0.9)
panels[0].set_ylabel("external torque [N m]")
panels[1].plot(trace.t, residual, linewidth=0.9)
panels[1].set(ylabel="residual [N m]", xlabel="time [s]", xlim=(2.7, 3.5))
panels[0].legend(trace.joint_names, ncol=3, fontsize="small")
