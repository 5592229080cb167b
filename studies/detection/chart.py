"""The detection study as one figure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.detection.thresholds import HOURLY
from tauguard.report import Row
from tauguard.report.charts import errorbars

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Style of most legends.
SMALL = {"fontsize": 7}


def draw(rows: list[Row], figure: Figure) -> None:
    """Sensitivity over the torque, false alarms, delay, and the cells beside the dissertation's."""
    axes = figure.subplots(2, 3)
    names = list(dict.fromkeys(r["detector"] for r in rows if r["study"] == "hourly"))
    colours = {name: f"C{k}" for k, name in enumerate(names)}
    _draw_strata(rows, axes[0, 0], colours)
    _draw_hourly(rows, axes[0, 1], colours)
    _draw_delay(rows, axes[1, 0], colours)
    _draw_cells(rows, axes[1, 1])
    _draw_output(rows, axes[0, 2])
    _draw_sigma(rows, axes[1, 2])


def _draw_strata(rows: list[Row], axis: Any, colours: Mapping[str, str]) -> None:
    own = [r for r in rows if r["study"] == "strata" and r["point"] == HOURLY]
    kinds = sorted({r["torque_nm"] for r in own}, key=lambda s: float(s.split("-")[0]))
    for name, colour in colours.items():
        share = []
        for kind in kinds:
            rates = [
                r["sensitivity"] for r in own if r["detector"] == name and r["torque_nm"] == kind
            ]
            n = sum(r["n"] for r in rates)
            share.append(sum(r["value"] * r["n"] for r in rates) / n if n else np.nan)
        axis.plot(range(len(kinds)), share, "o-", color=colour, label=name, ms=3)
    axis.set_xticks(range(len(kinds)), kinds, rotation=30)
    _finish(
        axis,
        xlabel="achieved peak |tau_ext| over joints 1-4 [N m]",
        ylabel="sensitivity, all speeds",
        title="At the hourly threshold",
        legend={"fontsize": 7, "framealpha": 0.5},
    )


def _draw_hourly(rows: list[Row], axis: Any, colours: Mapping[str, str]) -> None:
    for name, colour in colours.items():
        own = [r for r in rows if r["study"] == "hourly" and r["detector"] == name and r["speed"]]
        speed = [r["speed"] for r in own]
        axis.plot(
            speed, [r["tau98"] if r["tau98"] else np.nan for r in own], "o-", color=colour, ms=3
        )
    axis.set_yscale("log")
    _finish(
        axis,
        xlabel="speed [% of the maximum]",
        ylabel="tau98 [N m]",
        title="Torque above which 98 % are found",
    )


def _draw_delay(rows: list[Row], axis: Any, colours: Mapping[str, str]) -> None:
    for name, colour in colours.items():
        own = [r for r in rows if r["study"] == "hourly" and r["detector"] == name and r["speed"]]
        own = [r for r in own if r["delay_ms"]["median"] is not None]
        speed = [r["speed"] for r in own]
        axis.plot(speed, [r["delay_ms"]["median"] for r in own], "o-", color=colour, ms=3)
        axis.plot(speed, [r["delay_ms"]["p95"] for r in own], ":", color=colour)
    axis.set_yscale("log")
    _finish(
        axis,
        xlabel="speed [% of the maximum]",
        ylabel="delay [ms]",
        title="Delay: median, 95th percentile dotted",
    )


def _draw_cells(rows: list[Row], axis: Any) -> None:
    own = [r for r in rows if r["study"] == "dissertation"]
    markers = {"srq-svr": "o", "srq-svr-plain": "s", "current-network": "^"}
    for name, marker in markers.items():
        mine = [r for r in own if r["detector"] == name]
        x = [1 - r["specificity"]["value"] for r in mine]
        axis.plot(x, [r["sensitivity"]["value"] for r in mine], marker, ms=5, label=name)
    theirs = [r for r in own if r["detector"] == "srq-svr"]
    axis.plot(
        [1 - r["their_specificity"]["value"] for r in theirs],
        [r["their_sensitivity"]["value"] for r in theirs],
        "kx",
        label="dissertation, SVR",
    )
    _finish(
        axis,
        xlabel="1 - specificity (motion cases)",
        ylabel="sensitivity, all collisions",
        title="The twelve cells of 1.6 and 2.0 A",
        legend=SMALL,
    )


def _draw_output(rows: list[Row], axis: Any) -> None:
    for row in rows:
        if row["study"] == "output" and row["detector"] == "srq-svr":
            torque = [float(x) for x in row["torque_nm"].split()]
            output = [float(x) for x in row["output"].split()]
            axis.plot(torque, output, ".", ms=4, label=f"{row['speed']:g} %")
    axis.set_xscale("log")
    _finish(
        axis,
        xlabel="achieved peak |tau_ext| [N m]",
        ylabel="highest output of the SVR",
        title="SVR output over collision torque",
        legend=SMALL,
    )


def _draw_sigma(rows: list[Row], axis: Any) -> None:
    own = [r for r in rows if r["study"] == "sigma" and r["detector"] == "srq-svr"]
    sigma = [r["sigma"] for r in own]
    for key, label in (("sensitivity", "from 16 N m up"), ("sensitivity_all", "from 4 N m up")):
        errorbars(axis, sigma, (r[key] for r in own), fmt="o-", ms=3, label=label)
    if own:
        axis.set_xscale("log")
    _finish(
        axis,
        xlabel="sigma of the SRQ kernel",
        ylabel="sensitivity",
        title="Length of the kernel" if own else "Length of the kernel: full run only",
        legend=SMALL if own else None,
        ylim=(0, 1.03),
    )


def _finish(axis: Any, legend: Mapping[str, float] | None = None, **labels: Any) -> None:
    """Labels, a legend in this style if one is given, and the grid of every panel."""
    axis.set(**labels)
    if legend is not None:
        axis.legend(**legend)
    axis.grid(alpha=0.3)
