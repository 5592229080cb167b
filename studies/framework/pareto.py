"""Figures of error against time, one per question; peers have their own markers."""

import io
import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from studies.framework.rows import Point, groups
from tauguard.report import Row
from tauguard.report.charts import COLOURS

#: Colours of tauguard's points and of the peers' points.
OURS, PEER = COLOURS[:2]
#: A figure without points.
NOTHING = "what was measured is in the tables"


def front(points: Sequence[Point]) -> list[Point]:
    """The Pareto-optimal points in cost and error, in order of cost."""
    best: list[Point] = []
    for point in sorted(points, key=lambda p: (p.cost, p.error)):
        if not best or point.error < best[-1].error:
            best.append(point)
    return best


def svg(points: Sequence[Point]) -> str:
    """The points of one question as an SVG picture, readable at half of a page's width."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context({"font.size": 10, "svg.hashsalt": points[0].question}):
        height = 3.4 + 0.19 * ((len({p.method for p in points}) + 1) // 2)
        figure = Figure(figsize=(5.6, height), layout="constrained")
        _draw(points, figure)
        out = io.StringIO()
        figure.savefig(out, format="svg", metadata={"Date": None})
    return out.getvalue()


def draw_points(points: Iterable[Point], figure: Any) -> None:
    """Draw a panel for each ``Point.question`` that has points with a known error."""
    shown = groups([p for p in points if not math.isnan(p.error)], lambda p: p.question)
    if not shown:
        figure.text(0.5, 0.5, NOTHING, ha="center")
        return
    figure.set_size_inches(6.0 * len(shown), 5.8)
    panels = figure.subfigures(1, len(shown), squeeze=False)[0]
    for own, panel in zip(shown.values(), panels, strict=True):
        _draw(own, panel)


def draw_found(found: Mapping[str, Mapping[str, Row]], figure: Any) -> None:
    """A panel for each key: the fraction that each method found, with its 95 % interval."""
    if not found:
        figure.text(0.5, 0.5, NOTHING, ha="center")
        return
    rows = (len(found) + 1) // 2
    longest = max(len(own) for own in found.values())
    figure.set_size_inches(9.0, 0.6 + rows * (0.8 + 0.26 * longest))
    panels = figure.subplots(rows, min(2, len(found)), squeeze=False, sharex=True).ravel()
    for axes in panels[len(found) :]:
        axes.set_axis_off()
    for axes, (title, own) in zip(panels, found.items(), strict=False):
        for k, rate in enumerate(own.values()):
            if not rate["n"]:
                continue
            value, low, high = (rate[key] for key in ("value", "low", "high"))
            spread, colour = [[value - low], [high - value]], COLOURS[min(k, 1)]
            axes.errorbar(value, k, xerr=spread, fmt="o", color=colour)
        axes.set_yticks(range(len(own)), list(own), fontsize=9)
        axes.set(title=title, xlim=(-0.02, 1.02), ylim=(len(own) - 0.5, -0.5))
    figure.supxlabel("found, with 95 % interval", fontsize=10)


def _draw(points: Sequence[Point], figure: Any) -> None:
    """Draw points numbered by label; a list below the axes explains the numbers."""
    axes = figure.subplots()
    labels = list(dict.fromkeys(p.method for p in sorted(points, key=lambda p: p.cost)))
    numbers: dict[tuple[float, float], dict[str, None]] = {}
    for number, label in enumerate(labels, 1):
        own = [point for point in points if point.method == label]
        colour, marker = (PEER, "s") if own[0].role == "peer" else (OURS, "o")
        at = [p.cost for p in own], [p.error for p in own]
        axes.plot(*at, marker, color=colour, ms=6, label=f"{number}  {label}")
        for place in zip(*at, strict=True):
            numbers.setdefault(place, {})[str(number)] = None
    for place, own_numbers in numbers.items():
        text = ", ".join(own_numbers)
        axes.annotate(text, place, (4, 4), textcoords="offset points", fontsize=9)
    best = front(points)
    axes.plot([p.cost for p in best], [p.error for p in best], "-", color="0.7", lw=1, zorder=0)
    _scale(points, axes)
    one = points[0]
    axes.set(title=textwrap.fill(one.question, 44), xlabel=one.cost_axis, ylabel=one.error_axis)
    axes.grid(alpha=0.25)
    figure.legend(loc="outside lower left", ncols=2, fontsize=8, frameon=False)


def _scale(points: Sequence[Point], axes: Any) -> None:
    """Use a logarithmic cost axis, and error axis if errors span more than a factor of 20."""
    from matplotlib.ticker import LogLocator, NullLocator

    axes.set_xscale("log")
    costs = [p.cost for p in points]
    decades = max(costs) > 8 * min(costs)
    if max(costs) < 1e3 * min(costs):
        axes.xaxis.set_major_locator(
            LogLocator(subs=(1, 2, 5) if decades else (1, 1.5, 2, 3, 5, 7))
        )
    axes.xaxis.set_major_formatter("{x:,.10g}")
    axes.xaxis.set_minor_locator(NullLocator())
    above = [p.error for p in points if p.error > 0]
    if above and max(above) > 20 * min(above):
        axes.set_yscale("symlog", linthresh=min(above))
        axes.yaxis.get_major_locator().set_params(numticks=7)
    axes.margins(x=0.1, y=0.12)
    if max(costs) == min(costs):
        axes.set_xlim(costs[0] / 3, costs[0] * 3)
    if not above:
        axes.set(ylim=(-0.1, 1.0), yticks=[0])
