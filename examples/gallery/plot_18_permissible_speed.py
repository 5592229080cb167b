"""
How fast beside a person
========================

The permissible speed along a program without a reaction, and with a stop that begins soon after the
first touch.
"""

# %%
# A program through three waypoints.
from matplotlib import pyplot as plt

import tauguard as tg
from tauguard.models import BODY_REGIONS
from tauguard.speed import Program

near, above, far = (
    [0, -1.2, 1.5, -1, -1.5, 0],
    [0.5, -1.4, 1.2, -1, -1.5, 0],
    [1, -1, 1.4, -1, -1.5, 0],
)
program = Program.from_waypoints([0, 1, 2, 3.5], [near, above, far, near], name="pick and place")

# %%
# Two regions are enough for a picture. Every result says what it assumes.
regions = {name: BODY_REGIONS[name] for name in ("hand", "chest")}
delays = (None, 0.1, 0.05, 0.02, 0.005)
results = {
    delay: tg.speed_limits(program, "ur5e", delay=delay, regions=regions, check=delay == 0.05)
    for delay in delays
}
print(results[0.05])

# %%
# An earlier reaction permits a higher speed, until the first peak decides.
figure, axes = plt.subplots(layout="constrained")
names = ["none", *(f"{1e3 * delay:g}" for delay in delays[1:] if delay)]
for region in regions:
    speeds = [
        min(limit.permissible for limit in result.limits if limit.region == region)
        for result in results.values()
    ]
    axes.plot(names, speeds, "o-", label=f"{region}, clamped")
axes.set_xlabel("delay of the stop after the first touch [ms]")
axes.set_ylabel("permissible speed of the binding point [m/s]")
axes.set_ylim(bottom=0)
axes.legend()
