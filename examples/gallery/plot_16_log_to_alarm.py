"""
From logs of free motion to alarms
==================================

A detector for an arm is trained on logs in which nothing touched it. The arm is calibrated, and the
bounds of its residual are learned. Here a simulated arm makes the logs, which are read as those of
a real arm: motor currents, and a robot file whose masses and friction are not the arm's.
"""

from dataclasses import replace
from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt

import tauguard
from tauguard.datasets import free_episodes
from tauguard.envs import CollisionPlan, simulate
from tauguard.models import Mismatch, cura6, cura6_drive
from tauguard.traces import resampled

robot = Path(mkdtemp()) / "arm.xml"
robot.write_text(cura6.arm_xml())
episodes = free_episodes(1, 4, 20.0, (40.0,), (0.0,), Mismatch(seed=5))


def measured(episode):
    """What a log at 125 Hz has: no truth, and no attached arm."""
    return replace(resampled(simulate(episode), 125.0), truth=None, attachments={})


motion = {f"log {k}": measured(episode) for k, episode in enumerate(episodes[:3])}
free = tauguard.read_logs(motion, robot=robot)
arm = tauguard.calibrate(free, gains=cura6_drive().gain)
print(arm)

# %%
# The card states the torques and forces that the detector finds.

detector = tauguard.train(free, arm)
print(detector.card())

# %%
# Something pushes a link for 0.4 s in another log.

push = CollisionPlan("pulse", time=9.0, link=3, duration=0.4, force=(60.0, 90.0))
found = detector.detect(measured(replace(episodes[3], collisions=(push,))), payload=0.0)
print(found)

plt.figure(figsize=(6.4, 3))
plt.plot(found.signals.t, found.signals.score, linewidth=0.8)
plt.axhline(detector.threshold, color="black", linewidth=0.8)
for alarm in found.alarms:
    plt.axvspan(alarm.start, alarm.end, color="tab:red", alpha=0.3)
plt.ylim(0, 4)
plt.xlabel("time [s]")
plt.ylabel("score")
