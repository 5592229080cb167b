"""Answers of ab2pf before referees that share no code with it, nor with each other.

Integers (:mod:`.cloth_integers`) decide every query, and the time of every hit. Floating-point
numbers with bounded errors (:mod:`.cloth_certificate`) certify what they can, which is held against
the integers. Tight-Inclusion (Wang et al. 2021, in ipctk; conservative) is asked to confirm what
these call clear; on other queries it may take gigabytes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from oracles.mesh_contact import HALVINGS, first_contact
from studies.cloth.certificate import certify
from studies.cloth.peer import load_ipctk
from studies.cloth.queries import HARD_SETS, load_hard, solver
from tauguard.report import Row

Map = Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[Any]]

#: Queries of a job of one process.
CHUNK = 500
#: Boxes that Tight-Inclusion may look at, a query; what it has not cleared by then stays open.
BOXES = 1000


class Job(NamedTuple):
    """Queries of one kind and the answers to be judged: positions (N, 2, 4, 3), others (N,)."""

    x: NDArray[np.float64]
    vertex: bool
    toi: NDArray[np.float64]  # inf where there is said to be no contact
    labels: NDArray[np.bool_] | None = None  # contact or none, told with the queries

    def some(self, part: slice) -> Job:
        """A part of the queries."""
        labels = None if self.labels is None else self.labels[part]
        return Job(self.x[part], self.vertex, self.toi[part], labels)


def judged(job: Job, run: Map) -> Row:
    """Counts over all queries, by the processes of ``run``.

    Integers decide all ``n``. ``clear_certified`` and ``hit_certified`` count what intervals tell
    with certainty, ``clear_tight`` what Tight-Inclusion confirms of the former, ``integers_only``
    the rest, ``contradictions`` the queries on which referees differ, ``labels_differ`` those that
    are labelled otherwise. ``misses``, ``false_hits`` and ``late`` are the answers' errors;
    ``early_most`` is the largest error of a time that is not late; ``seconds`` are the processor's.
    """
    parts = [job.some(slice(i, i + CHUNK)) for i in range(0, len(job.x), CHUNK)]
    total: Counter[str] = Counter()
    early = seconds = 0.0
    for counts, most, spent in run(_judge, parts):
        total.update(counts)
        early, seconds = max(early, most), seconds + spent
    row: Row = {name: total[name] for name in _COUNTED}
    if job.labels is not None or _tight_inclusion() is None:
        row["clear_tight"] = None
    if job.labels is None:
        row["labels_differ"] = None
    return {**row, "early_most": early, "seconds": seconds}


def on_labels(folder: Path, run: Map) -> list[Row]:
    """The public hard queries: their labels, of exact algebra, are the third opinion here.

    Tight-Inclusion takes seconds for one of these, whatever its most iterations.
    """
    rows: list[Row] = []
    for name in HARD_SETS:
        for kind in ("vertex-face", "edge-edge"):
            queries, labels = load_hard(folder / name / kind)
            x = np.stack([queries.x_t0[queries.rows], queries.x_t1[queries.rows]], axis=1)
            job = Job(x, queries.vertex, solver(queries, "ab2pf")().toi, labels)
            here = {"set": name, "kind": "vf" if queries.vertex else "ee"}
            rows.append({"study": "independent check", **here, **judged(job, run)})
    return rows


_COUNTED = (
    "n", "hits", "clear_certified", "hit_certified", "clear_tight", "integers_only",
    "contradictions", "labels_differ", "misses", "false_hits", "late",
)  # fmt: skip


def _judge(job: Job) -> tuple[dict[str, int], float, float]:
    start = process_time()
    certificate = certify(job.x, job.vertex)
    tight = _confirmed(job, certificate.clear & (job.labels is None))
    times = [first_contact(x[0], x[1], job.vertex) for x in job.x]
    touch = np.array([time is not None for time in times])
    begins = np.array([np.nan if time is None else float(time[0]) for time in times])
    said = np.isfinite(job.toi)
    errors = [_error(job, i, time) for i, time in enumerate(times) if time is not None and said[i]]
    contradicted = (certificate.clear & touch) | (certificate.hit & ~(begins <= certificate.by))
    counts = {
        "n": len(touch),
        "hits": int(touch.sum()),
        "clear_certified": int(certificate.clear.sum()),
        "hit_certified": int(certificate.hit.sum()),
        "clear_tight": int(tight.sum()),
        "integers_only": int((~certificate.clear & ~certificate.hit).sum()),
        "contradictions": int(contradicted.sum()),
        "labels_differ": 0 if job.labels is None else int((job.labels != touch).sum()),
        "misses": int((touch & ~said).sum()),
        "false_hits": int((said & ~touch).sum()),
        "late": sum(error < 0 for error in errors),
    }
    return counts, float(max(errors, default=0)), process_time() - start


def _error(job: Job, i: int, time: tuple[Fraction, Fraction]) -> Fraction:
    """Exact first time minus the one answered: below 0 where that is late."""
    answered, halvings = Fraction(float(job.toi[i])), HALVINGS
    low, high = time
    while low < answered <= high and low < high:
        halvings *= 2
        closer = first_contact(job.x[i, 0], job.x[i, 1], job.vertex, halvings)
        assert closer is not None
        low, high = closer
    return low - answered if answered <= low else high - answered


def _tight_inclusion() -> Any:
    ipctk = load_ipctk()
    if ipctk is None:
        return None
    return ipctk.TightInclusionCCD(max_iterations=BOXES, conservative_rescaling=1.0)


def _confirmed(job: Job, clear: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Of the queries chosen those that Tight-Inclusion calls clear."""
    confirmed = np.zeros(len(clear), dtype=bool)
    tight = _tight_inclusion()
    if tight is not None:
        call = tight.point_triangle_ccd if job.vertex else tight.edge_edge_ccd
        for i in np.flatnonzero(clear):
            confirmed[i] = not call(*job.x[i, 0], *job.x[i, 1])[0]
    return confirmed
