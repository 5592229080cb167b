"""Slow logs: what detectors find, how soon, and their false alarms, at each sample rate.

Every row is of the same arms and the same simulated motion: at the lower rates a detector is
trained and judged on what a slower controller would have logged.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from studies.detection.motions import Training
from studies.detection.operating import merged
from studies.detection.rates import AIMED, Size, collisions, point, tallies_by_rate
from studies.framework import JobCache, Workers
from tauguard.report import Row
from tauguard.report.charts import errorbars

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Sample rates [Hz]: the CURA6's, those of common controllers, and the simulation's.
RATES = (23.8, 25.0, 50.0, 100.0, 125.0, 250.0, 1000.0)
#: The shipped detector, and thresholds on the same residual.
NAMES = ("srq-svr", "moving-thresholds")
#: False alarms per hour that the thresholds aim at.
ASKED = 1.0

NOTES = {
    "sample rate": "The same arms and motion at every rate [Hz], thresholds from each arm's own "
    "motion for one false alarm per hour. sensitivity: of collisions from 16 N m up; all: from "
    "4 N m up. Delays of those from 16 N m up, from the touch [ms]."
}

FULL = Size(3, NAMES, (ASKED,), Training(), 0.4, 0.6, 1)
LITTLE = Training(slices=6, free=4, free_seconds=20.0)
QUICK = Size(1, NAMES, (ASKED,), LITTLE, 0.1, 0.1, 1)


def measure(quick: bool, seed: int, keep: str | None = None) -> list[Row]:
    """Rows ``sample rate``: one per rate and detector."""
    size, rates = (QUICK, RATES[:1] + RATES[3:4]) if quick else (FULL, RATES)
    arms = [71_000 + 100 * seed + k for k in range(size.arms)]
    jobs = [(size, seed, arm, rates) for arm in arms]
    with Workers() as each:
        cache = JobCache.of(keep, "detection_sampling", seed, (size, rates))
        tallies = list(cache.over(each, "arm")(tallies_by_rate, jobs))
    by_rate = [merged(own) for own in zip(*tallies, strict=True)]
    return [
        {"study": "sample rate", "hz": hz, "detector": name}
        | collisions(whole[name, point(AIMED, ASKED)], 1.0)
        for hz, whole in zip(rates, by_rate, strict=True)
        for name in size.names
    ]


def draw(rows: list[Row], figure: Figure) -> None:
    """Fraction found and rate of false alarms over the sample rate, with intervals."""
    left, right = figure.subplots(1, 2)
    for k, name in enumerate(dict.fromkeys(row["detector"] for row in rows)):
        own = [row for row in rows if row["detector"] == name]
        at = [row["hz"] * 1.04**k for row in own]
        errorbars(left, at, (row["sensitivity"] for row in own), fmt="o", label=name)
        errorbars(right, at, (row["false_alarms_per_hour"] for row in own), fmt="o", label=name)
    right.axhline(ASKED, color="k", ls="--", label="aimed at")
    left.set(xscale="log", xlabel="samples per second", ylim=(0, 1.03))
    left.set(ylabel="found from 16 N m up")
    right.set(xscale="log", xlabel="samples per second", yscale="symlog")
    right.set(ylabel="false alarms per hour")
    rates = list(dict.fromkeys(row["hz"] for row in rows))
    for axis in (left, right):
        axis.set_xticks(rates, [f"{hz:g}" for hz in rates], rotation=45)
        axis.minorticks_off()
        axis.grid(alpha=0.3)
    right.legend(fontsize=8)
