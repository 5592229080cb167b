"""Table 2.1: elimination (ABFME) against separating axes on random convex bodies, beside coal.

The "cubes" of the published table are random parallelepipeds. *Static* means one pose, *dynamic* a
constant relative translation over t in [0, 1]. An entry of the published table is the factor by
which elimination is faster than separating axes. In the two entries of dynamic collisions (2.58 and
1.37), elimination is *slower* by this factor.

Textbook SAT tests all face normals, then all edge pairs. It projects every vertex, ends at the
first separating axis, and has no error bounds. Data layout, compiler flags and loop are the same
as for the other methods. Times are processor time of one thread.
"""

from functools import partial
from time import process_time

import numpy as np

from oracles.convex_bodies import HARD, KINDS
from oracles.convex_impact import sweep_errors
from oracles.convex_overlap import truth
from oracles.convex_pairs import pairs_by_outcome, shifted, take
from studies.framework import per, table_rows, time_in_turn
from studies.rigid import peer
from studies.rigid.bars import count, error, faster, within
from tauguard.report import Row, rate
from tauguard.rigid import PlaneCache
from tauguard.rigid.comparators import overlap_by
from tauguard.rigid.queries import native_sweep, portable
from tauguard.rigid.queries import overlap_boxes as overlap_boxes_native
from tauguard.rigid.shapes import Bodies, Boxes

