"""
Your arm's logs, in a notebook
==============================

From logs in which nothing touched the arm to the alarms of a log with contacts. Here a simulated
arm stands in for yours; with files of your own, ``tauguard.read_logs`` begins the same way.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

import tauguard as tg
from tauguard.datasets import free_episodes
from tauguard.envs import CollisionPlan, Episode, simulate
from tauguard.models import Mismatch, cura6
from tauguard.traces import resampled

arm_of_logs = Mismatch(seed=5)  # its masses, gains and friction differ from the robot file's
folder = Path(tempfile.mkdtemp())
robot = folder / "arm.xml"
robot.write_text(cura6.arm_xml())


def recorded(episode):
    """What a controller would log: 125 samples a second, no truth."""
    trace = resampled(simulate(episode), 125.0)
    return {"t": trace.t, "q": trace.q, "qd": trace.qd, "current": trace.current}


motions = free_episodes(1, 4, 20.0, (40.0,), (0.0,), arm_of_logs)
free = tg.read_logs({f"free {k}": recorded(e) for k, e in enumerate(motions)}, robot=robot)
print(free.to_frame())

# %%
# Calibration and training. A result prints in a few lines; ``findings`` has all that is doubtful.

arm = tg.calibrate(free, gains=(10, 10.7, 8.5, 9, 9.5, 10.1))
print(arm)
detector = tg.train(free, arm)
print(detector.findings)
print(detector.card())
detector.save(folder / "arm.tauguard")  # the robot is in the file

# %%
# A log with two contacts. The model file is enough to find them.

detector = tg.load_detector(folder / "arm.tauguard")
contacts = (
    CollisionPlan("pulse", 5.0, link=4, strength=60.0, duration=0.4),
    CollisionPlan("clamp", 11.0, link=5),
)
episode = Episode(seed=31, seconds=16, speed=40.0, collisions=contacts, mismatch=arm_of_logs)
log = tg.read_log(recorded(episode), robot=detector, name="contacts")
found = detector.detect(log, payload=0)
print(found)
print(found.to_frame())
figure = tg.plot(found)  # a notebook shows it as the last value of a cell
figure.savefig(folder / "contacts.png", dpi=100)
plt.figure(figsize=(8, 6))
plt.imshow(plt.imread(folder / "contacts.png"))
plt.axis("off")
plt.tight_layout()

# %%
# In a control loop, the same alarms sample by sample:

stream = detector.carrying(0).stream()
trace = log.trace
for row, t in enumerate(trace.t):
    answer = stream.step(t, trace.q[row], trace.qd[row], trace.current[row])
    if answer.alarm:
        print(f"{t:.3f} s: {answer.state}, score {answer.score:.2f}")
        break

# %%
# Faulty columns are named, all at once. Here the currents of two joints are exchanged.

wrong = recorded(motions[0])
wrong["current"][:, [1, 2]] = wrong["current"][:, [2, 1]]
try:
    tg.calibrate(tg.read_logs({"wrong": wrong}, robot=robot))
except tg.RefusedError as error:
    print(error.findings)
