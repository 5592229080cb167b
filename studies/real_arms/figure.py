"""The figure of the benchmark's table: contacts found, the curve over false alarms, delays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tauguard.benchmark.judging import COUNTED, WITHIN
from tauguard.benchmark.submission import group_of, ranking
from tauguard.report import Row

#: Operating point of bars and delays, and the points of the curve.
POINT, CURVE = "60 an hour", ("12 an hour", "60 an hour", "240 an hour")
#: Number of methods with a curve and with delays.
SHOWN = 6


def draw(rows: list[Row], figure: Any) -> None:
    """Contacts found beside chance; what is found beyond chance over false alarms; delays."""
    table = [{k: str(v) for k, v in row.items()} for row in rows if row["study"] == "table"]
    table = [row for row in table if row.get("method")]
    point = POINT if any(r["operating point"] == POINT for r in table) else "as submitted"
    shown = [r for r in table if r["operating point"] == point and r["truth"] in COUNTED]
    if not shown:
        return
    order = [r["method"] for r in ranking(table, POINT)]
    upper, lower = figure.subfigures(2, 1, height_ratios=(1.3, 1))
    _bars(shown, order, upper)
    curve, delays = lower.subplots(1, 2)
    _curve(table, order[:SHOWN], curve)
    _delays(shown, order[:SHOWN], delays)


def _bars(shown: Sequence[dict[str, str]], order: Sequence[str], figure: Any) -> None:
    groups = sorted({group_of(row) for row in shown})
    axes = figure.subplots(1, len(groups), sharey=True, squeeze=False)[0]
    for axis, group in zip(axes, groups, strict=True):
        own = {row["method"]: row for row in shown if group_of(row) == group}
        total = int(next(iter(own.values()))["contacts"])
        place = [order.index(name) for name in own]
        axis.barh(place, [int(row["found"]) / total for row in own.values()], color="#8fb3d9")
        axis.plot([float(row["by chance"]) for row in own.values()], place, "k|", markersize=9)
        arm, truth, state = group
        axis.set_title(f"{arm}, {state}\n{truth}, {total}", fontsize=8)
        axis.set_xlim(0, 1)
        axis.tick_params(labelsize=7)
    axes[0].set_yticks(range(len(order)), order, fontsize=7)
    axes[0].invert_yaxis()
    figure.supxlabel("fraction found at 60 false alarms an hour; line: by chance", fontsize=8)


def _curve(table: list[dict[str, str]], methods: Sequence[str], axis: Any) -> None:
    for method in methods:
        places = []
        for point in CURVE:
            ranked = {row["method"]: row for row in ranking(table, point)}
            if method in ranked:
                low, _, high = ranked[method]["false per hour"].partition(" to ")
                middle = float(np.sqrt(max(float(low), 1.0) * float(high))) if high else np.nan
                places.append((middle, float(ranked[method]["beyond chance"])))
        axis.plot(*zip(*places, strict=True), "o-", label=method, markersize=4)
    axis.set_xscale("log")
    axis.set_xlabel("false alarms an hour (middle of the interval)", fontsize=8)
    axis.set_ylabel("found beyond chance", fontsize=8)
    axis.legend(fontsize=7)
    axis.tick_params(labelsize=7)


def _delays(shown: Sequence[dict[str, str]], methods: Sequence[str], axis: Any) -> None:
    total = {group_of(row): int(row["contacts"]) for row in shown}
    for k, method in enumerate(methods):
        own = [row for row in shown if row["method"] == method]
        number = sum(total[group_of(row)] for row in own)
        found = [sum(int(row[f"within {ms} ms"]) for row in own) / number for ms in WITHIN]
        axis.bar(np.arange(len(WITHIN)) + 0.13 * (k - SHOWN / 2), found, 0.13, label=method)
    axis.set_xticks(range(len(WITHIN)), [f"within {ms} ms" for ms in WITHIN], fontsize=8)
    axis.set_ylabel("fraction of all contacts (colours as on the left)", fontsize=8)
    axis.tick_params(labelsize=7)
