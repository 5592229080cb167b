"""The report's first screen: speed, accuracy and detection, each a sentence and a figure."""

import io
import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from studies.framework.pareto import OURS, PEER
from studies.framework.rows import Point, groups
from tauguard.report.page import picture

#: Least collision-free motion for a rate of false alarms [h].
HOURS = 1.0


@dataclass(frozen=True)
class Found:
    """Results of a detector on simulated arms, all speeds together."""

    detector: str
    found: dict[str, float]  #: fraction found of the collisions from 16 N m up: value, low, high, n
    alarms: dict[str, float]  #: false alarms per hour: value, low, high
    hours: float  #: duration of collision-free motion [h]
    asked: float  #: target of false alarms per hour


def headlines(points: Sequence[Point], found: Sequence[Found]) -> str:
    """Three sentences with their figures, as HTML; a short run may lack some."""
    parts = [_fast(points), _right(points), _quiet(found)]
    return f'<div class="figures">{"".join(part for part in parts if part)}</div>'


def _pairs(points: Sequence[Point], usable: Callable[[Point], bool]) -> list[tuple[Point, Point]]:
    """Pairs of points of tauguard and of a peer, from the questions that have both."""
    return [
        (ours, peer)
        for own in groups([p for p in points if usable(p)], lambda p: p.question).values()
        for ours in own
        if ours.role == "ours"
        for peer in own
        if peer.role == "peer"
    ]


def _fast(points: Sequence[Point]) -> str:
    pairs = _pairs(points, lambda p: p.cost_axis.startswith("microseconds") and p.cost > 0)
    if not pairs:
        return ""
    ratios = {f"{_short(o)}; {p.method}": p.cost / o.cost for o, p in pairs}
    usual, slower = statistics.median(ratios.values()), sum(r < 1 for r in ratios.values())
    text = (
        f"<b>Fast.</b> The peer takes {usual:.3g} times as long, the median of {len(ratios)} "
        f"comparisons in the same run, on one thread; in {slower or 'none'} of them tauguard takes "
        "longer."
    )

    def draw(axes: Any) -> None:
        names = sorted(ratios, key=lambda name: ratios[name])
        for k, name in enumerate(names):
            axes.barh(k, ratios[name], 0.35, color=OURS)
            _name(axes, k, f"{name}: {_round(ratios[name])}")
        axes.axvline(1.0, color="0.3", lw=0.8)
        axes.set(xscale="log", xlabel="time of the peer over time of tauguard", yticks=[])
        axes.set_xlim(0.5 * min(1.0, *ratios.values()), None)

    return _shown(text, draw, len(ratios), "time of the peer over time of tauguard")


def _short(point: Point) -> str:
    """The question without the peer that it names at its end."""
    return point.question.partition(", and ")[0]


def _round(ratio: float) -> str:
    """Two digits, without an exponent."""
    return f"{float(f'{ratio:.2g}'):,.10g}"


def _name(axes: Any, k: float, text: str) -> None:
    """Draw a name above its bar."""
    place = axes.get_yaxis_transform()
    axes.text(0.0, k + 0.25, f" {text}", transform=place, va="bottom").set_in_layout(False)


def _right(points: Sequence[Point]) -> str:
    known = [p for p in points if p.error_axis.startswith("fraction") and not math.isnan(p.error)]
    pairs = _pairs(known, lambda p: True)
    if not pairs:
        return ""
    ours, peers = max(o.error for o, _ in pairs), max(p.error for _, p in pairs)
    text = (
        f"<b>Right.</b> At most {_round(100 * ours)} % of tauguard's answers are wrong in any of "
        f"these questions, and up to {_round(100 * peers)} % of a peer's."
    )

    def draw(axes: Any) -> None:
        for k, (own, peer) in enumerate(pairs):
            axes.barh(k + 0.05, 100 * own.error, 0.18, color=OURS)
            axes.barh(k - 0.15, 100 * peer.error, 0.18, color=PEER)
            errors = f"{_round(100 * own.error)} and {_round(100 * peer.error)} %"
            _name(axes, k - 0.1, f"{_short(own)}; {peer.method}: {errors}")
        axes.set(xlim=(0, 100), yticks=[], xlabel="wrong answers [%]: tauguard (blue) and its peer")

    return _shown(text, draw, len(pairs), "fraction of wrong answers")


def _quiet(found: Sequence[Found]) -> str:
    if not found:
        return ""
    ours, others = found[0], found[1:]
    n, of = round(ours.found["value"] * ours.found["n"]), round(ours.found["n"])
    text = f"<b>Quiet.</b> {escape(ours.detector)} finds {n} of {of} collisions from 16 N m up"
    if ours.hours >= HOURS:
        a = ours.alarms
        text += (
            f" at {a['value']:.2g} [{a['low']:.2g}, {a['high']:.2g}] false alarms an hour, "
            f"{ours.asked:g} asked, in {ours.hours:.1f} h"
        )
    else:
        text += ". This quick run is too short to count false alarms; a full run does"

    def draw(axes: Any) -> None:
        rows = [*reversed(others), ours]
        for k, row in enumerate(rows):
            value, low, high = (row.found[key] for key in ("value", "low", "high"))
            error = [[value - low], [high - value]]
            colour = OURS if row is ours else PEER
            axes.barh(k, value, 0.35, xerr=error, color=colour, ecolor="0.4")
            _name(axes, k, row.detector)
        axes.set(xlim=(0, 1.02), yticks=[], xlabel="found from 16 N m up, 95 % interval")

    return _shown(f"{text}.", draw, len(found), "collisions found by each detector")


def _shown(text: str, draw: Callable[[Any], None], bars: int, what: str) -> str:
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context({"font.size": 9, "svg.hashsalt": what}):
        figure = Figure(figsize=(5.2, 0.9 + 0.36 * bars), layout="constrained")
        axes = figure.subplots()
        draw(axes)
        axes.set_ylim(-0.5, bars - 0.2)
        axes.spines[["top", "right", "left"]].set_visible(False)
        out = io.StringIO()
        figure.savefig(out, format="svg", metadata={"Date": None})
    image = picture(out.getvalue().encode(), "svg+xml", what)
    return f'<figure class="first"><p>{text}</p>{image}</figure>'
