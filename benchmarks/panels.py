"""Which rows of which study are points of error against microseconds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tauguard.report import Row
from tauguard.report.pareto import Panel, Point

#: A label that begins so is a peer's.
PEERS = ("ipctk", "coal", "MuJoCo", "mujoco", "scikit")


@dataclass(frozen=True)
class Source:
    """A panel's rows: of one study of one bench, one point each."""

    bench: str
    study: str
    title: str
    label: tuple[str, ...]
    cost: str
    error: str
    cost_title: str = "microseconds"
    error_title: str = "error"
    factor: float = 1.0
    unit: str = ""


SOURCES = (
    Source(
        bench="simulation",
        study="timestep",
        title="Time step of the arm under position control",
        label=("timestep_ms",),
        cost="us_per_simulated_ms",
        error="q_error_rad",
        cost_title="microseconds per simulated millisecond",
        error_title="largest joint error [rad]",
        unit=" ms",
    ),
    Source(
        bench="impact",
        study="rail",
        title="A blow on a rail beside the two-mass model",
        label=("timestep_ms", "integrator", "contact"),
        cost="us_per_simulated_ms",
        error="peak_force_error",
        cost_title="microseconds per simulated millisecond",
        error_title="error of the peak force [share]",
    ),
    Source(
        bench="contacts",
        study="scenes",
        title="Contact checkers: when the first contact is reported",
        label=("checker",),
        cost="us_per_step",
        error="first_error_ms",
        cost_title="microseconds a step",
        error_title="error of the first report [ms]",
    ),
    Source(
        bench="cloth",
        study="hard query",
        title="Single queries with public labels",
        label=("method",),
        cost="us",
        error="false_hits",
        cost_title="microseconds a query",
        error_title="false hits (misses in the table)",
    ),
    Source(
        bench="cloth",
        study="frame",
        title="A frame of a deforming mesh, one thread",
        label=("method",),
        cost="ms",
        error="missed",
        cost_title="microseconds a frame",
        error_title="collisions missed",
        factor=1e3,
    ),
    Source(
        bench="detection_online",
        study="step",
        title="Detectors online: cost of a sample",
        label=("detector",),
        cost="us",
        error="difference_to_batch",
        cost_title="microseconds a sample",
        error_title="largest difference of online to offline score",
    ),
)
#: Methods of the study rigid and their names in the panel.
CONVEX = {
    "abfme": "abfme",
    "sat": "sat",
    "auto": "auto",
    "textbook": "textbook",
    "coal_net": "coal (net of its call)",
}


def panels(bench: str, rows: Sequence[Row]) -> list[Panel]:
    """The panels of one bench's rows; a row without both figures is no point."""
    found = [_panel(source, rows) for source in SOURCES if source.bench == bench]
    if bench == "rigid":
        found.append(_convex(rows))
    return [panel for panel in found if panel.points]


def _panel(source: Source, rows: Sequence[Row]) -> Panel:
    points = []
    own = [row for row in rows if row.get("study") == source.study]
    many = [key for key in source.label if len({str(row.get(key)) for row in own}) > 1]
    for row in own:
        cost, error = number(row.get(source.cost)), number(row.get(source.error))
        if cost is not None and error is not None and cost > 0:
            label = ", ".join(_short(row[key]) for key in many or source.label) + source.unit
            peer = any(_short(row[key]).startswith(PEERS) for key in source.label)
            points.append(Point(label, cost * source.factor, abs(error), peer))
    return Panel(source.title, source.cost_title, source.error_title, tuple(points))


def _convex(rows: Sequence[Row]) -> Panel:
    """Each method's mean over the pairs of kinds of bodies: time and share of wrong answers."""
    own = [row for row in rows if row.get("study") == "table 2.1 static"]
    points = []
    for key, label in CONVEX.items():
        wrong = key.removesuffix("_net") + "_wrong"
        found = [(number(row.get(f"{key}_ns")), row.get(wrong)) for row in own]
        known = [(t, w) for t, w in found if t is not None and isinstance(w, Mapping) and w["n"]]
        if known:
            count = sum(w["value"] * w["n"] for _, w in known)
            share = count / sum(w["n"] for _, w in known)
            mean = sum(t for t, _ in known) / len(known)
            points.append(Point(label, 1e-3 * mean, share, label.startswith(PEERS)))
    title = "Overlap of convex bodies, mean over kinds"
    return Panel(title, "microseconds a pair", "share of wrong answers", tuple(points))


def number(value: object) -> float | None:
    """A plain number, or the middle of a rate or of a time; ``None`` for what is neither."""
    if isinstance(value, Mapping):
        value = value.get("median", value.get("value"))
    return float(value) if isinstance(value, int | float) else None


def _short(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
