"""
Computing time and errors
=========================

AB2PF is the method of ``tauguard.cloth``. It and earlier published methods get the same time steps
of a cloth and the same candidate pairs. How long does a step take, and how many collisions does
each method miss or invent?
"""

import time

import matplotlib.pyplot as plt

from tauguard.cloth import comparators
from tauguard.cloth.scenes import SCENES


def frames(scene, method):
    """Milliseconds per frame (the faster of two runs), and the set of collisions."""
    steps, best = list(scene.steps(6)), float("inf")
    for _ in range(2):
        mesh = comparators.ComparedMeshCCD(scene.faces, groups=scene.groups, method=method)
        start = time.process_time()
        found = [mesh.find(x_t0, x_t1) for x_t0, x_t1 in steps]
        best = min(best, 1e3 * (time.process_time() - start) / len(steps))
    return best, {
        (k, kind, *pair)
        for k, frame in enumerate(found)
        for kind, pairs in (("vf", frame.vf), ("ee", frame.ee))
        for pair in pairs.tolist()
    }


figure, panels = plt.subplots(1, 2, figsize=(7, 3.4), sharey=True, layout="constrained")
for panel, (name, size) in zip(
    panels, (("crumpling", 6_000), ("packed_cubes", 1_500)), strict=True
):
    scene = SCENES[name](size, 0)
    truth = frames(scene, "exact")[1]  # in exact integer arithmetic
    for method, mark in zip(("ab2pf", "iccd", "dnf", "scd", "vcd"), "os^vD", strict=True):
        cost, found = frames(scene, method)
        missed, false = len(truth - found), len(found - truth)
        print(f"{name}, {method}: {cost:.1f} ms, {missed} missed, {false} false of {len(truth)}")
        wrong = 100 * (missed + false) / len(truth)
        panel.plot(cost, wrong, mark, fillstyle="none", markersize=9, label=method)
    panel.set(title=name.replace("_", " "), xlabel="computing time per step [ms]")
panels[0].set_ylabel("wrong answers [% of the collisions]")
panels[1].legend()

# %%
# Contacts of cubes that slide on each other lie in a plane. Methods that do not decide such
# contacts are fast here, but miss them.
