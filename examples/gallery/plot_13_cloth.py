"""
Collisions of a cloth
=====================

``MeshCCD`` finds every vertex-face and edge-edge collision of a draped skirt in each step. None is
missed and none is invented. The first time of impact tells a solver how far the step may go.
"""

import time

import matplotlib.pyplot as plt
import numpy as np

from tauguard.cloth import MeshCCD
from tauguard.cloth.scenes import SCENES

scene = SCENES["seated_skirt"](4_000, 0)
ccd = MeshCCD(scene.faces, groups=scene.groups)
counts, first, cost = [], [], []
for x_t0, x_t1 in scene.steps(20):
    start = time.process_time()
    frame = ccd.find(x_t0, x_t1)
    cost.append(1e3 * (time.process_time() - start))
    counts.append((len(frame.vf), len(frame.ee)))
    times = np.concatenate([frame.vf_impacts.toi, frame.ee_impacts.toi])
    first.append(times.min(initial=1.0))
print(f"{len(scene.faces):,} triangles, {np.sum(counts):,} collisions")
print(f"{np.median(cost):.1f} ms a frame; the earliest contact is at {min(first):.3f} of its step")

# %%

figure = plt.figure(figsize=(7, 3.6), layout="constrained")
left = figure.add_subplot(1, 2, 1, projection="3d")
left.plot_trisurf(*x_t1.T, triangles=scene.faces, linewidth=0.1, edgecolor="0.4", color="0.8")
left.set_aspect("equal")
left.set_axis_off()
right = figure.add_subplot(1, 2, 2)
right.plot(counts, label=["vertex-face", "edge-edge"])
right.set(xlabel="frame", ylabel="collisions")
right.legend()
