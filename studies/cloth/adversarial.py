"""Queries near every degeneracy: ab2pf against an oracle in exact integers without common code.

The same queries are repeated scaled by powers of two, with their vertices in another order, and
backwards in time; no answer may change.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from oracles.adversarial_queries import KINDS, Positions
from oracles.mesh_contact import Verdict
from oracles.mesh_contact import judge as judge_times
from studies.cloth.queries import EARLY, Answer, Queries, solver
from studies.cloth.shared import run_row
from studies.framework import Workers, answer, table_rows
from tauguard.report import Row

#: Number of queries in a job.
CHUNK = 500

NOTES = {
    "adversarial": "every query is decided by integers in Python. misses, false_hits, late: errors "
    "of ab2pf; early_most: largest error of its other times, as a fraction of the step. "
    "exact_differs: hits of method exact that differ. decided_exactly: by ab2pf's exact "
    "arithmetic. scaled, turned, backwards: answers that change by 2^+-300, another order of "
    "vertices, time reversed."
}
CHANGES = ("scaled", "turned", "backwards")
ERRORS = ("misses", "false_hits", "late", "exact_differs")


def measure(quick: bool, seed: int) -> list[Row]:
    """Measure at least a million queries of either kind (quick: 3,000), evenly over the sets."""
    n = -(-(3_000 if quick else 1_000_000) // len(KINDS))
    rows: list[Row] = []
    with Workers() as run:
        for name, make in KINDS.items():
            for vertex in (True, False):
                x = make(np.random.default_rng([seed, len(rows)]), n, vertex)
                found, exact = _answer(x, vertex), _answer(x, vertex, "exact")
                jobs = [
                    (x[i : i + CHUNK], vertex, found.toi[i : i + CHUNK].copy())
                    for i in range(0, n, CHUNK)
                ]
                verdicts = list(run(_judge, jobs))
                rows.append(
                    {
                        "study": "adversarial",
                        "set": name,
                        "kind": "vf" if vertex else "ee",
                        "n": n,
                        "hits": int(sum(v.hit.sum() for v in verdicts)),
                        **{key: sum(getattr(v, key) for v in verdicts) for key in ERRORS[:3]},
                        "exact_differs": int(
                            (exact.hit != np.concatenate([v.hit for v in verdicts])).sum()
                        ),
                        "early_most": max(v.early_most for v in verdicts),
                        "decided_exactly": found.counts["exact"],
                        **_changes(x, vertex, found),
                    }
                )
    return [run_row(quick), *rows]


def _judge(job: tuple[Positions, bool, Any]) -> Verdict:
    return judge_times(*job)


def _answer(x: Positions, vertex: bool, method: str = "ab2pf") -> Answer:
    return solver(Queries.each(vertex, x), method)()


def _changes(x: Positions, vertex: bool, found: Answer) -> dict[str, int]:
    """Number of hits that change under transformations that must not change them."""

    def changed(other: Positions) -> int:
        return int((found.hit != _answer(other, vertex).hit).sum())

    order = [0, 3, 1, 2] if vertex else [3, 2, 0, 1]
    return {
        "scaled": sum(changed(np.ldexp(x, exponent)) for exponent in (-300, 300)),
        "turned": changed(x[:, :, order]),
        "backwards": changed(x[:, ::-1]),
    }


def judge(rows: Sequence[Row]) -> list[Row]:
    """Errors and changes over all sets, which must be 0."""
    own = table_rows(rows, "adversarial")
    n, most = sum(row["n"] for row in own), max(row["early_most"] for row in own)
    out = [answer("error of the time, most", "1e-9", f"{most:.2g}", most <= EARLY)]
    for key in (*ERRORS, *CHANGES):
        count = sum(row[key] for row in own)
        what = f"{n} adversarial queries: {key.replace('_', ' ')}"
        out.append(answer(what, "0", f"{count}", count == 0))
    return out
