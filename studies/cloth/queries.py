"""Single queries: nanoseconds beside misses, false hits and errors in time; ipctk in its own loop.

Times are the processor's (other programs do not count), of one thread and one call over the whole
list, gather included. ipctk is timed over candidates that the truth and itself call clear, through
``compute_collision_free_stepsize`` (a hit would shorten the step for what follows); what it costs
on hits and what it answers is asked call by call, Python included, and stated apart.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from studies.cloth.frames import Frame
from studies.cloth.peer import load_ipctk
from studies.cloth.scaling import bound
from studies.framework import time_in_turn
from tauguard.cloth import MeshCCD
from tauguard.cloth.comparators import METHODS, solve
from tauguard.report import Row, rate

#: Neighbours in the list of candidates that a peer is asked about.
RUN = 100

HARD_SETS = (
    "unit-tests",
    "erleben-cube-cliff-edges",
    "erleben-sliding-spike",
    "erleben-spike-hole",
    "erleben-spike-wedge",
    "erleben-wedges",
)


class Queries(NamedTuple):
    """Queries of one kind on shared positions."""

    vertex: bool
    x_t0: NDArray[np.float64]
    x_t1: NDArray[np.float64]
    rows: NDArray[np.int32]

    def some(self, which: NDArray[Any]) -> Queries:
        """The queries that a mask or indices choose."""
        return self._replace(rows=np.ascontiguousarray(self.rows[which]))


class Answer(NamedTuple):
    """Hits, times and what the narrow phase counted."""

    hit: NDArray[np.bool_]
    toi: NDArray[np.float64]
    counts: dict[str, int]


def solver(queries: Queries, method: str) -> Callable[[], Answer]:
    """A call that answers all queries, its arrays allocated beforehand."""
    n = len(queries.rows)
    hit, toi = np.zeros(n, dtype=np.uint8), np.full(n, np.inf)
    point, normal, weights = (np.empty((n, k)) for k in (3, 3, 4))

    def call() -> Answer:
        counts = solve(*queries, method, hit, toi, point, normal, weights)
        return Answer(hit.astype(bool), toi, counts)

    return call


def on_recording(frame: Frame, seed: int, limit: int, calls: int, repeats: int) -> list[Row]:
    """Every method and peer on the candidates of ipctk's LBVH, up to ``limit`` of each kind.

    Args:
        frame: A step whose collisions ab2pf finds exactly (the study "truth" says so).
        seed: Of the choice of candidates.
        limit: Candidates of each kind for the timings.
        calls: Candidates of each kind for the peers' answers, asked call by call.
        repeats: Of each timing.
    """
    ipctk = load_ipctk()
    if ipctk is None:
        return [{"study": "query", "set": frame.name, "peer": "ipctk is not installed"}]
    ccd = MeshCCD(frame.faces)
    mesh = ipctk.CollisionMesh(np.asfortranarray(frame.step[0]), ccd.edges, frame.faces)
    found = ipctk.Candidates()
    found.build(mesh, *map(np.asfortranarray, frame.step), 0.0, ipctk.LBVH())
    rng = np.random.default_rng(seed)
    rows: list[Row] = []
    lists = {True: found.fv_candidates, False: found.ee_candidates}  # each makes a new list
    for vertex, every in lists.items():
        chosen = sorted(rng.permutation(len(every))[:limit])
        candidates = [every[i] for i in chosen]
        queries = Queries(vertex, *frame.step, _rows(candidates, vertex, ccd.edges, frame.faces))
        truth = solver(queries, "ab2pf")()
        rows += _methods(frame.name, len(found), queries, truth, repeats)
        rows += _peers(ipctk, frame.name, mesh, candidates, queries, truth, rng, calls, rows[-1])
    return rows + _both_kinds(rows, len(lists[True]), len(lists[False]))


def _both_kinds(rows: list[Row], n_vf: int, n_ee: int) -> list[Row]:
    """The peers' and our times per query in the mix of kinds that the broad phase leaves."""
    share = {"vf": n_vf / (n_vf + n_ee), "ee": n_ee / (n_vf + n_ee)}
    found: list[Row] = []
    for peer in dict.fromkeys(row["peer"] for row in rows if row["study"] == "query peer"):
        own = [row for row in rows if row.get("peer") == peer]
        mean = {
            key: sum(share[row["kind"]] * row[key] for row in own)
            for key in ("ns", "ab2pf_ns", "all_ns", "ab2pf_all_ns")
        }
        found.append(
            {
                "study": "query peer",
                "set": own[0]["set"],
                "kind": "both",
                "peer": peer,
                "n": sum(row["n"] for row in own),
                **mean,
                "speedup": mean["ns"] / mean["ab2pf_ns"],
                "speedup_all": mean["all_ns"] / mean["ab2pf_all_ns"],
            }
        )
    return found


