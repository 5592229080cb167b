"""The metrics of a detector as a page of text and a page of charts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tauguard.detectors.evaluation.matching import Matching


#: Meaning of the words in the charts.
LEGEND = (
    "  sensitivity: share of collisions with an alarm within 0.5 s, or before a longer clamp ends",
    "  specificity: share of cases without an alarm; a case is 2 s without a collision",
    "  ppv: tp / (tp + fp); delay: from the first touch to the alarm; p95: 19 of 20 are faster",
    "  peak |tau_ext|: largest torque at joints 1-4 that the collision reached",
)


def rate(figure: Mapping[str, Any]) -> str:
    """A proportion with its interval as text."""
    if figure["value"] is None:
        return "none judged"
    return f"{figure['value']:.3f}  [{figure['low']:.3f}, {figure['high']:.3f}] of {figure['n']}"


def text(summary: Mapping[str, Any]) -> str:
    """The metrics of ``summary`` as aligned lines."""
    confusion, delay = summary["confusion"], summary["delay_ms"]
    alarms, head = summary["false_alarms_per_hour"], summary["headline"]
    lines = [
        "",
        f"judged on {confusion['tp'] + confusion['fn']} collisions and "
        f"{alarms['hours'] * 60:.1f} collision-free minutes",
        "(values with their 95 % interval)",
        "",
        f"  sensitivity from 16 N m up  {rate(head['sensitivity'])}",
        f"  sensitivity, all            {rate(summary['sensitivity'])}",
        f"  specificity, cases of 2 s   {rate(summary['specificity'])}",
        f"  ppv                         {rate(summary['ppv'])}",
        f"  accuracy                    {rate(summary['accuracy'])}",
        f"  false alarms per hour       {alarms['value']:.1f}  "
        f"[{alarms['low']:.1f}, {alarms['high']:.1f}] ({alarms['n']} alarms)",
    ]
    if delay["n"]:
        lines.append(
            f"  delay                       median {delay['median']:.1f} ms, "
            f"p95 {delay['p95']:.1f} ms"
        )
    lines += [
        f"  tp {confusion['tp']}  fn {confusion['fn']}  fp {confusion['fp']}  tn {confusion['tn']}",
        "",
        "  peak |tau_ext| [N m]   sensitivity",
    ]
    for name, figure in summary["strata"].items():
        lines.append(f"  {name:>8}               {rate(figure['sensitivity'])}")
    lines += ["", *LEGEND]
    return "\n".join(lines)


def diagnosis_text(found: Mapping[str, Any]) -> str:
    """The metrics of the diagnoses, as aligned lines."""
    if not found["link_right"]["n"]:
        return ""
    lines = [
        "",
        f"  after the alarm, {found['link_right']['n']} collisions found",
        f"  link right                  {rate(found['link_right'])}",
        f"  link or its neighbour       {rate(found['link_or_neighbour'])}",
        f"  last joint with torque      {rate(found['last_joint_right'])}",
    ]
    for name, label, unit in (
        ("force_error_n", "force error", "N"),
        ("direction_deg", "force direction", "deg"),
        ("point_cm", "contact point", "cm"),
    ):
        own = found[name]
        lines.append(
            f"  {label:<26}  median {own['median']:.1f} {unit}, p95 {own['p95']:.1f} {unit}"
        )
    for name, label in (("impulse", "impulse"), ("peak", "peak force")):
        width = found[f"{name}_width"]["median"]
        within = f"{label} in 90 % interval"
        lines.append(f"  {within:<27} {rate(found[f'{name}_held'])}, upper / lower {width:.1f}")
    if found["false_alarms_called_payload"]["n"]:
        lines.append(f"  false alarms called a load  {rate(found['false_alarms_called_payload'])}")
    return "\n".join(lines)


def figure(summary: Mapping[str, Any], matchings: Sequence[Matching]) -> Figure:
    """Sensitivity and delay over severity, the confusion matrix, and delays by kind."""
    from matplotlib.figure import Figure

    page = Figure(figsize=(14, 4.6), layout="constrained")
    axes = page.subplots(1, 3)
    _draw_strata(axes[0], summary["strata"])
    _draw_confusion(axes[1], summary["confusion"], summary["false_alarms_per_hour"])
    _draw_delays(axes[2], matchings)
    return page


def _draw_strata(axes: Axes, strata: Mapping[str, Any]) -> None:
    judged = {k: v for k, v in strata.items() if v["sensitivity"]["n"]}
    figures = [v["sensitivity"] for v in judged.values()]
    values = [figure["value"] for figure in figures]
    low = [figure["value"] - figure["low"] for figure in figures]
    high = [figure["high"] - figure["value"] for figure in figures]
    axes.bar(range(len(judged)), values, color="#2a788e", yerr=[low, high], capsize=4)
    axes.set_xticks(
        range(len(judged)), [f"{k}\nn = {v['n']}" for k, v in zip(judged, figures, strict=True)]
    )
    axes.set(
        xlabel="achieved peak |tau_ext|, joints 1-4 [N m]",
        ylabel="sensitivity (95 % interval)",
        ylim=(0, 1.05),
        title="Collisions found, by severity",
    )


def _draw_confusion(axes: Axes, confusion: Mapping[str, int], alarms: Mapping[str, Any]) -> None:
    import numpy as np

    table = np.array([[confusion["tp"], confusion["fn"]], [confusion["fp"], confusion["tn"]]])
    fraction = table / np.maximum(table.sum(axis=1, keepdims=True), 1)
    axes.imshow(fraction, cmap="YlGnBu", vmin=0, vmax=1)
    for (i, j), number in np.ndenumerate(table):
        color = "white" if fraction[i, j] > 0.6 else "black"
        axes.text(j, i, f"{number}", ha="center", va="center", fontsize=15, color=color)
    axes.set_xticks([0, 1], ["alarm", "no alarm"])
    axes.set_yticks([0, 1], ["collision", "no collision\n(2 s cases)"])
    axes.set_title(
        f"Confusion matrix\n{alarms['value']:.1f} false alarms per hour "
        f"[{alarms['low']:.1f}, {alarms['high']:.1f}]"
    )


def _draw_delays(axes: Axes, matchings: Sequence[Matching]) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    colours = {"strike": "#d95f02", "clamp": "#7570b3", "pulse": "#1b9e77"}
    for kind, colour in colours.items():
        pairs = [
            (c.peak_tau, 1e3 * d)
            for m in matchings
            for c, d in zip(m.collisions, m.delays, strict=True)
            if c.kind == kind and d is not None
        ]
        if pairs:
            peaks, delays = zip(*pairs, strict=True)
            axes.scatter(peaks, delays, s=22, color=colour, label=kind)
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="achieved peak |tau_ext|, joints 1-4 [N m]",
        ylabel="delay after onset [ms]",
        title="Detection delay",
    )
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    axes.grid(alpha=0.3)
    if axes.get_legend_handles_labels()[0]:
        axes.legend()
