"""Text, picture and printable page of permissible speeds."""

from __future__ import annotations

import html
import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tauguard.results import html_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tauguard.speed.limits import SpeedLimits

CLOSING = (
    "Estimates for comparing programs, tools and detectors. Measure forces and pressures on the "
    "real robot."
)

STYLE = (
    "body{font:14px sans-serif;margin:2em;max-width:75em}svg{max-width:100%;height:auto}"
    "table{border-collapse:collapse;font-size:12px}"
    "td,th{border:1px solid #ccc;padding:2px 6px;text-align:right}"
)


def text(result: SpeedLimits) -> str:
    """The result as text: assumptions, a table of the binding regions, what to slow down."""
    count = len(result.segments)
    lines = [
        f"speed along {result.program.name} beside a person: {result.robot}, "
        f"{result.program.seconds:.1f} s, {count} segment{'s' * (count != 1)}",
        *assumptions(result),
        "",
    ]
    head = (
        f"{'segment':>7} {'t [s]':>7} {'programmed':>11} {'mass':>6} {'region':<10} {'free':>6} "
        f"{'no stop':>8} {'permissible':>12}  {'limited by':<14} {'delay':>7}"
    )
    units = (
        f"{'':>7} {'':>7} {'[m/s]':>11} {'[kg]':>6} {'':<10} {'[m/s]':>6} {'[m/s]':>8} "
        f"{'[m/s]':>12}  {'':<14} {'[ms]':>7}"
    )
    lines += [head, units]
    for number in range(1, count + 1):
        own = sorted(
            (limit for limit in result.limits if limit.segment == number),
            key=lambda limit: limit.permissible / limit.programmed,
        )
        for place, limit in enumerate(own[:3]):
            delay = f"{1e3 * limit.delay:.0f}" if np.isfinite(limit.delay) else "-"
            start = f"{number:>7}" if place == 0 else f"{'':>7}"
            lines.append(
                f"{start} {limit.t:>7.2f} {limit.programmed:>11.2f} {limit.mass:>6.1f} "
                f"{limit.region:<10} {limit.free:>6.2f} {limit.undetected:>8.2f} "
                f"{limit.permissible:>12.2f}  {limit.limited_by:<14} {delay:>7}"
            )
    return "\n".join([*lines, "", *conclusions(result), CLOSING])


def assumptions(result: SpeedLimits) -> list[str]:
    """What the result rests on, one line each, doubtful things first."""
    tool = result.tool
    reaction = result.detection + (f"; {result.stop}" if result.reacts else "")
    margin = f", margin {result.margin:g}" if result.margin != 1 else ""
    return [
        *(finding.text for finding in result.findings),
        f"tool: {tool}, {tool.mass:g} kg, {1e3 * tool.length:g} mm from the flange",
        f"reaction: {reaction}",
        f"skull and face: no contact permitted; the lowest three of the others are listed{margin}",
    ]


def conclusions(result: SpeedLimits) -> list[str]:
    """Which segments are too fast, and what the simulation of the binding cases says."""
    factors = result.slow_down()
    lines = [
        "slow down: "
        + ", ".join(f"segment {number} to {factor:.2f}" for number, factor in factors.items())
        if factors
        else "no segment exceeds a limit"
    ]
    simulated = [limit for limit in result.limits if np.isfinite(limit.simulated)]
    if simulated:
        lines.append(
            f"simulated in MuJoCo at the permissible speed: {len(simulated)} binding cases, force "
            f"over its limit at most {result.worst_simulated:.2f}"
        )
    return lines


def figure(result: SpeedLimits) -> Figure:
    """Programmed and permissible speed along the program."""
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(10, 4), layout="constrained")
    panel = drawn.subplots()
    for k, (start, end) in enumerate(result.segments, start=1):
        own = [limit for limit in result.limits if limit.segment == k]
        if not own:
            continue
        worst = min(own, key=lambda limit: limit.permissible / limit.programmed)
        first = k == 1
        panel.hlines(
            worst.programmed,
            start,
            end,
            color="black",
            label="programmed, binding point" if first else "",
        )
        panel.hlines(
            worst.permissible, start, end, color="tab:red", lw=2.5,
            label="permissible, lowest region" if first else "",
        )  # fmt: skip
        panel.hlines(
            worst.undetected, start, end, color="tab:gray", linestyle=":",
            label="permissible, clamped, no stop" if first else "",
        )  # fmt: skip
        panel.annotate(worst.region, (start, worst.permissible), fontsize=7, va="bottom")
    panel.set_xlabel("time in the program [s]")
    panel.set_ylabel("speed of the binding point [m/s]")
    panel.set_ylim(bottom=0)
    panel.legend(fontsize=8)
    panel.set_title(
        f"{result.program.name}, {result.robot}; reaction: {result.detection}", fontsize=9
    )
    return drawn


def write_page(result: SpeedLimits, path: str | Path) -> None:
    """Write one printable HTML page: assumptions, picture, table."""
    picture = io.StringIO()
    figure(result).savefig(picture, format="svg")
    svg = picture.getvalue()
    title = f"Permissible speed beside a person: {result.program.name}"
    body = "\n".join(
        [
            f"<h1>{html.escape(title)}</h1><h2>Assumptions</h2>",
            f"<ul>{_tags('li', assumptions(result))}</ul>{_tags('p', conclusions(result))}",
            svg[svg.index("<svg") :],
            f"<h2>All segments and regions</h2>{html_table(result.rows())}<p>{CLOSING}</p>",
        ]
    )
    head = f'<meta charset="utf-8"><title>{html.escape(title)}</title><style>{STYLE}</style>'
    page = f'<!doctype html><html lang="en"><head>{head}</head><body>{body}</body></html>\n'
    Path(path).write_text(page, encoding="utf-8")


def _tags(tag: str, lines: list[str]) -> str:
    return "".join(f"<{tag}>{html.escape(line)}</{tag}>" for line in lines)
