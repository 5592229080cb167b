"""
Tell a clamp from an impact
===========================

An alarm says that something touched the arm. The diagnosis names the link, the force and the kind
of contact. An impact ends by itself, but a clamped person has to be released.
"""

import matplotlib.pyplot as plt

import tauguard
from tauguard.datasets import free_episodes, struck_episodes
from tauguard.envs import CollisionPlan, Episode, simulate

speeds = (30.0,)
episodes = struck_episodes(3, 1, 5, speeds) + free_episodes(3, 4, 12.0, speeds)
motion = tauguard.simulated(simulate(episode) for episode in episodes)
detector = tauguard.train(motion, method="moving-thresholds", false_alarms_per_hour=10)

# %%
# Two new recordings, one of each kind.

plans = {
    "impact": CollisionPlan("strike", time=5.0, link=3),
    "clamp": CollisionPlan("clamp", time=5.0, link=3, duration=0.8),
}
figure, panels = plt.subplots(1, 2, figsize=(7, 3), sharey=True, layout="constrained")
for panel, (name, plan) in zip(panels, plans.items(), strict=True):
    trace = simulate(Episode(seed=13, seconds=8, collisions=(plan,)))
    panel.plot(trace.t, trace.truth.contact_force, color="tab:red")
    for cause in detector.detect(trace).diagnose():
        print(f"{name}: {cause.summary}")
        panel.axvline(cause.alarm.start, color="black", linestyle="--")
    panel.set(title=name, xlabel="time [s]", xlim=(4.5, 7.0))
panels[0].set_ylabel("contact force [N]")
