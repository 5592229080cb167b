"""
A live log: free, collision or fault
====================================

A detector of a running robot gives a state for every sample. If samples repeat or stop, the state
is a fault. Here a recording stands in for the robot, and its signals freeze for half a second.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import tauguard
from tauguard.datasets import free_episodes, struck_episodes
from tauguard.envs import CollisionPlan, Episode, simulate

speeds = (30.0,)
episodes = struck_episodes(5, 1, 5, speeds) + free_episodes(5, 4, 12.0, speeds)
motion = tauguard.simulated(simulate(episode) for episode in episodes)
detector = tauguard.train(motion, method="moving-thresholds", false_alarms_per_hour=10)

trace = simulate(Episode(seed=21, seconds=10, collisions=(CollisionPlan("strike", 4.0, link=4),)))
frozen = (trace.t > 6.0) & (trace.t < 6.5)
q, qd, current = trace.q.copy(), trace.qd.copy(), trace.current.copy()
for signal in (q, qd, current):
    signal[frozen] = signal[np.argmax(frozen)]
found = detector.detect(replace(trace, q=q, qd=qd, current=current))
print("alarms at", *[f"{alarm.start:.3f} s" for alarm in found.alarms])
for fault in found.faults:
    print(f"{fault.start:.3f} to {fault.end:.3f} s: {fault.reason}")

# %%

plt.figure(figsize=(6.4, 3))
plt.plot(trace.t, found.signals.score / detector.threshold, linewidth=0.8)
plt.axhline(1.0, color="black", linewidth=0.8)
for fault in found.faults:
    plt.axvspan(fault.start, fault.end, color="tab:orange", alpha=0.3)
plt.xlabel("time [s]")
plt.ylabel("score over threshold")