def on_hard_sets(folder: Path, calls: int) -> list[Row]:
    """The public hard queries with exact truth: hits, and the price of exact decisions."""
    rows: list[Row] = []
    for name in HARD_SETS:
        for kind in ("vertex-face", "edge-edge"):
            queries, truth = load_hard(folder / name / kind)
            for method in METHODS:
                call = solver(queries, method)
                answer = call()
                start = process_time()
                call()
                spent = process_time() - start
                rows.append(
                    {
                        "study": "hard query",
                        "set": name,
                        "kind": kind,
                        "method": method,
                        "n": len(truth),
                        "us": 1e6 * spent / len(truth),
                        "misses": int((truth & ~answer.hit).sum()),
                        "false_hits": int((answer.hit & ~truth).sum()),
                        "decided_exactly": answer.counts["exact"],
                    }
                )
            rows += _hard_peers(name, kind, queries, truth, calls)
    return rows


def load_hard(folder: Path) -> tuple[Queries, NDArray[np.bool_]]:
    """Sample-Queries (Wang et al. 2021): rationals that are exact doubles, and their truth."""
    x, truth = [], []
    for file in sorted(folder.glob("*.csv")):
        cells = [[int(cell) for cell in line.split(",")] for line in file.read_text().split()]
        x += [[row[2 * k] / row[2 * k + 1] for k in range(3)] for row in cells]
        truth += [bool(row[6]) for row in cells[::8]]
    positions = np.array(x).reshape(-1, 2, 4, 3)
    start, end = (np.ascontiguousarray(positions[:, i]).reshape(-1, 3) for i in (0, 1))
    rows = np.arange(len(start), dtype=np.int32).reshape(-1, 4)
    return Queries(folder.name == "vertex-face", start, end, rows), np.array(truth)


def _rows(
    candidates: list[Any], vertex: bool, edges: NDArray[np.int32], faces: NDArray[np.int32]
) -> NDArray[np.int32]:
    if vertex:
        pairs = np.array([(c.vertex_id, c.face_id) for c in candidates], dtype=np.int32)
        rows = np.concatenate([pairs[:, :1], faces[pairs[:, 1]]], axis=1)
    else:
        pairs = np.array([(c.edge0_id, c.edge1_id) for c in candidates], dtype=np.int32)
        rows = np.concatenate([edges[pairs[:, 0]], edges[pairs[:, 1]]], axis=1)
    return np.ascontiguousarray(rows, dtype=np.int32)