#: Published static ratios of separating axes to elimination (collision, non-collision).
PUBLISHED = {
    ("parallelepipeds", "parallelepipeds"): (1.39, 2.01),
    ("parallelepipeds", "tetrahedra"): (2.44, 1.52),
    ("tetrahedra", "tetrahedra"): (4.17, 1.12),
}
PAIRS = [*PUBLISHED, ("boxes", "boxes"), ("boxes", "tetrahedra")]
METHODS = {"textbook": "sat_textbook", "sat": "sat", "abfme": "abfme", "auto": "auto"}
NOTES = {
    "table 2.1 static": "ns for a pair in one pose, one thread. coal_net: without loop and call; "
    "a_vs_b: time of b over time of a; published: the printed ratio; wrong: fraction of all "
    "pairs.",
    "table 2.1 dynamic": "ns per pair in translation; a_vs_b: time of b / time of a. In the "
    "published collision entries 2.58 and 1.37 elimination was slower, not faster, by this factor.",
    "batched box-box": "ns per pair; wrong: fraction of all pairs; exact_rows: pairs that exact "
    "arithmetic decided.",
    "coherent frames": "ns for a pair of slowly moving bodies, with separating planes cached "
    "from frame to frame and without.",
    "hard cases": "false_hit, false_clear: numbers of wrong answers; exact_share: fraction that "
    "exact arithmetic decided.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """Static and dynamic cells, batched boxes, coherent frames, hard cases, and the summary."""
    rng = np.random.default_rng(seed)
    per_cell, exact, coal_pairs = (10_000, 100, 500) if quick else (1_000_000, 10_000, 20_000)
    rows: list[Row] = []
    for pair in PAIRS:
        for outcome, a, b in pairs_by_outcome(rng, pair, per_cell, exact):
            rows.append(static_row(pair, outcome, a, b, coal_pairs))
    for pair in PUBLISHED:
        rows += dynamic_rows(rng, pair, per_cell // 5, exact // 4)
    rows.append(batch_row(rng, 200_000 if quick else 1_000_000))
    for kind in ("tetrahedra", "boxes"):
        rows.append(coherent_row(rng, kind, *((10_000, 4) if quick else (100_000, 20))))
    rows += [hard_row(name, rng, 500 if quick else 20_000) for name in HARD]
    return rows + summary(rows, quick)


def summary(rows: list[Row], quick: bool) -> list[Row]:
    """Wrong answers, and ratios of times: ABFME to textbook SAT, and ours to SAT and coal."""
    static, hard = table_rows(rows, "table 2.1 static"), table_rows(rows, "hard cases")
    found = []
    for method in ("abfme", "sat", "auto"):
        wrong = [count(row[f"{method}_wrong"]) for row in static]
        wrong += [row[f"{method}_{kind}"] for row in hard for kind in ("false_hit", "false_clear")]
        found.append(error(f"{method}: wrong answers of a cell or of a hard case", 0, wrong))
    for row in static:
        if row["published"]:
            question = f"abfme over textbook SAT, {row['pair']}, {row['outcome']} (published)"
            ratios = [row["abfme_vs_textbook"]]
            found.append(faster(question, row["published"], ratios, quick))
    batch = table_rows(rows, "batched box-box")[0]
    return [
        *found,
        faster("auto over tuned SAT, every cell", 1, [r["auto_vs_sat"] for r in static], quick),
        faster("auto over coal, every cell", 6, [r["auto_vs_coal_net"] for r in static], quick),
        within("batched boxes, ns a pair", 10, [batch["vectors_ns"]["median"]], quick),
        error("batched boxes: wrong answers", 0, [count(batch["wrong"])]),
    ]


def static_row(pair: tuple[str, str], outcome: str, a: Bodies, b: Bodies, coal_pairs: int) -> Row:
    """Times, ratios and errors of one cell of Table 2.1."""
    n, expected = len(a), outcome == "collision"
    _ = (a.packed, b.packed)
    calls = {name: partial(overlap_by, a, b, method) for name, method in METHODS.items()}
    ns = {name: per(t, n) for name, t in time_in_turn(calls, clock=process_time).items()}
    wrong = {
        name: int((overlap_by(a, b, method)[0] != expected).sum())
        for name, method in METHODS.items()
    }
    few = np.arange(min(n, coal_pairs))
    coal_hit, coal_ns, net = peer.overlap(take(a, few), take(b, few))
    published = PUBLISHED.get(pair)
    median = {name: value["median"] for name, value in ns.items()}
    return {
        "study": "table 2.1 static",
        "pair": "-".join(pair),
        "outcome": outcome,
        "pairs": n,
        **{f"{name}_ns": value for name, value in ns.items()},
        "coal_ns": coal_ns,
        "coal_net_ns": net,
        "abfme_vs_textbook": median["textbook"] / median["abfme"],
        "published": published[0 if expected else 1] if published else None,
        "auto_vs_sat": median["sat"] / median["auto"],
        "auto_vs_coal_net": net / median["auto"],
        **{f"{name}_wrong": rate(count, n) for name, count in wrong.items()},
        "coal_wrong": rate(int((coal_hit != expected).sum()), len(few)),
    }


def dynamic_rows(
    rng: np.random.Generator, pair: tuple[str, str], per_cell: int, exact_sample: int
) -> list[Row]:
    """Answers and times of swept bodies: elimination against axes cast along the motion."""
    a, b = KINDS[pair[0]](rng, 2 * per_cell), KINDS[pair[1]](rng, 2 * per_cell)
    d = rng.uniform(-1, 1, (2 * per_cell, 3))
    hit, out, _ = native_sweep(a, b, d, "abfme", points=False)
    disagree = int((native_sweep(a, b, d, "sat", points=False)[0] != hit).sum())
    late, wrong, error = sweep_errors(a, b, d, hit, out[:, 0], exact_sample)
    rows: list[Row] = []
    for expected in (True, False):
        index = np.flatnonzero(hit == expected)
        ca, cb, cd = take(a, index), take(b, index), d[index]
        _ = (ca.packed, cb.packed)
        calls = {
            name: partial(native_sweep, ca, cb, cd, name, points=False) for name in ("sat", "abfme")
        }
        ns = {name: per(t, len(index)) for name, t in time_in_turn(calls, 3, process_time).items()}
        rows.append(
            {
                "study": "table 2.1 dynamic",
                "pair": "-".join(pair),
                "outcome": "collision" if expected else "non-collision",
                "pairs": len(index),
                "sat_ns": ns["sat"],
                "abfme_ns": ns["abfme"],
                "abfme_vs_sat": ns["sat"]["median"] / ns["abfme"]["median"],
                "disagree": rate(disagree, len(d)),
                "wrong_of_sample": rate(wrong, exact_sample),
                "late_of_sample": rate(late, exact_sample),
                "toi_error_max": error,
            }
        )
    return rows


def batch_row(rng: np.random.Generator, n: int) -> Row:
    """Boxes in a batch: vector instructions against portable code, and the time of packing."""
    a, b = KINDS["boxes"](rng, n), KINDS["boxes"](rng, n)
    assert isinstance(a, Boxes)
    assert isinstance(b, Boxes)
    start = process_time()
    _ = (a.packed, a.blocks)
    packing = (process_time() - start) / n * 1e9
    hit = np.empty(n, dtype=np.uint8)
    one = partial(overlap_boxes_native, a, b, 1, hit)
    times = time_in_turn({"vectors": one}, clock=process_time)
    with portable():  # the code for machines without AVX2
        times |= time_in_turn({"portable": one}, clock=process_time)
    times |= time_in_turn({"two_threads": partial(overlap_boxes_native, a, b, 2, hit)})
    ns = {name: per(t, n) for name, t in times.items()}
    left = overlap_boxes_native(a, b, 1, hit)
    return {
        "study": "batched box-box",
        "pairs": n,
        **{f"{name}_ns": value for name, value in ns.items()},
        "packing_ns_per_box": packing,
        "wrong": rate(int((hit.view(np.bool_) != truth(a, b)).sum()), n),
        "exact_rows": left,
    }


def coherent_row(rng: np.random.Generator, kind: str, n: int, frames: int) -> Row:
    """Cached planes on slowly moving bodies, of which about one pair in eight is in contact."""
    a, b = KINDS[kind](rng, n), KINDS[kind](rng, n)
    velocity, offset = rng.normal(0, 0.01, (n, 3)), rng.uniform(-2, 2, (n, 3))
    cache = PlaneCache(n)
    seconds: dict[str, list[float]] = {"cached": [], "auto": [], "abfme": []}
    wrong = answered = clear = 0
    for frame in range(frames):
        moved = shifted(b, offset + frame * velocity)
        _ = (a.packed, moved.packed, getattr(moved, "blocks", None), getattr(a, "blocks", None))
        start = process_time()
        hit = cache.overlap(a, moved).hit
        seconds["cached"].append((process_time() - start) / n * 1e9)
        for method in ("auto", "abfme"):
            start = process_time()
            fresh, _ = overlap_by(a, moved, method)
            seconds[method].append((process_time() - start) / n * 1e9)
        wrong += int((hit != fresh).sum())
        if frame:
            answered += cache.answered
            clear += int((~hit).sum())
    return {
        "study": "coherent frames",
        "pair": f"{kind}-{kind}",
        "pairs": n,
        "hits": float(hit.mean()),
        **{
            f"{name}_ns": {"median": float(np.median(t[1:])), "low": min(t), "high": max(t)}
            for name, t in seconds.items()
        },
        "answered_by_cache": rate(answered, clear),
        "differs_from_fresh": rate(wrong, n * frames),
    }


def hard_row(name: str, rng: np.random.Generator, n: int) -> Row:
    """Wrong answers of one hard case, and the fraction that needs exact arithmetic."""
    a, b = HARD[name](rng, n)
    expected = truth(a, b)
    row: Row = {"study": "hard cases", "case": name, "pairs": n, "hits": float(expected.mean())}
    for label, method in METHODS.items():
        start = process_time()
        hit, left = overlap_by(a, b, method)
        row[f"{label}_ns"] = (process_time() - start) / n * 1e9
        row[f"{label}_false_hit"] = int((hit & ~expected).sum())
        row[f"{label}_false_clear"] = int((~hit & expected).sum())
        if label == "abfme":
            row["exact_share"] = left / n
    return row
