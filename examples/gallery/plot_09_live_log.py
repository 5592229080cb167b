"""
A live log: free, collision or fault
====================================

A detector of a running robot gives a state for every sample. If samples repeat or stop, the state
is a fault. Here a recording stands in for the robot, and its signals freeze for half a second.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from tauguard.datasets import free_episodes, struck_episodes
from tauguard.detectors import make_detector, train
from tauguard.detectors.alarms.monitor import detect_with_faults
from tauguard.detectors.calibration.nominal import nominal_arm
from tauguard.envs import CollisionPlan, Episode, simulate

speeds = (30.0,)
motion = [simulate(e) for e in struck_episodes(5, 1, 5, speeds) + free_episodes(5, 4, 12.0, speeds)]
alarm = train(make_detector("moving-thresholds"), motion, nominal_arm(motion), per_hour=10)

trace = simulate(Episode(seed=21, seconds=10, collisions=(CollisionPlan("strike", 4.0, link=4),)))
frozen = (trace.t > 6.0) & (trace.t < 6.5)
q, qd, current = trace.q.copy(), trace.qd.copy(), trace.current.copy()
for signal in (q, qd, current):
    signal[frozen] = signal[np.argmax(frozen)]
answer = detect_with_faults(alarm, replace(trace, q=q, qd=qd, current=current))
found, faults = answer.detection, answer.faults
print("alarms at", *[f"{one.start:.3f} s" for one in found.alarms])
for fault in faults:
    print(f"{fault.start:.3f} to {fault.end:.3f} s: {fault.reason}")

# %%

plt.figure(figsize=(6.4, 3))
plt.plot(trace.t, found.score / found.threshold, linewidth=0.8)
plt.axhline(1.0, color="black", linewidth=0.8)
for fault in faults:
    plt.axvspan(fault.start, fault.end, color="tab:orange", alpha=0.3)
plt.xlabel("time [s]")
plt.ylabel("score over threshold")
