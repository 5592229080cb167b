"""Queries made to break a narrow phase: ab2pf against exact arithmetic, query by query.

``method="exact"`` decides every one of them, and so do referees that share no code with it
(:mod:`.cloth_check`). The same queries come again scaled by powers of two, with their vertices
in another order, backwards in time and under other rounding modes.
"""

from __future__ import annotations

import ctypes
import platform
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from studies.cloth.check import Job, judged
from studies.cloth.queries import Answer, Queries, solver
from studies.framework import Workers
from tauguard.report import Row

Positions = NDArray[np.float64]  # (n, 2, 4, 3): both ends of the step, four vertices
Make = Callable[[np.random.Generator, int, bool], Positions]

#: fesetround's numbers on x86-64: down, up, towards zero.
_MODES = (0x400, 0x800, 0xC00)


def _random(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    return rng.normal(size=(n, 2, 4, 3))


def _lattice(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    """Small integers: touching, coplanar, parallel, without area or length."""
    return rng.integers(-2, 3, size=(n, 2, 4, 3)).astype(float)


def _rounded_lattice(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    return _lattice(rng, n, vertex) / 3


def _flat(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    """All in one plane, always: the cubic is zero throughout."""
    return np.asarray(_random(rng, n, vertex) * np.array([1, 1, 0]))


def _tilted(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    """In one plane but for rounding."""
    axes, _ = np.linalg.qr(rng.normal(size=(n, 1, 3, 3)))
    return np.asarray(_flat(rng, n, vertex) @ axes)


def _touching(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    """Made to touch at a random time on the boundary of both features, then rounded."""
    x = _random(rng, n, vertex)
    t = rng.random((n, 1))
    w = rng.random((n, 2)) * rng.integers(0, 2, size=(n, 2))
    now = (1 - t[..., None]) * x[:, 0] + t[..., None] * x[:, 1]
    if vertex:
        point = now[:, 1] + w[:, :1] * (now[:, 2] - now[:, 1])
    else:
        other = now[:, 2] + w[:, 1:] * (now[:, 3] - now[:, 2])
        point = (other - w[:, :1] * now[:, 1]) / (1 - w[:, :1])
    x[:, 1, 0] = (point - (1 - t) * x[:, 0, 0]) / t
    return x


def _parallel(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    """Parallel edges, or a face without area, that move."""
    x = _random(rng, n, vertex)
    x[:, :, 3] = x[:, :, 2] + rng.normal(size=(n, 1, 1)) * (x[:, :, 1] - x[:, :, 0])
    if vertex:
        x[:, :, 3] = x[:, :, 1] + rng.normal(size=(n, 1, 1)) * (x[:, :, 2] - x[:, :, 1])
    x[::2] *= np.array([1, 1, 0])  # in one plane, where they can meet
    return x


def _still(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    """No motion, touching or not."""
    x = rng.integers(-2, 3, size=(n, 2, 4, 3)).astype(float)
    x[:, 1] = x[:, 0]
    return x


def _slow(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    """Touching or not, then hardly moving."""
    x = _still(rng, n, vertex)
    x[:, 1] += 10.0 ** rng.integers(-14, -1, size=(n, 1, 1)) * rng.normal(size=(n, 4, 3))
    return x


def _thin(rng: np.random.Generator, n: int, vertex: bool) -> Positions:
    return np.asarray(_random(rng, n, vertex) * np.array([1, 1, 1e-9]))


def _far(offset: float) -> Make:
    return lambda rng, n, vertex: _random(rng, n, vertex) + offset


KINDS: dict[str, Make] = {
    "random": _random,
    "lattice": _lattice,
    "lattice / 3": _rounded_lattice,
    "flat": _flat,
    "flat, tilted": _tilted,
    "touching": _touching,
    "parallel": _parallel,
    "still": _still,
    "slow": _slow,
    "thin": _thin,
    "offset 1e6": _far(1e6),
    "offset 1e10": _far(1e10),
}


def adversarial(total: int, seed: int) -> list[Row]:
    """At least ``total`` queries of either kind, spread evenly over :data:`KINDS`."""
    n = -(-total // len(KINDS))
    rows: list[Row] = []
    checked: list[Row] = []
    with Workers() as run:
        for name, make in KINDS.items():
            for vertex in (True, False):
                x = make(np.random.default_rng([seed, len(rows)]), n, vertex)
                ours = _answer(x, vertex)
                here = {"set": name, "kind": "vf" if vertex else "ee"}
                rows.append({"study": "adversarial", **here, **_row(x, vertex, ours)})
                found = judged(Job(x, vertex, ours.toi), run)
                checked.append({"study": "independent check", **here, **found})
    return [*_with_sums(rows), *_with_sums(checked)]


def _with_sums(rows: list[Row]) -> list[Row]:
    """The rows, and one a kind for all sets: sums, and the largest of ``early_most``."""
    added: list[Row] = []
    for kind in ("vf", "ee"):
        own = [row for row in rows if row["kind"] == kind]
        most = max(row["early_most"] for row in own)
        sums = {
            key: sum(row[key] for row in own)
            for key, value in own[0].items()
            if isinstance(value, int | float)
        }
        added.append({**own[0], "set": "all", **sums, "early_most": most})
    return rows + added


def _row(x: Positions, vertex: bool, ours: Answer) -> Row:
    exact = _answer(x, vertex, "exact")
    early = exact.toi[ours.hit & exact.hit] - ours.toi[ours.hit & exact.hit]
    order = [0, 3, 1, 2] if vertex else [3, 2, 0, 1]
    return {
        "n": len(x),
        "hits": int(exact.hit.sum()),
        "misses": int((exact.hit & ~ours.hit).sum()),
        "false_hits": int((ours.hit & ~exact.hit).sum()),
        "late": int((early < 0).sum()),
        "early_most": float(early.max(initial=0)),
        "decided_exactly": ours.counts["exact"],
        # Answers that change: by 2^+-300, another order of the vertices, time reversed, rounding.
        "scaled": sum(_differ(ours, _answer(np.ldexp(x, e), vertex)) for e in (-300, 300)),
        "turned": _differ(ours, _answer(x[:, :, order], vertex)),
        "backwards": _differ(ours, _answer(x[:, ::-1], vertex)),
        "modes": _under_other_modes(x, vertex, ours),
    }


def _answer(x: Positions, vertex: bool, method: str = "ab2pf") -> Answer:
    start, end = (np.ascontiguousarray(x[:, i]).reshape(-1, 3) for i in (0, 1))
    rows = np.arange(len(start), dtype=np.int32).reshape(-1, 4)
    return solver(Queries(vertex, start, end, rows), method)()


def _differ(a: Answer, b: Answer) -> int:
    return int((a.hit != b.hit).sum())


def _under_other_modes(x: Positions, vertex: bool, ours: Answer) -> int:
    """Answers, times included, that change under a rounding mode of the caller's; or one lost."""
    if platform.machine() != "x86_64":
        return 0
    libc = ctypes.CDLL(None)
    changed = 0
    for mode in _MODES:
        libc.fesetround(mode)
        try:
            answer = _answer(x, vertex)
            kept = libc.fegetround() == mode
        finally:
            libc.fesetround(0)
        changed += int((answer.toi != ours.toi).sum()) + (not kept)
    return changed
