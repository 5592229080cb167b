"""Signed distances of convex bodies, with and without radii: time and error, also of coal.

The truth is rational arithmetic. coal's own tolerance is 1e-6 of the pair's size.
"""

import time
from collections.abc import Callable
from functools import partial
from operator import itemgetter

import numpy as np

from oracles import coal_peer
from oracles.convex_bodies import HARD, KINDS
from oracles.convex_distance import exact_distance, exactly_meet, extent, relative_error
from oracles.convex_pairs import random_bodies, take
from studies.framework import per, table_rows, time_in_turn
from studies.rigid.bars import count, error, faster
from tauguard.report import Row, rate
from tauguard.rigid import distance, overlap
from tauguard.rigid.queries import native_overlap
from tauguard.rigid.rounded import Solid

PAIRS = (("boxes", "boxes"), ("boxes", "tetrahedra"), ("tetrahedra", "tetrahedra"))
ROUNDED = (
    ("spheres", "spheres"),
    ("capsules", "capsules"),
    ("capsules", "tetrahedra"),
    ("rounded boxes", "capsules"),
    ("rounded boxes", "rounded boxes"),
)
NOTES = {
    "distance": "ns for the signed distance of a pair; coal's times include its Python call. "
    "wrong_sign: fraction of all pairs, by the exact overlap; wrong_overlap: of the `known` pairs, "
    "by rational arithmetic; error: largest of the known distances, as a fraction of the pair's "
    "size.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """Measure random pairs (apart, overlapping), hard cases of tetrahedra, bodies with radii."""
    rng = np.random.default_rng(seed)
    # The exact distance of two boxes takes half a minute.
    n, exact, of_boxes = (1_000, 10, 0) if quick else (20_000, 300, 2)
    rows: list[Row] = []
    for kinds in PAIRS:
        a, b = (KINDS[kind](rng, 4 * n) for kind in kinds)
        hit = native_overlap(a, b, "auto")[0]
        known = exact if kinds == ("tetrahedra", "tetrahedra") else of_boxes
        for outcome, name in ((False, "non-collision"), (True, "collision")):
            index = np.flatnonzero(hit == outcome)[:n]
            rows.append(distance_row("-".join(kinds), name, take(a, index), take(b, index), known))
    for name in HARD:
        a, b = HARD[name](rng, max(60, exact))
        tetrahedra = all(hasattr(side, "vertices") for side in (a, b))
        rows.append(distance_row(name, "hard case", a, b, exact if tetrahedra else 0))
    for kinds in ROUNDED:
        first, second = (random_bodies(rng, kind, n, 0.8) for kind in kinds)
        known = exact // 100 if any("boxes" in kind for kind in kinds) else exact
        rows.append(distance_row("-".join(kinds), "radii", first, second, known))
    return rows + summary(rows, quick)


def summary(rows: list[Row], quick: bool) -> list[Row]:
    """Wrong signs, errors, and the ratio of times, coal / tauguard."""
    found = table_rows(rows, "distance")
    ratios = [
        row["coal_ns"] / row["distance_ns"]["median"]
        for row in found
        if row["outcome"] in ("collision", "non-collision")
    ]
    return [
        error("distance: wrong signs", 0, [count(row["wrong_sign"]) for row in found]),
        error("overlap: wrong beside exact distances", 0, [r["wrong_overlap"] for r in found]),
        error("distance: error as a fraction of the size", 3e-14, [row["error"] for row in found]),
        faster("distance over coal, random pairs", 1, ratios, quick),
    ]


def distance_row(pair: str, outcome: str, a: Solid, b: Solid, exact: int) -> Row:
    """Time per pair, and the errors of the first ``exact`` pairs relative to the pairs' sizes."""
    got, hit = distance(a, b).distance, overlap(a, b).hit
    calls: dict[str, Callable[[], object]] = {
        "distance": partial(distance, a, b),
        "overlap": partial(overlap, a, b),
    }
    spent = time_in_turn(calls, 3, time.process_time)
    known = range(min(exact, len(got)))
    truth = np.array([exact_distance(a, b, i) for i in known])
    size = np.array([extent(a, b, i) for i in known])
    sides = coal_peer.geometries(a), coal_peer.geometries(b)
    coal, seconds = min((coal_peer.distance_all(*sides) for _ in range(3)), key=itemgetter(1))
    return {
        "study": "distance",
        "pair": pair,
        "outcome": outcome,
        "pairs": len(got),
        "distance_ns": per(spent["distance"], len(got)),
        "overlap_ns": per(spent["overlap"], len(got)),
        "coal_ns": seconds / len(got) * 1e9,
        "wrong_sign": rate(int(((got <= 0) != hit).sum()), len(got)),
        "coal_wrong_sign": rate(int(((coal <= 0) != hit).sum()), len(got)),
        "known": len(truth),
        "wrong_overlap": sum(exactly_meet(a, b, i) != bool(hit[i]) for i in known),
        "error": relative_error(got, truth, size),
        "coal_error": relative_error(coal, truth, size),
    }
