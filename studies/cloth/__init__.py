"""Cloth: whole frames of deforming meshes and single queries, beside ipctk."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from studies.framework import Part, Point, Study, groups, number, table_rows
from tauguard.report import Row

STUDY = Study(
    "continuous collision detection of deforming meshes: time, missed and false collisions",
    {
        "frames": Part(
            "cloth.frames",
            "one time step of a mesh: time and misses of ab2pf, ICCD, DNF, SCD, VCD and ipctk",
        ),
        "volumes": Part(
            "cloth.volumes", "kinds of bounding volumes; time of meshes up to 10^6 triangles"
        ),
        "queries": Part(
            "cloth.queries",
            "single queries: those of a whole time step, and public ones with labels",
        ),
    },
)


def points(rows: Sequence[Row]) -> Iterator[Point]:
    """Time and error of single queries, labelled queries, frames and bounding volumes."""
    yield from _queries(rows)
    yield from _labelled(rows)
    yield from _frames(rows)
    axes = ("microseconds, sum", "candidates")
    for volume, mine in groups(table_rows(rows, "volume"), lambda r: str(r["volume"])).items():
        question = f"Bounding volumes, one step of each of {len(mine)} deforming meshes"
        cost = 1e3 * sum(number(row["frame_ms"]) or 0.0 for row in mine)
        pairs = sum(row["vf_candidates"] + row["ee_candidates"] for row in mine)
        yield Point(question, volume.replace("_", " "), cost, pairs, "", "", *axes)


def _errors(rows: Sequence[Row]) -> str:
    def count(key: str) -> str:
        known = [row[key] for row in rows if isinstance(row[key], Mapping) and row[key]["n"]]
        wrong = round(sum(rate["value"] * rate["n"] for rate in known))
        return f"{wrong:,} {key.replace('_', ' ')} of {sum(rate['n'] for rate in known):,}"

    return f"{count('misses')}, {count('false_hits')}"


def _queries(rows: Sequence[Row]) -> Iterator[Point]:
    """Time and error of a frame's queries, with and without hits, of ab2pf and of each peer."""
    own = [row for row in table_rows(rows, "query") if row.get("method") == "ab2pf"]
    latest = max((row["toi_error_most"] for row in own), default=0)
    for peer, mine in groups(table_rows(rows, "query peer"), lambda row: str(row["peer"])).items():
        rated = [row for row in mine if row["kind"] != "both"]
        early = max(row["toi_error_median"] for row in rated)
        for both in (row for row in mine if row["kind"] == "both"):
            question = f"a vertex-face or edge-edge query, and {peer}"
            text = f"{_errors(own)}; time within {latest:.0e}"
            yield Point(question, "ab2pf", 1e-3 * both["ab2pf_all_ns"], math.nan, text, "ours")
            text = f"{_errors(rated)}; time early by {early:.0e} (median)"
            yield Point(question, peer, 1e-3 * both["all_ns"], math.nan, text, "peer")


def _labelled(rows: Sequence[Row]) -> Iterator[Point]:
    """Mean results of each method over all labelled sets, weighted by numbers of queries."""
    axes = ("microseconds per query", "fraction of wrong answers")
    by_method = groups(table_rows(rows, "hard query"), lambda row: str(row["method"]))
    for method, mine in by_method.items():
        n = sum(row["n"] for row in mine)
        wrong = sum(row["misses"] + row["false_hits"] for row in mine) / n
        cost = sum(row["us"] * row["n"] for row in mine) / n
        role = {"ab2pf": "ours"}.get(method, "peer" if method.startswith("ipctk") else "")
        yield Point("Single queries with public labels", method, cost, wrong, "", role, *axes)


def _frames(rows: Sequence[Row]) -> Iterator[Point]:
    """Points of the largest frame and each peer, then of all methods over all scenes."""
    frames = table_rows(rows, "frame")
    peers = [row for row in table_rows(rows, "frame peer") if "speedup" in row]
    largest = max(peers, key=lambda row: number(row["ab2pf_ms"]) or 0.0, default={"scene": None})
    for peer in (row for row in peers if row["scene"] == largest["scene"]):
        own = next(row for row in frames if row["scene"] == peer["scene"])
        what = f"one step of {own['scene']}, {own['triangles']:,} triangles"
        question = f"{what}, and {peer['peer']}"
        ours = 1e3 * (number(peer["ab2pf_ms"]) or 0.0)
        error = f"{own['missed']} missed, {own['late']} late of {own['ab2pf_hits']:,}"
        yield Point(question, "ab2pf", ours, math.nan, error, "ours")
        text = "not judged on frames"
        yield Point(question, peer["peer"], 1e3 * peer["peer_ms"], math.nan, text, "peer")
    scenes: Any = {row["scene"] for row in frames}
    question = f"One step of each of {len(scenes)} deforming meshes, one thread"
    axes = ("microseconds, sum", "collisions missed or late")
    by_method = groups(frames, lambda r: f"{r['method']}, {r['volume'].replace('_', ' ')}")
    for method, mine in by_method.items():
        cost = 1e3 * sum(number(row["frame_ms"]) or 0.0 for row in mine)
        wrong = sum(row["missed"] + row["late"] for row in mine)
        yield Point(question, method, cost, wrong, "", "", *axes)
