"""Signed distances of convex bodies: time beside coal's, errors beside rational arithmetic."""

from __future__ import annotations

from functools import partial
from time import process_time

import numpy as np
from numpy.typing import NDArray

from oracles.convex_bodies import HARD, KINDS
from oracles.convex_distance import exact_distance, extent
from studies.framework import time_in_turn
from studies.rigid.convex import nanoseconds, take
from tauguard.report import Row, rate
from tauguard.rigid import coal_peer, distance
from tauguard.rigid.queries import native_overlap
from tauguard.rigid.shapes import Bodies

PAIRS = (("boxes", "boxes"), ("boxes", "tetrahedra"), ("tetrahedra", "tetrahedra"))


def run(quick: bool, seed: int) -> list[Row]:
    """Random pairs, apart and in each other, and the hard cases of tetrahedra."""
    rng = np.random.default_rng(seed)
    # The truth of a pair of boxes takes rational arithmetic half a minute.
    count, exact, of_boxes = (1_000, 10, 0) if quick else (20_000, 300, 2)
    rows: list[Row] = []
    for kinds in PAIRS:
        a, b = (KINDS[kind](rng, 4 * count) for kind in kinds)
        hit = native_overlap(a, b, "auto")[0]
        for outcome in (False, True):
            index = np.flatnonzero(hit == outcome)[:count]
            known = exact if kinds == ("tetrahedra", "tetrahedra") else of_boxes
            cell = take(a, index), take(b, index)
            label = "collision" if outcome else "non-collision"
            rows.append(gap_row("-".join(kinds), label, *cell, known))
    for name in HARD:
        a, b = HARD[name](rng, max(60, exact))
        tets = a.packed.shape[-1] == b.packed.shape[-1] == 12 and hasattr(a, "vertices")
        rows.append(gap_row(name, "hard case", a, b, exact if tets else 0))
    return rows


def gap_row(pair: str, outcome: str, a: Bodies, b: Bodies, exact: int) -> Row:
    """Times a pair, and errors relative to the pair's extent over the first ``exact`` rows."""
    got = distance(a, b).distance
    hit = native_overlap(a, b, "exact")[0]
    ns = nanoseconds(
        time_in_turn({"ours": partial(distance, a, b)}, 3, process_time)["ours"], len(got)
    )
    known = range(min(exact, len(got)))
    truth = np.array([exact_distance(a, b, i) for i in known])
    size = np.array([extent(a, b, i) for i in known])
    coal = coal_row(a, b, truth, size, hit)
    return {
        "study": "distance",
        "pair": pair,
        "outcome": outcome,
        "pairs": len(got),
        "distance_ns": ns,
        "wrong_sign": rate(int(((got <= 0) != hit).sum()), len(got)),
        "known": len(truth),
        "error": worst(got, truth, size),
        **coal,
    }


def worst(
    got: NDArray[np.float64], truth: NDArray[np.float64], size: NDArray[np.float64]
) -> float | None:
    """The largest error as a share of the pair's extent, None where no truth is known.

    Two points at one place have no extent: an error of theirs is infinite.
    """
    if not len(truth):
        return None
    off = np.abs(got[: len(truth)] - truth)
    return float(np.divide(off, size, out=np.where(off > 0, np.inf, 0.0), where=size > 0).max())


def coal_row(
    a: Bodies,
    b: Bodies,
    truth: NDArray[np.float64],
    size: NDArray[np.float64],
    hit: NDArray[np.bool_],
) -> Row:
    """The same of coal, with the call of its binding in the time."""
    try:
        left, right = coal_peer.geometries(a), coal_peer.geometries(b)
    except ValueError:
        return {"coal_ns": "coal is not installed"}
    found, seconds = min(
        (coal_peer.distance_all(left, right) for _ in range(3)), key=lambda x: x[1]
    )
    return {
        "coal_ns": seconds / len(found) * 1e9,
        "coal_wrong_sign": rate(int(((found <= 0) != hit).sum()), len(found)),
        "coal_error": worst(found, truth, size),
    }
