"""Figures of error against time, one per question; peers have their own markers."""

import io
import math
from collections.abc import Iterable, Sequence
from typing import Any

from studies.framework.rows import Point, groups
from tauguard.report.charts import COLOURS

#: Colours of tauguard's points and of the peers' points.
OURS, PEER = COLOURS[:2]


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

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    with plt.rc_context({"font.size": 10, "svg.hashsalt": points[0].question}):
        height = 3.4 + 0.19 * ((len({p.method for p in points}) + 1) // 2)
        figure = plt.figure(figsize=(5.6, height), layout="constrained")
        _draw(points, figure)
        out = io.StringIO()
        figure.savefig(out, format="svg", metadata={"Date": None})
        plt.close(figure)
    return out.getvalue()


def draw_points(points: Iterable[Point], figure: Any) -> None:
    """A panel for each question whose points have an error."""
    shown = groups([p for p in points if not math.isnan(p.error)], lambda p: p.question)
    if not shown:
        figure.text(0.5, 0.5, "times and errors are in the tables", ha="center")
        return
    figure.set_size_inches(6.0 * len(shown), 5.8)
    panels = figure.subfigures(1, len(shown), squeeze=False)[0]
    for own, panel in zip(shown.values(), panels, strict=True):
        _draw(own, panel)


def _draw(points: Sequence[Point], figure: Any) -> None:
    """Draw points numbered by label; a list below the axes explains the numbers."""
    axes = figure.subplots()
    labels = list(dict.fromkeys(p.method for p in sorted(points, key=lambda p: p.cost)))
    for number, label in enumerate(labels, 1):
        own = [point for point in points if point.method == label]
        colour, marker = (PEER, "s") if own[0].role == "peer" else (OURS, "o")
        at = [p.cost for p in own], [p.error for p in own]
        axes.plot(*at, marker, color=colour, ms=6, label=f"{number}  {label}")
        for point in own:
            shown = str(number)
            place = (point.cost, point.error)
            axes.annotate(shown, place, (4, 4), textcoords="offset points", fontsize=9)
    best = front(points)
    axes.plot([p.cost for p in best], [p.error for p in best], "-", color="0.7", lw=1, zorder=0)
    _scale(points, axes)
    one = points[0]
    axes.set(title=one.question, xlabel=one.cost_axis, ylabel=one.error_axis)
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
    axes.margins(x=0.1, y=0.12)
    if not above:
        axes.set(ylim=(-0.1, 1.0), yticks=[0])
