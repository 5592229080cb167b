"""Rigid bodies: overlap, bounding volumes, meshes, distance and time of impact, beside coal."""

import statistics
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from studies.framework import Part, Point, Study, groups, number, table_rows
from tauguard.report import Row

STUDY = Study(
    "convex bodies and meshes: overlap, volumes, distance, time of impact; also of coal",
    {
        "convex": Part(
            "rigid.convex",
            "overlap of convex bodies by elimination (ABFME) and by separating axes; hard cases",
        ),
        "mesh": Part(
            "rigid.mesh",
            "bounding volumes of mesh trees: overlap and motion of two Stanford bunnies",
        ),
        "volumes": Part("rigid.volumes", "time and tightness of single bounding volumes"),
        "motion": Part(
            "rigid.motion", "time of impact of rotating bodies: computing time and error"
        ),
        "distance": Part("rigid.distance", "signed distance: computing time and error"),
        "surfaces": Part(
            "rigid.surfaces", "distances of meshes, points and rays; broad phase of many bodies"
        ),
    },
)
#: Methods of Table 2.1: the columns of their times and wrong answers, and their role.
CONVEX = {
    "abfme": ("abfme_ns", "abfme_wrong", ""),
    "sat": ("sat_ns", "sat_wrong", ""),
    "auto": ("auto_ns", "auto_wrong", "ours"),
    "textbook": ("textbook_ns", "textbook_wrong", ""),
    "coal, net of its call": ("coal_net_ns", "coal_wrong", "peer"),
}


def points(rows: Sequence[Row]) -> Iterator[Point]:
    """Time and error: convex bodies (mean over all cells), time of impact, meshes."""
    convex = table_rows(rows, "table 2.1 static")
    for method, (time, errors, role) in CONVEX.items():
        times = [value for row in convex if (value := number(row.get(time))) is not None]
        wrong, of = _count([row.get(errors) for row in convex])
        if times and of:
            cost, text = 1e-3 * sum(times) / len(times), f"{wrong:,} wrong of {of:,}"
            axes = "microseconds per pair, mean over kinds", "fraction of wrong answers"
            yield Point("overlap of two convex bodies", method, cost, wrong / of, text, role, *axes)
    for row in table_rows(rows, "time of impact"):
        missed, of = _count([row["missed"]])
        error, role = row["toi_error_max"], "ours" if row["method"] == "tauguard" else "peer"
        question = f"time of impact of two rotating {row['bodies']}"
        text = f"{missed} missed of {of:,}; time within {error:.0e}"
        axes = "microseconds per pair that meets", "largest error of the time [steps]"
        yield Point(question, row["method"], number(row["us_hit"]) or 0.0, error, text, role, *axes)
    yield from _distances(table_rows(rows, "distance"))
    for row in table_rows(rows, "figure 1.1 volumes"):
        question, cost = "bounding volumes of pieces of a mesh", 1e-3 * row["test_ns"]["median"]
        text = f"{row['volume']}, {row['tightness']:.2g} times the hull's volume"
        axes = "microseconds per test", "separate hulls with overlapping volumes"
        yield Point(question, text, cost, row["false_hits"]["value"], "", "", *axes)
    meshes = groups(table_rows(rows, "table 2.2 static"), lambda row: str(row["volume"]))
    for volume, own in meshes.items():
        yield _mesh(own, volume, "batch_mean_us", "ours" if volume == "obb" else "")
    if "obb" in meshes:
        yield _mesh(meshes["obb"], "coal, OBBRSS", "coal_mean_us", "peer")


def _distances(rows: Sequence[Row]) -> Iterator[Point]:
    """Random pairs, and hard cases, which exact arithmetic decides in 50 times the time."""
    for hard, name in ((False, "random pairs"), (True, "hard cases")):
        own = [row for row in rows if (row["outcome"] == "hard case") == hard]
        for method, time, key in (("tauguard", "distance_ns", ""), ("coal", "coal_ns", "coal_")):
            known = [row[f"{key}error"] for row in own if row["known"]]
            if not known:
                continue
            cost = 1e-3 * statistics.geometric_mean(number(row[time]) or 0.0 for row in own)
            error = min(1.0, max(known))  # coal's error is not bounded
            wrong, of = _count([row[f"{key}wrong_sign"] for row in own])
            text = f"within {error:.0e} of the size; {wrong:,} wrong signs of {of:,}"
            axes = "microseconds per pair, geometric mean", "largest error, fraction of the size"
            role, question = "peer" if key else "ours", f"signed distance of two bodies, {name}"
            yield Point(question, method, cost, error, text, role, *axes)


def _count(rates: Sequence[Any]) -> tuple[int, int]:
    """The numbers of counted cases and of all cases, summed over several rates."""
    known = [rate for rate in rates if isinstance(rate, Mapping) and rate["n"]]
    return round(sum(r["value"] * r["n"] for r in known)), sum(r["n"] for r in known)


def _mesh(rows: Sequence[Row], method: str, time: str, role: str) -> Point:
    """Mean time of one volume over all poses."""
    poses = sum(row["poses"] for row in rows)
    cost = sum((number(row[time]) or 0.0) * row["poses"] for row in rows) / poses
    differ, of = _count([rows[0]["disagree"]])
    text, axes = f"{differ:,} answers differ of {of:,}", "fraction of answers that differ"
    question = "overlap of two meshes"
    return Point(question, method, cost, differ / of, text, role, "microseconds per pose", axes)
