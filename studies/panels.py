"""Which rows of which study are points of error against microseconds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from studies.gaps import Gaps
from tauguard.report import Row
from tauguard.report.pareto import Panel, Point

#: The rows of every study that is there.
Studies = Mapping[str, Sequence[Row]]
#: A label that begins so is a peer's.
PEERS = ("ipc", "coal", "MuJoCo", "mujoco", "scikit", "advancement", "plain", "speculative")


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
        bench="rigid",
        study="time of impact",
        title="Time of impact of turning bodies",
        label=("method", "bodies"),
        cost="us_hit",
        error="toi_error_max",
        cost_title="microseconds a pair that meets",
        error_title="largest error of the time [steps]",
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


def panels(studies: Studies, gaps: Gaps) -> list[Panel]:
    """The panels of all studies; a row without both figures is no point."""
    made: dict[str, Callable[[Studies], Panel]] = {
        "cloth, queries": _queries,
        "cloth, frames": _frames,
        "rigid, convex bodies": _convex,
        "rigid, meshes": _meshes,
        "guard": _guard,
        "detectors": _detectors,
    }
    for source in SOURCES:
        made[f"{source.bench}, {source.study}"] = partial(_panel, source)
    none = Panel("", "", "", ())
    found = [
        gaps.attempt(f"error against microseconds, {name}", partial(make, studies), none)
        for name, make in made.items()
    ]
    return [panel for panel in found if panel.points]


def rows_of(studies: Studies, bench: str, study: str) -> list[Row]:
    """The rows of one study of one bench; none where it is absent."""
    return [row for row in studies.get(bench, ()) if row.get("study") == study]


def number(value: object) -> float | None:
    """A plain number, or the middle of a rate or of a time; ``None`` for what is neither."""
    if isinstance(value, Mapping):
        value = value.get("median", value.get("value"))
    return float(value) if isinstance(value, int | float) else None


def _panel(source: Source, studies: Studies) -> Panel:
    points = []
    own = rows_of(studies, source.bench, source.study)
    many = [key for key in source.label if len({str(row.get(key)) for row in own}) > 1]
    for row in own:
        cost, error = number(row.get(source.cost)), number(row.get(source.error))
        if cost is not None and error is not None and cost > 0:
            label = ", ".join(_short(row[key]) for key in many or source.label) + source.unit
            peer = any(_short(row[key]).startswith(PEERS) for key in source.label)
            points.append(Point(label, cost * source.factor, abs(error), peer))
    return Panel(source.title, source.cost_title, source.error_title, tuple(points))


def _grouped(rows: Sequence[Row], key: Callable[[Row], str]) -> dict[str, list[Row]]:
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return groups


def _queries(studies: Studies) -> Panel:
    """Every method's mean over all sets with public labels, weighted by their queries."""
    points = []
    groups = _grouped(rows_of(studies, "cloth", "hard query"), lambda row: str(row["method"]))
    for label, own in groups.items():
        n = sum(row["n"] for row in own)
        wrong = sum(row["misses"] + row["false_hits"] for row in own)
        cost = sum(row["us"] * row["n"] for row in own) / n
        points.append(Point(label, cost, wrong / n, label.startswith(PEERS)))
    title = "Single queries with public labels, mean over the sets"
    return Panel(title, "microseconds a query", "share of wrong answers", tuple(points))


def _frames(studies: Studies) -> Panel:
    """Every method on its volume: the sum of one frame of each scene."""
    points = []
    rows = rows_of(studies, "cloth", "frame")
    scenes = {row["scene"] for row in rows}
    groups = _grouped(rows, lambda row: f"{row['method']}, {row['volume'].replace('_', ' ')}")
    for label, own in groups.items():
        if {row["scene"] for row in own} == scenes:
            cost = 1e3 * sum(number(row["frame_ms"]) or 0.0 for row in own)
            wrong = sum(row["missed"] + row["late"] for row in own)
            points.append(Point(label, cost, wrong))
    title = f"A frame of each of {len(scenes)} deforming meshes, one thread"
    return Panel(title, "microseconds, sum", "collisions missed or late", tuple(points))


def _convex(studies: Studies) -> Panel:
    """Each method's mean over the pairs of kinds of bodies: time and share of wrong answers."""
    own = rows_of(studies, "rigid", "table 2.1 static")
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


def _meshes(studies: Studies) -> Panel:
    """Each volume's mean over the poses of the generated mesh, and coal's."""
    points: list[Point] = []
    rows = rows_of(studies, "rigid", "table 2.2 static")
    for label, own in _grouped(rows, lambda row: str(row["volume"])).items():
        poses = sum(row["poses"] for row in own)
        for name, key in ((label, "batch_mean_us"), ("coal", "coal_mean_us")):
            spent = [number(row.get(key)) for row in own]
            if all(spent) and not any(point.label == name for point in points):
                cost = sum(t * row["poses"] for t, row in zip(spent, own, strict=True) if t)
                share = number(own[0]["disagree"]) or 0.0
                points.append(Point(name, cost / poses, share, name == "coal"))
    title = "Overlap of two meshes, by bounding volume"
    return Panel(title, "microseconds a pose", "share of answers that differ", tuple(points))


def _guard(studies: Studies) -> Panel:
    """Ways to step over fast contacts: mean time over the families, share of scenes lost."""
    points = []
    rows = [row for row in rows_of(studies, "guard", "thrown") if row["timestep_ms"] == "all"]
    for label, own in _grouped(rows, lambda row: str(row["method"])).items():
        known = [row["over_fixed"] for row in own if row["over_fixed"] is not None]
        n = sum(row["held"]["n"] for row in own)
        lost = n - sum(row["held"]["value"] * row["held"]["n"] for row in own)
        if known and n:
            cost = sum(known) / len(known)
            points.append(Point(label, cost, lost / n, label.startswith(PEERS)))
    title = "Steps over fast contacts, scenes drawn at random"
    cost_title = "time over the longest fixed step that holds"
    return Panel(title, cost_title, "share of scenes passed through", tuple(points))


def _detectors(studies: Studies) -> Panel:
    """Detectors at the threshold for a rate of false alarms, where both studies are there."""
    rows = rows_of(studies, "detection_online", "step")
    cost = {row["detector"]: number(row["us"]) for row in rows}
    points = []
    for row in rows_of(studies, "detection", "hourly"):
        us, found = cost.get(row["detector"]), number(row["sensitivity"])
        if row["speed"] == 0 and us is not None and found is not None:
            points.append(Point(row["detector"], us, 1 - found))
    title = "Detectors online, aimed at 0.25 false alarms an hour"
    return Panel(title, "microseconds a sample", "share missed from 16 N m up", tuple(points))


def _short(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
