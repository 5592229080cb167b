"""Charts of a dataset's content, on one page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tauguard.atomic_write import atomic_file
from tauguard.datasets.schedule import class_order

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {"strike": "#d95f02", "clamp": "#7570b3", "pulse": "#1b9e77"}


def draw_inspection(path: Path, folder: Path, report: Mapping[str, Any]) -> None:
    """Draw counts by class, severity by kind, hours by speed and payload, and one collision."""
    from matplotlib.figure import Figure

    from tauguard.datasets.dataset_folder import lines

    every = list(lines(folder))
    figure = Figure(figsize=(13, 8.5), layout="constrained")
    axes = figure.subplots(2, 2)
    _classes(axes[0, 0], report)
    _severity(axes[0, 1], every)
    _speeds(axes[1, 0], every)
    _collision(axes[1, 1], folder, every)
    splits = ", ".join(f"{k} {v['hours']:.3g} h" for k, v in report["splits"].items())
    figure.suptitle(f"{report['name']}: {splits}", parse_math=False)  # names may have dollar signs
    with atomic_file(path) as stream:
        figure.savefig(stream, dpi=110, format=path.suffix[1:] or "png")


def _classes(axes: Axes, report: Mapping[str, Any]) -> None:
    labels, there, wanted = [], [], []
    for what in ("kind", "link", "severity"):
        planned: dict[str, int] = {}
        achieved: dict[str, int] = {}
        for one in report["splits"].values():
            for into, counts in ((planned, one["planned"]), (achieved, one["achieved"])):
                for value, count in counts.get(what, {}).items():
                    into[value] = into.get(value, 0) + count
        for value in sorted(planned.keys() | achieved.keys(), key=class_order):
            labels.append({"link": f"link {value}", "severity": f"{value} N m"}.get(what, value))
            there.append(achieved.get(value, 0))
            wanted.append(planned.get(value, 0))
    rows = np.arange(len(labels))
    axes.barh(rows, there, color="#2a788e", label="simulated")
    axes.plot(wanted, rows, "|", color="black", markersize=14, markeredgewidth=2, label="planned")
    axes.set_yticks(rows, labels)
    axes.invert_yaxis()
    axes.set(xlabel="collisions", title="Collisions of each class")
    axes.legend(loc="lower right")


def _severity(axes: Axes, every: list[dict[str, Any]]) -> None:
    for kind, colour in COLOURS.items():
        found = [c for line in every for c in line["collisions"] if c["kind"] == kind]
        if found:
            force = [float(np.linalg.norm(c["force"])) for c in found]
            axes.scatter(
                force, [c["peak_tau"] for c in found], s=12, alpha=0.6, color=colour, label=kind
            )
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="peak contact force [N]",
        ylabel="peak |tau_ext|, joints 1-4 [N m]",
        title="Force and severity of the collisions",
    )
    axes.grid(alpha=0.3)
    if axes.get_legend_handles_labels()[0]:
        axes.legend()


def _speeds(axes: Axes, every: list[dict[str, Any]]) -> None:
    speeds = sorted({line["speed"] for line in every})
    loads = sorted({line["payload_g"] for line in every})
    grid = np.zeros((len(loads), len(speeds)))
    for line in every:
        grid[loads.index(line["payload_g"]), speeds.index(line["speed"])] += line["seconds"] / 3600
    image = axes.imshow(grid, cmap="YlGnBu", aspect="auto", vmin=0)
    axes.set_xticks(range(len(speeds)), [f"{v:g}" for v in speeds])
    axes.set_yticks(range(len(loads)), [f"{v:g}" for v in loads])
    axes.set(xlabel="speed [% of maximum]", ylabel="payload [g]", title="Hours")
    axes.figure.colorbar(image, ax=axes, label="h")


def _collision(axes: Axes, folder: Path, every: list[dict[str, Any]]) -> None:
    from tauguard.datasets.reader import episodes_of

    line = next((x for x in every if x["rows"] and x["collisions"]), None)
    if line is None:
        axes.set_axis_off()
        return
    trace = next(iter(episodes_of(folder, [line])))
    first = max(line["collisions"], key=lambda c: float(c["peak_tau"]))
    near = (trace.t > first["onset"] - 0.15) & (trace.t < first["end"] + 0.25)
    assert trace.truth is not None
    torque = trace.truth.tau_ext[near]
    for joint in range(torque.shape[1]):
        axes.plot(trace.t[near], torque[:, joint], label=f"joint {joint + 1}")
    axes.axvspan(first["onset"], first["end"], color="#d95f02", alpha=0.15)
    axes.set(
        xlabel="time [s]",
        ylabel="tau_ext [N m]",
        title=f"{line['split']}/{line['number']}: {first['kind']} on link {first['link']}",
    )
    axes.grid(alpha=0.3)
    axes.legend(ncols=2, fontsize=8)
