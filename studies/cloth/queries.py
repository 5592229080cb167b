"""Single queries: time, misses, false hits and errors in time, also for ipctk.

Times are processor times of one thread. One call answers the whole list and gathers its positions.
ipctk is timed on candidates without contact, by ``compute_collision_free_stepsize``, because a hit
would shorten the step for the candidates after it. The results of ipctk, and its time of a hit, are
from one call in Python per query.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from oracles.recorded_collisions import KINDS, QUERY_SETS, load_frame, load_queries
from studies.cloth import shared
from studies.cloth.shared import Step, narrow_phases
from studies.framework import answer, groups, per, table_rows, time_in_turn, timed
from tauguard.cloth import MeshCCD
from tauguard.cloth.comparators import METHODS, solve
from tauguard.cloth.scenes import SCENES
from tauguard.report import Row, rate

#: Number of neighbouring candidates that a peer answers in a row.
RUN = 100
#: Targets of the ratio of times, peer / ab2pf, for a query without contact.
ASKED = {"ipctk AdditiveCCD": 10, "ipctk TightInclusionCCD": 100}
EARLY = 1e-9  #: target of the largest error of a time of impact [step]

NOTES = {
    "query": "candidates of ipctk's broad phase on one frame (n of them). ns: time of a query. "
    "misses, false_hits: differences from ab2pf, whose hits on recorded frames equal the listed "
    "ones. late: number of times of impact after the exact one; toi_error_most: largest error of "
    "the time, as a fraction of the step.",
    "query peer": "ns, ab2pf_ns: time of a query without contact; all_ns: time in the mix with "
    "hits. misses, false_hits and errors are of the queries asked one by one from Python; "
    "us_a_hit: time of a hit.",
    "hard query": "n public queries with exact labels. us: a query; decided_exactly: by exact "
    "arithmetic.",
}


class Queries(NamedTuple):
    """Queries of one kind on shared positions."""

    vertex: bool
    x_t0: NDArray[np.float64]
    x_t1: NDArray[np.float64]
    rows: NDArray[np.int32]

    def some(self, which: NDArray[Any]) -> Queries:
        """The queries that a mask or indices choose."""
        return self._replace(rows=np.ascontiguousarray(self.rows[which]))

    @classmethod
    def each(cls, vertex: bool, x: NDArray[np.float64]) -> Queries:
        """Queries without common positions, from ``x`` of shape (N, 2, 4, 3)."""
        start, end = (np.ascontiguousarray(x[:, i]).reshape(-1, 3) for i in (0, 1))
        return cls(vertex, start, end, np.arange(4 * len(x), dtype=np.int32).reshape(-1, 4))


class Answer(NamedTuple):
    """Hits, times of impact, and counts of the narrow phase."""

    hit: NDArray[np.bool_]
    toi: NDArray[np.float64]
    counts: dict[str, int]


def solver(queries: Queries, method: str = "ab2pf") -> Callable[[], Answer]:
    """A function that answers all queries, with arrays allocated beforehand."""
    n = len(queries.rows)
    hit, toi = np.zeros(n, dtype=np.uint8), np.full(n, np.inf)
    point, normal, weights = (np.empty((n, k)) for k in (3, 3, 4))

    def call() -> Answer:
        counts = solve(*queries, method, hit, toi, point, normal, weights)
        return Answer(hit.astype(bool), toi, counts)

    return call


def measure(quick: bool, seed: int) -> list[Row]:
    """Measure candidates of a frame (cloth-ball in a full run with data), then labelled queries."""
    data = shared.recorded()
    rows, size = [shared.run_row(quick, recorded=data is not None)], 2_000 if quick else 40_000
    if data is not None and not quick:
        name, frame = "cloth-ball", load_frame(data, "cloth-ball")
        faces, step = frame.faces, (frame.x_t0, frame.x_t1)
    else:
        scene = SCENES["crumpling"](size, seed)
        name, faces, step = scene.name, scene.faces, shared.step_at(scene, 0.85)
    rows += _on_frame(name, faces, step, seed, *((2_000, 3) if quick else (20_000, 7)))
    return rows + (_on_labelled(data, 10 if quick else 60) if data is not None else [])


def _on_frame(
    name: str, faces: NDArray[np.int32], step: Step, seed: int, calls: int, repeats: int
) -> list[Row]:
    """Rows of methods and peers on ipctk's candidates; peers answer ``calls`` per kind."""
    ipctk = shared.load_ipctk()
    if ipctk is None:
        return [{"study": "query", "set": name, "peer": "ipctk is not installed"}]
    edges = MeshCCD(faces).edges
    mesh = ipctk.CollisionMesh(np.asfortranarray(step[0]), edges, faces)
    found = ipctk.Candidates()
    found.build(mesh, *map(np.asfortranarray, step), 0.0, ipctk.LBVH())
    rng, rows = np.random.default_rng(seed), []
    lists = {"vf": found.fv_candidates, "ee": found.ee_candidates}  # each call copies the list
    for kind, candidates in lists.items():
        if kind == "vf":
            ids = np.array([(c.vertex_id, c.face_id) for c in candidates])
            corners = np.concatenate([ids[:, :1], faces[ids[:, 1]]], axis=1)
        else:
            ids = np.array([(c.edge0_id, c.edge1_id) for c in candidates])
            corners = edges[ids].reshape(-1, 4)
        queries = Queries(kind == "vf", *step, np.ascontiguousarray(corners, dtype=np.int32))
        reference, here = solver(queries)(), {"set": name, "kind": kind}
        own, clear_ns = _methods(here, queries, reference, repeats)
        ours = {"ab2pf_ns": clear_ns, "ab2pf_all_ns": own[0]["ns"]["median"]}
        starts = RUN * np.sort(rng.permutation(len(candidates) // RUN)[: calls // RUN])
        asked = (starts[:, None] + np.arange(RUN)).ravel()
        rows += own
        rows += _peers(ipctk, mesh, candidates, asked, queries, reference, {**here, **ours})
    return rows + _both_kinds(rows, {kind: len(every) for kind, every in lists.items()})


def _methods(
    here: Row, queries: Queries, reference: Answer, repeats: int
) -> tuple[list[Row], float]:
    """A row for each method, and ab2pf's time for a query without contact [ns]."""
    few = np.arange(0, len(queries.rows), 1 + len(queries.rows) // 2000)
    lists = {method: queries.some(few) if method == "exact" else queries for method in METHODS}
    calls = {method: solver(lists[method], method) for method in METHODS}
    clear = queries.some(~reference.hit)
    times = time_in_turn(calls | {"clear": solver(clear)}, repeats, process_time)
    exact = solver(queries.some(reference.hit), "exact")()
    rows: list[Row] = []
    for method, call in calls.items():
        found, n = call(), len(lists[method].rows)
        hit = reference.hit[few] if method == "exact" else reference.hit
        toi = found.toi[hit & found.hit]
        first = exact.toi[found.hit[hit]] if method != "exact" else toi
        rows.append(
            {
                "study": "query",
                **here,
                "method": method,
                "n": n,
                "of": len(queries.rows),
                "ns": per(times[method], n),
                "misses": rate(int((hit & ~found.hit).sum()), int(hit.sum())),
                "false_hits": rate(int((found.hit & ~hit).sum()), int((~hit).sum())),
                "late": int((toi > first).sum()),
                "toi_error_most": float(np.abs(first - toi).max(initial=0)),
                "decided_exactly": found.counts["exact"],
            }
        )
    return rows, 1e9 * times["clear"]["median"] / len(clear.rows)


def _peers(
    ipctk: Any,
    mesh: Any,
    candidates: list[Any],
    asked: NDArray[np.int64],
    queries: Queries,
    reference: Answer,
    ours: Row,
) -> list[Row]:
    rows: list[Row] = []
    step = [np.asfortranarray(x) for x in queries[1:3]]
    for peer, method in narrow_phases(ipctk).items():
        hit, toi, call_us = _ask(method, queries.some(asked))
        clear = [candidates[i] for i in asked[~reference.hit[asked] & ~hit]]
        part = ipctk.Candidates()
        setattr(part, "fv_candidates" if queries.vertex else "ee_candidates", clear)
        call = partial(part.compute_collision_free_stepsize, mesh, *step, 0.0, method)
        ns = 1e9 * time_in_turn({"": call}, 3, process_time)[""]["median"] / len(clear)
        # Overhead of a Python call: time of a query without contact minus its time in the C++ loop.
        hit_us = np.maximum(call_us[hit] - max(0.0, float(np.median(call_us[~hit])) - ns / 1e3), 0)
        all_ns = float((~hit).mean() * ns + 1e3 * hit_us.sum() / len(asked))
        real = reference.hit[asked]
        early = reference.toi[asked][real & hit] - toi[real & hit]
        rows.append(
            {
                "study": "query peer",
                **ours,
                "peer": f"ipctk {peer}",
                "n": len(clear),
                "ns": ns,
                "all_ns": all_ns,
                "queries": len(asked),
                "misses": rate(int((real & ~hit).sum()), int(real.sum())),
                "false_hits": rate(int((hit & ~real).sum()), int((~real).sum())),
                "toi_error_median": float(np.median(np.abs(early))) if len(early) else 0.0,
                "late_most": float((-early).max(initial=0)),
                "us_a_hit": float(np.median(call_us[real & hit])) if len(early) else None,
            }
        )
    return rows


def _both_kinds(rows: list[Row], counts: dict[str, int]) -> list[Row]:
    """Mean times per query over both kinds, weighted by their numbers of candidates."""
    found: list[Row] = []
    for peer, own in groups(table_rows(rows, "query peer"), lambda row: str(row["peer"])).items():
        mean = {
            key: sum(counts[row["kind"]] * row[key] for row in own) / sum(counts.values())
            for key in ("ns", "ab2pf_ns", "all_ns", "ab2pf_all_ns")
        }
        mixed = {"study": "query peer", "set": own[0]["set"], "kind": "both", "peer": peer}
        found.append({**mixed, "n": sum(row["n"] for row in own), **mean})
    return found


def _ask(method: Any, queries: Queries) -> tuple[NDArray[np.bool_], NDArray[np.float64], Any]:
    """A peer's hits, times of impact and microseconds, call by call."""
    call = method.point_triangle_ccd if queries.vertex else method.edge_edge_ccd
    answers, spent = [], []
    for row in queries.rows:
        points = [*queries.x_t0[row], *queries.x_t1[row]]
        start = process_time()
        answers.append(call(*points)[:2])
        spent.append(1e6 * (process_time() - start))
    hit, toi = zip(*answers, strict=True)
    return np.array(hit, dtype=bool), np.array(toi), np.array(spent)


def _on_labelled(data: Path, calls: int) -> list[Row]:
    """Compare every method, and ``calls`` queries of each peer, with public labels."""
    rows: list[Row] = []
    ipctk = shared.load_ipctk()
    peers = narrow_phases(ipctk) if ipctk is not None else {}
    for name, kind in product(QUERY_SETS, KINDS):
        x, label = load_queries(data / "ccd" / name / kind)
        queries, few = Queries.each(kind == KINDS[0], x), np.arange(0, len(x), 1 + len(x) // calls)

        here: Row = {"study": "hard query", "set": name, "kind": kind}
        for method in METHODS:
            call = solver(queries, method)
            time, own = time_in_turn({"": call}, 1, process_time)[""], call()
            us = 1e6 * time["median"] / len(x)
            rows.append(here | {"method": method, "us": us} | _wrong(label, own.hit))
            rows[-1]["decided_exactly"] = own.counts["exact"]
        for peer, one in peers.items():
            hit, _, spent = _ask(one, queries.some(few))
            us = float(spent.mean())
            rows.append(here | {"method": f"ipctk {peer}", "us": us} | _wrong(label[few], hit))
            rows[-1]["decided_exactly"] = None
    return rows


def _wrong(true: NDArray[np.bool_], hit: NDArray[np.bool_]) -> Row:
    wrong = int((true & ~hit).sum()), int((hit & ~true).sum())
    return {"n": len(true), "misses": wrong[0], "false_hits": wrong[1]}


def judge(rows: Sequence[Row]) -> list[Row]:
    """Errors, and ratios of times beside their targets."""
    out, quick = [], shared.is_quick(rows)
    own = [row for row in table_rows(rows, "query") if row.get("method") == "ab2pf"]
    if own:
        most = max(row["toi_error_most"] for row in own)
        out.append(answer("error of the time, most", "1e-9", f"{most:.2g}", most <= EARLY))
    labelled = [row for row in table_rows(rows, "hard query") if row["method"] == "ab2pf"]
    if labelled:
        wrong = sum(row["misses"] + row["false_hits"] for row in labelled)
        n = sum(row["n"] for row in labelled)
        out.append(
            answer(f"{n} labelled queries: misses and false hits", "0", f"{wrong}", not wrong)
        )
    for row in table_rows(rows, "query peer"):
        asked = ASKED[row["peer"]]
        ratio = row["ns"] / row["ab2pf_ns"]
        text = f"{ratio:.3g} ({row['ns']:.3g} over {row['ab2pf_ns']:.3g} ns)"
        what = f"a clear query of {row['set']}, {row['kind']}: {row['peer']} over ab2pf"
        out.append(answer(what, f"{asked}", text, timed(ratio >= asked, quick)))
    return out