def _methods(name: str, total: int, queries: Queries, truth: Answer, repeats: int) -> list[Row]:
    few = np.arange(0, len(queries.rows), 1 + len(queries.rows) // 2000)
    lists = {method: queries.some(few) if method == "exact" else queries for method in METHODS}
    calls = {method: solver(lists[method], method) for method in METHODS}
    spent = time_in_turn(calls, repeats, process_time)
    clear = queries.some(~truth.hit)
    spent["clear"] = time_in_turn({"": solver(clear, "ab2pf")}, repeats, process_time)[""]
    exact = solver(queries.some(truth.hit), "exact")()
    rows: list[Row] = []
    for method, call in calls.items():
        answer, n = call(), len(lists[method].rows)
        hit = truth.hit[few] if method == "exact" else truth.hit
        toi = answer.toi[hit & answer.hit]
        first = exact.toi[answer.hit[hit]] if method != "exact" else toi
        rows.append(
            {
                "study": "query",
                "set": name,
                "kind": "vf" if queries.vertex else "ee",
                "method": method,
                "n": n,
                "of": total,
                "ns": {key: 1e9 * value / n for key, value in spent[method].items()},
                "misses": rate(int((hit & ~answer.hit).sum()), int(hit.sum())),
                "false_hits": rate(int((answer.hit & ~hit).sum()), int((~hit).sum())),
                "late": int((toi > first).sum()),
                "late_most": float((toi - first).max(initial=0)),
                "toi_error_most": float(np.abs(first - toi).max(initial=0)),
                "decided_exactly": answer.counts["exact"],
            }
        )
    rows.append(
        {
            "study": "query clear",
            "set": name,
            "kind": "vf" if queries.vertex else "ee",
            "n": len(clear.rows),
            "ab2pf_ns": {k: 1e9 * v / len(clear.rows) for k, v in spent["clear"].items()},
            "ab2pf_all_ns": 1e9 * spent["ab2pf"]["median"] / len(queries.rows),
        }
    )
    return rows


def _peers(
    ipctk: Any,
    name: str,
    mesh: Any,
    candidates: list[Any],
    queries: Queries,
    truth: Answer,
    rng: np.random.Generator,
    calls: int,
    ours: Row,
) -> list[Row]:
    own = ours["ab2pf_ns"]["median"]
    # Runs of neighbours in the list, whose positions lie close in memory as those of the whole do.
    starts = rng.permutation(len(candidates) // RUN)[: calls // RUN]
    asked = (RUN * np.sort(starts)[:, None] + np.arange(RUN)).ravel()
    rows: list[Row] = []
    for peer, method in {
        "AdditiveCCD": ipctk.AdditiveCCD(),
        "TightInclusionCCD": ipctk.TightInclusionCCD(conservative_rescaling=1.0),
    }.items():
        hit, toi, hit_us = _ask(method, queries.some(asked))
        timed = [candidates[i] for i in asked[~truth.hit[asked] & ~hit]]
        part = ipctk.Candidates()
        setattr(part, "fv_candidates" if queries.vertex else "ee_candidates", timed)
        step = [np.asfortranarray(x) for x in queries[1:3]]
        seconds = time_in_turn(
            {"": bound(part.compute_collision_free_stepsize, mesh, *step, 0.0, method)},
            3,
            process_time,
        )[""]["median"]
        ns = 1e9 * seconds / len(timed)
        # Hits, without what Python adds to a call: that of a clear one beyond its time above.
        added_us = max(0.0, float(np.median(hit_us[~hit])) - 1e-3 * ns)
        all_ns = (~hit).mean() * ns + 1e3 * np.maximum(hit_us[hit] - added_us, 0).sum() / len(asked)
        real = truth.hit[asked]
        both = real & hit
        early = truth.toi[asked][both] - toi[both]
        rows.append(
            {
                "study": "query peer",
                "set": name,
                "kind": ours["kind"],
                "peer": f"ipctk {peer}",
                "n": len(timed),
                "ns": ns,
                "ab2pf_ns": own,
                "speedup": ns / own,
                "all_ns": float(all_ns),
                "ab2pf_all_ns": ours["ab2pf_all_ns"],
                "speedup_all": float(all_ns) / ours["ab2pf_all_ns"],
                "queries": len(asked),
                "misses": rate(int((real & ~hit).sum()), int(real.sum())),
                "false_hits": rate(int((hit & ~real).sum()), int((~real).sum())),
                "toi_error_median": float(np.median(np.abs(early))) if both.any() else None,
                "late_most": float((-early).max(initial=0)),
                "us_a_hit": float(np.median(hit_us[both])) if both.any() else None,
            }
        )
    return rows


def _ask(method: Any, queries: Queries) -> tuple[NDArray[np.bool_], NDArray[np.float64], Any]:
    """A peer's answers and microseconds, call by call."""
    call = method.point_triangle_ccd if queries.vertex else method.edge_edge_ccd
    hit, toi, spent = [], [], []
    for row in queries.rows:
        points = [*queries.x_t0[row], *queries.x_t1[row]]
        start = process_time()
        answer = call(*points)
        spent.append(1e6 * (process_time() - start))
        hit.append(answer[0])
        toi.append(answer[1])
    return np.array(hit, dtype=bool), np.array(toi), np.array(spent)


def _hard_peers(
    name: str, kind: str, queries: Queries, truth: NDArray[np.bool_], calls: int
) -> list[Row]:
    ipctk = load_ipctk()
    if ipctk is None:
        return []
    few = np.arange(0, len(truth), 1 + len(truth) // calls)
    rows: list[Row] = []
    for peer, method in {
        "AdditiveCCD": ipctk.AdditiveCCD(),
        "TightInclusionCCD": ipctk.TightInclusionCCD(conservative_rescaling=1.0),
    }.items():
        hit, _, spent = _ask(method, queries.some(few))
        rows.append(
            {
                "study": "hard query",
                "set": name,
                "kind": kind,
                "method": f"ipctk {peer}",
                "n": len(few),
                "us": float(spent.mean()),
                "misses": int((truth[few] & ~hit).sum()),
                "false_hits": int((hit & ~truth[few]).sum()),
                "decided_exactly": 0,
            }
        )
    return rows
