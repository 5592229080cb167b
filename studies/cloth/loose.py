"""Queries of points and the safe step of a solver, beside ipctk's, with the errors of both."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from time import process_time
from typing import Any

import numpy as np

from oracles.point_contact import point_edge_time, point_point_time
from studies.cloth.peer import load_ipctk
from studies.cloth.scaling import bound, scaled, scenes, step_at
from studies.framework import time_in_turn
from tauguard.arrays import Array
from tauguard.cloth import Impacts, MeshCCD, point_edge, point_point
from tauguard.report import Row

Query = Callable[..., Impacts]
Truth = Callable[[Array, Array], float]
QUERIES: dict[str, tuple[Query, int, Truth]] = {
    "point-edge": (point_edge, 3, point_edge_time),
    "point-point": (point_point, 2, point_point_time),
}
#: A time is late from here on: the truth is rounded once in [0, 1], by less than this.
ROUNDING = 2.0**-53
#: Queries that rational arithmetic decides, and that the peer is asked call by call.
KNOWN = 400


def drawn(rng: np.random.Generator, n: int, corners: int, meet: bool) -> Array:
    """Queries on a lattice, which meet exactly or hardly ever do. Shape (2, n, corners, 3)."""
    x = rng.integers(-(2**20), 2**20, size=(2, n, corners, 3)).astype(float)
    x[:, :, 1:] *= 4096  # so that the meeting place comes out exactly
    if not meet:
        x[:, :, 0] *= 4096
        return x
    t, s = rng.integers(1, 64, size=n) / 64, rng.integers(0, 65, size=n) / 64
    ends = (1 - t)[:, None, None] * x[0] + t[:, None, None] * x[1]
    at = ends[:, 1] if corners == 2 else ends[:, 1] + s[:, None] * (ends[:, 2] - ends[:, 1])
    away = rng.integers(-(2**20), 2**20, size=(n, 3)).astype(float)
    x[0, :, 0], x[1, :, 0] = at - t[:, None] * away, at + (1 - t)[:, None] * away
    return x


def point_queries(n: int, seed: int, repeats: int) -> list[Row]:
    """Two rows a kind of query: times in ns a query, errors as counts and in steps.

    Args:
        n: Queries a row, of which the first ``KNOWN`` are decided in rational arithmetic.
        seed: Of the lattice points.
        repeats: Of each timing.
    """
    rng = np.random.default_rng(seed)
    rows: list[Row] = []
    for kind, meet in product(QUERIES, (False, True)):
        query, corners, first_time = QUERIES[kind]
        x = drawn(rng, n, corners, meet)
        found = query(*x)
        spent = time_in_turn({"": bound(query, *x)}, repeats, process_time)[""]
        known = range(min(n, KNOWN))
        truth = np.array([first_time(*x[:, i]) for i in known])
        hit, toi = found.hit[: len(truth)], found.toi[: len(truth)]
        real = np.isfinite(truth)
        early = truth[real & hit] - toi[real & hit]
        rows.append(
            {
                "study": "point query",
                "kind": kind,
                "queries": "made to meet" if meet else "drawn",
                "n": n,
                "ns": scaled(spent, 1e9 / n),
                "known": len(truth),
                "misses": int((real & ~hit).sum()),
                "false_hits": int((hit & ~real).sum()),
                "late": int((early < -ROUNDING).sum()),
                "early_most": float(early.max(initial=0)),
                **_peer(kind, x[:, known], truth),
            }
        )
    return rows


def _peer(kind: str, x: Array, truth: Array) -> Row:
    """ipctk's times and errors, judged by the same rational arithmetic; truth of shape (N,)."""
    ipctk = load_ipctk()
    if ipctk is None:
        return {"peer_ns": "ipctk is not installed"}
    method = ipctk.AdditiveCCD()
    name = f"{kind.replace('-', '_')}_ccd"
    answers, spent = _asked(getattr(method, name), x)
    empty = _asked(getattr(method, name), np.zeros_like(x) + np.arange(x.shape[2])[:, None])[1]
    theirs, times = np.array([a[0] for a in answers]), np.array([a[1] for a in answers])
    real = np.isfinite(truth)
    early = truth[real & theirs] - times[real & theirs]
    return {
        "peer_ns": 1e9 * spent,
        "call_ns": 1e9 * empty,
        "peer_misses": int((real & ~theirs).sum()),
        "peer_false_hits": int((theirs & ~real).sum()),
        "peer_late": int((early < -ROUNDING).sum()),
        "peer_early_most": float(early.max(initial=0)),
    }


def _asked(call: Callable[..., Any], x: Array) -> tuple[list[Any], float]:
    """Answers of single calls and the mean seconds of one."""
    rows = [(*start, *end) for start, end in zip(*x, strict=True)]
    begin = process_time()
    answers = [call(*row) for row in rows]
    return answers, (process_time() - begin) / len(rows)


def safe_steps(triangles: int, seed: int, repeats: int) -> list[Row]:
    """One number in [0, 1] a solver scales its step by, on every generated scene.

    Args:
        triangles: About so many a scene.
        seed: Of the scenes.
        repeats: Of each timing, which is in ms a call.
    """
    ipctk = load_ipctk()
    rows: list[Row] = []
    for scene in scenes(triangles, seed):
        x_t0, x_t1 = step_at(scene, 0.85)
        ccd, exact = MeshCCD(scene.faces), MeshCCD(scene.faces, "exact")
        step = ccd.safe_step(x_t0, x_t1)
        calls: dict[str, Callable[[], object]] = {"ours": bound(ccd.safe_step, x_t0, x_t1)}
        row: Row = {
            "study": "safe step",
            "scene": scene.name,
            "triangles": len(scene.faces),
            "earliest": exact.find(x_t0, x_t1).first_time(),
            "step": step,
            "meets_after": meets(exact, x_t0, x_t1, step),
        }
        if ipctk is not None:
            a, b = np.asfortranarray(x_t0), np.asfortranarray(x_t1)
            mesh = ipctk.CollisionMesh(a, ccd.edges, scene.faces)
            ask = bound(
                ipctk.compute_collision_free_stepsize,
                *(mesh, a, b, 0.0, ipctk.LBVH(), ipctk.AdditiveCCD()),
            )
            calls["peer"] = ask
            row["peer_step"] = theirs = float(ask())
            row["peer_meets_after"] = meets(exact, x_t0, x_t1, theirs)
        spent = time_in_turn(calls, repeats, process_time)
        row["ms"] = scaled(spent["ours"], 1e3)
        row["peer_ms"] = scaled(spent["peer"], 1e3) if "peer" in spent else "ipctk is not installed"
        rows.append(row)
    return rows


def meets(exact: MeshCCD, x_t0: Array, x_t1: Array, share: float) -> int:
    """How many pairs touch on the way to that share of the step, start and end included."""
    frame = exact.find(x_t0, x_t0 + share * (x_t1 - x_t0))
    return len(frame.vf) + len(frame.ee)
