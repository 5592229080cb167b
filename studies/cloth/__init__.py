"""Cloth: whole frames of deforming meshes and single queries, beside ipctk."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from studies.framework import Part, Point, Study, groups, number, table_rows
from tauguard.report import Row

STUDY = Study(
    "continuous collision detection of deforming meshes: time, misses and false hits",
    {
        "frames": Part(
            "cloth.study",
            "whole frames of deforming meshes: methods, volumes, front, growth, beside ipctk",
        ),
    },
)


def points(rows: Sequence[Row]) -> Iterator[Point]:
    """Single queries, hard queries, and frames."""
    yield from _queries(rows)
    yield from _hard_queries(rows)
    yield from _frames(rows)


def _count(rates: Sequence[Any]) -> tuple[str, str]:
    known = [rate for rate in rates if isinstance(rate, Mapping) and rate["n"]]
    return f"{round(sum(r['value'] * r['n'] for r in known)):,}", f"{sum(r['n'] for r in known):,}"


def _errors(rows: Sequence[Row]) -> str:
    missed, hits = _count([row["misses"] for row in rows])
    false, free = _count([row["false_hits"] for row in rows])
    return f"{missed} missed of {hits}, {false} false of {free}"


def _queries(rows: Sequence[Row]) -> Iterator[Point]:
    """Single queries of a recorded cloth, hits included."""
    own = [row for row in table_rows(rows, "query") if row["method"] == "ab2pf"]
    latest = max((row["toi_error_most"] for row in own), default=0)
    for peer, mine in groups(table_rows(rows, "query peer"), lambda row: str(row["peer"])).items():
        rated = [row for row in mine if row["kind"] != "both"]
        for both in (row for row in mine if row["kind"] == "both"):
            question = f"a vertex-face or edge-edge query beside {peer}"
            text = f"{_errors(own)}; time within {latest:.0e}"
            yield Point(question, "ab2pf", 1e-3 * both["ab2pf_all_ns"], math.nan, text, "ours")
            early = max(row["toi_error_median"] for row in rated)
            text = f"{_errors(rated)}; time early by {early:.0e} (median)"
            yield Point(question, peer, 1e-3 * both["all_ns"], math.nan, text, "peer")


def _hard_queries(rows: Sequence[Row]) -> Iterator[Point]:
    """Every method's mean over all sets with public labels, weighted by their queries."""
    own = table_rows(rows, "hard query")
    for method, mine in groups(own, lambda row: str(row["method"])).items():
        n = sum(row["n"] for row in mine)
        wrong = sum(row["misses"] + row["false_hits"] for row in mine) / n
        cost = sum(row["us"] * row["n"] for row in mine) / n
        question = "Single queries with public labels, mean over the sets"
        role = "peer" if method.startswith("ipc") else ""
        axes = ("microseconds a query", "share of wrong answers")
        yield Point(question, method, cost, wrong, "", role, *axes)


def _frames(rows: Sequence[Row]) -> Iterator[Point]:
    """The largest frame beside each peer, then every method and volume over all scenes."""
    peers, frames = table_rows(rows, "frame peer"), table_rows(rows, "frame")
    largest = max(peers, key=lambda row: number(row["ab2pf_ms"]) or 0.0, default={"scene": None})
    for own in frames:
        if own["method"] == "ab2pf" and own["scene"] == largest["scene"]:
            error = f"{own['missed']} missed, {own['late']} late of {own['ab2pf_hits']:,}"
            for row in (row for row in peers if row["scene"] == own["scene"]):
                question = f"a frame of {own['scene']}, {own['triangles']:,} triangles"
                question += f", beside {row['peer']}"
                ours = 1e3 * (number(row["ab2pf_ms"]) or 0.0)
                yield Point(question, "ab2pf", ours, math.nan, error, "ours")
                text = "not judged on frames"
                yield Point(question, row["peer"], 1e3 * row["peer_ms"], math.nan, text, "peer")
            break
    scenes = {row["scene"] for row in frames}
    question = f"A frame of each of {len(scenes)} deforming meshes, one thread"
    axes = ("microseconds, sum", "collisions missed or late")
    by_method = groups(frames, lambda r: f"{r['method']}, {r['volume'].replace('_', ' ')}")
    for method, mine in by_method.items():
        if {row["scene"] for row in mine} == scenes:
            cost = 1e3 * sum(number(row["frame_ms"]) or 0.0 for row in mine)
            wrong = sum(row["missed"] + row["late"] for row in mine)
            yield Point(question, method, cost, wrong, "", "", *axes)
