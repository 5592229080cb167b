"""
A twin from a log
=================

A few minutes of collision-free motion show an arm's friction, ripple and noise. A simulated arm
with these numbers, a twin, reports currents like those of the real arm. Here another simulated arm,
whose numbers are not given to the identification, stands in for the real one.
"""

import matplotlib.pyplot as plt
import numpy as np

from tauguard.datasets import free_episodes
from tauguard.detectors.calibration.nominal import nominal_arm
from tauguard.envs import simulate
from tauguard.models import Mismatch
from tauguard.twin import fit_twin, played

hidden = Mismatch(seed=12)
logs = [simulate(e) for e in free_episodes(4, 6, 20.0, (30.0,), (0.0,), hidden)]
twin = fit_twin(nominal_arm(logs), logs[:5], np.full(6, 30.0))
print("Coulomb friction [N m]:", twin.drive.friction.coulomb.round(2))
print(*twin.notes, sep="\n")

# %%
# The last log was not used. The twin repeats its motion.

log = logs[5]
current = played(twin.arm, twin.drive, log)
figure, panels = plt.subplots(2, 1, figsize=(6.4, 4.2), sharex=True, layout="constrained")
for panel, joint in zip(panels, (1, 3), strict=True):
    panel.plot(log.t, log.current[:, joint], linewidth=0.8, label="arm")
    panel.plot(log.t, current[:, joint], linewidth=0.8, label="twin")
    panel.set_ylabel(f"current, joint {joint + 1} [A]")
panels[0].legend()
panels[1].set(xlabel="time [s]", xlim=(5, 15))
