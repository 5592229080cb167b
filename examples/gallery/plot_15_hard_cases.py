"""
Hard cases
==========

Named cases with exact answers are given to every installed library. Add your own library by an
adapter of a few lines.
"""

from collections import Counter

import matplotlib.pyplot as plt
import numpy as np

from tauguard.hard_cases import adapters, load_cases, run


class EndOfStep:
    """Compares only the bounding boxes at the end of the step."""

    name = "end of step"

    def convex_sweep(self, a, b, displacement):
        a, b = np.array(a), np.array(b) + displacement
        return 1.0 if ((a.max(0) >= b.min(0)) & (b.max(0) >= a.min(0))).all() else None


rows = run(load_cases(), [*adapters(), EndOfStep()])
right, asked = Counter(), Counter()
for row in rows:
    asked[row["library"]] += 1
    right[row["library"]] += bool(row["right"])
for row in rows:
    if row["library"] == EndOfStep.name and not row["right"]:
        print(f"{row['case']}: {row['wrong']}")

# %%

names = sorted(asked, key=lambda name: right[name] / asked[name])
plt.barh(names, [100 * right[name] / asked[name] for name in names])
for k, name in enumerate(names):
    plt.text(2, k, f"{right[name]} of {asked[name]}", va="center", color="white")
plt.xlabel("right answers [%]")
plt.tight_layout()
