"""Rigid bodies: overlap, meshes and time of impact, beside coal."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from studies.framework import Part, Point, Study, groups, number, table_rows
from tauguard.report import Row

STUDY = Study(
    "convex bodies and meshes: overlap, bounding volumes, time of impact",
    {
        "kernels": Part(
            "rigid.study",
            "convex overlap by elimination (ABFME) and axes, meshes, time of impact, beside coal",
        ),
    },
)
#: Methods of the table of convex bodies, and the columns of their times and wrong answers.
CONVEX = {
    "abfme": ("abfme_ns", "abfme_wrong", ""),
    "sat": ("sat_ns", "sat_wrong", ""),
    "auto": ("auto_ns", "auto_wrong", "ours"),
    "textbook": ("textbook_ns", "textbook_wrong", ""),
    "coal, net of its call": ("coal_net_ns", "coal_wrong", "peer"),
}


def points(rows: Sequence[Row]) -> Iterator[Point]:
    """Convex bodies, time of impact, meshes."""
    yield from _convex(table_rows(rows, "table 2.1 static"))
    yield from _impacts(table_rows(rows, "time of impact"))
    yield from _meshes(table_rows(rows, "table 2.2 static"))


def _count(rates: Sequence[Any]) -> tuple[int, int]:
    """How many of how many, over several rates."""
    known = [rate for rate in rates if isinstance(rate, Mapping) and rate["n"]]
    return round(sum(r["value"] * r["n"] for r in known)), sum(r["n"] for r in known)


def _convex(rows: Sequence[Row]) -> Iterator[Point]:
    """Each method's mean over the pairs of kinds of bodies: time and share of wrong answers."""
    for method, (time, errors, role) in CONVEX.items():
        times = [number(row.get(time)) for row in rows]
        known = [t for t in times if t is not None]
        wrong, of = _count([row.get(errors) for row in rows])
        if known and of:
            yield Point(
                "overlap of two convex bodies",
                method,
                1e-3 * sum(known) / len(known),
                wrong / of,
                f"{wrong:,} wrong of {of:,}",
                role,
                "microseconds a pair, mean over kinds",
                "share of wrong answers",
            )


def _impacts(rows: Sequence[Row]) -> Iterator[Point]:
    for row in rows:
        missed, of = _count([row["missed"]])
        yield Point(
            f"time of impact of two turning {row['bodies']}",
            str(row["method"]),
            number(row["us_hit"]) or 0.0,
            row["toi_error_max"],
            f"{missed} missed of {of:,}; time within {row['toi_error_max']:.0e}",
            "ours" if row["method"] == "tauguard" else "peer",
            "microseconds a pair that meets",
            "largest error of the time [steps]",
        )


def _meshes(rows: Sequence[Row]) -> Iterator[Point]:
    """Each volume's mean over the poses of the generated mesh, and coal's."""
    coal: list[Row] = []
    for volume, own in groups(rows, lambda row: str(row["volume"])).items():
        yield from _mesh(own, volume, "batch_mean_us", "ours" if volume == "obb" else "")
        coal = coal or [row for row in own if row.get("coal_mean_us") is not None]
    if coal:
        yield from _mesh(coal, "coal, OBBRSS", "coal_mean_us", "peer")


def _mesh(rows: Sequence[Row], method: str, time: str, role: str) -> Iterator[Point]:
    poses = sum(row["poses"] for row in rows)
    cost = sum((number(row[time]) or 0.0) * row["poses"] for row in rows) / poses
    differ, of = _count([rows[0]["disagree"]])
    yield Point(
        "overlap of two meshes",
        method,
        cost,
        number(rows[0]["disagree"]) or 0.0,
        f"{differ:,} answers differ of {of:,}",
        role,
        "microseconds a pose",
        "share of answers that differ",
    )
