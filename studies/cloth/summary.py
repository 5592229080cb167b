"""The closing summary of the cloth bench: each figure asked for beside the one measured."""

from __future__ import annotations

from studies.framework import answer, timed
from tauguard.report import Row

#: Times that a whole frame, and a query, of a peer or comparator is asked to take of ab2pf's.
FRAME_MEANS = {"iccd": 2.3, "vcd": 1.34}
PEERS = {"ipctk AdditiveCCD": 10, "ipctk TightInclusionCCD": 100}
FRAME_PEER = ("ipctk LBVH + AdditiveCCD", 10)
#: Of a mean that is asked over all scenes, where the recorded ones are not among the rows.
ABSENT = "not judged: data absent"


def summary(rows: list[Row], quick: bool, recorded: bool = True) -> list[Row]:
    """One row a figure, from the rows of the other studies.

    Args:
        rows: Of all other studies of the run.
        quick: Times can meet their bars, but not miss them.
        recorded: The public scenes and queries are among the rows. Without them figures that are
            of these alone are left out, and a mean over all scenes is not judged.
    """
    frames = _frames(rows, quick, recorded)
    return [*_errors(rows), *_queries(rows, quick), *frames, *_growth(rows)]


def _of(rows: list[Row], study: str) -> list[Row]:
    return [row for row in rows if row["study"] == study]


def _errors(rows: list[Row]) -> list[Row]:
    found: list[Row] = []
    whole = [row for row in _of(rows, "query") if row.get("method") == "ab2pf"]
    for row in _of(rows, "truth"):
        for key in ("misses", "false_hits"):
            if row["method"] == "ab2pf":
                what = f"{row['scene']}, against the listed hits: {key.replace('_', ' ')}"
                found.append(answer(what, "0", str(row[key]), row[key] == 0))
    hard = [row for row in _of(rows, "hard query") if row["method"] == "ab2pf"]
    made = [row for row in _of(rows, "adversarial") if row["set"] == "all"]
    for name, part in (("hard sets", hard), ("adversarial", made)):
        for key in ("misses", "false_hits", "late"):
            if not part or key not in part[0]:
                continue
            count, n = sum(row[key] for row in part), sum(row["n"] for row in part)
            what = f"{name}, {n} queries: {key.replace('_', ' ')}"
            found.append(answer(what, "0", str(count), count == 0))
    changes = ("scaled", "turned", "backwards", "modes")
    if made:
        count = sum(row[key] for row in made for key in changes)
        what = f"adversarial: answers changed by {', '.join(changes)}"
        found.append(answer(what, "0", str(count), count == 0))
    # A set of made queries is in the row "all"; the labelled sets stand for themselves.
    checked = [
        row
        for row in _of(rows, "independent check")
        if row["set"] == "all" or row["labels_differ"] is not None
    ]
    found += _checked(checked)
    errors = [row["toi_error_most"] for row in whole]
    errors += [row["early_most"] for row in made + checked]
    if errors:
        most = max(errors)
        found.append(answer("error of the time, most", "1e-9", f"{most:.2g}", most <= 1e-9))
    if hard:
        price = sum(row["us"] * row["n"] for row in hard) / sum(row["n"] for row in hard)
        found.append(
            answer("hard sets, exact decisions included [us a query]", "-", f"{price:.2g}")
        )
    return found


def _checked(rows: list[Row]) -> list[Row]:
    """What referees that share no code with ab2pf found."""
    found: list[Row] = []
    n = sum(row["n"] for row in rows)
    errors = ("contradictions", "labels_differ", "misses", "false_hits", "late")
    for key in errors if rows else ():
        count = sum(row[key] or 0 for row in rows)
        what = f"certified by independent check, {n} queries: {key.replace('_', ' ')}"
        found.append(answer(what, "0", str(count), count == 0))
    for row in (row for row in rows if row["set"] == "all"):
        sure = row["clear_certified"] + row["hit_certified"]
        tight = row["clear_tight"]
        text = f"{sure / row['n']:.1%} by intervals"
        text += "" if tight is None else f", {tight / row['n']:.1%} by Tight-Inclusion too"
        found.append(answer(f"certified, {row['kind']}, beside all by integers", "-", text))
    return found


def _queries(rows: list[Row], quick: bool) -> list[Row]:
    found: list[Row] = []
    for row in _of(rows, "query peer"):
        if "speedup" not in row:
            continue
        bar = PEERS[row["peer"]]
        what = f"a clear query of {row['set']}, {row['kind']}: {row['peer']} over ab2pf"
        text = f"{row['speedup']:.3g} ({row['ns']:.3g} over {row['ab2pf_ns']:.3g} ns)"
        found.append(answer(what, f"{bar}", text, timed(row["speedup"] >= bar, quick)))
        if row["kind"] == "both":
            what = f"any query of {row['set']}, hits included: {row['peer']} over ab2pf"
            text = (
                f"{row['speedup_all']:.3g} ({row['all_ns']:.3g} over {row['ab2pf_all_ns']:.3g} ns)"
            )
            found.append(answer(what, "-", text))
    return found


def _frames(rows: list[Row], quick: bool, recorded: bool) -> list[Row]:
    found: list[Row] = []
    for row in _of(rows, "frame peer"):
        if row["scene"] == "cloth-ball" and row["peer"] == FRAME_PEER[0] and "speedup" in row:
            what = f"a frame of cloth-ball: {row['peer']} over ab2pf"
            ours = row["ab2pf_ms"]["median"]
            text = f"{row['speedup']:.3g} ({row['peer_ms']:.3g} over {ours:.3g} ms)"
            met = timed(row["speedup"] >= FRAME_PEER[1], quick)
            found.append(answer(what, f"{FRAME_PEER[1]}", text, met))
            own = _frame_ms(rows, "iccd")
            if own is not None:
                text = f"{own / row['peer_ms']:.2g}"
                what = "a frame of cloth-ball: iccd over LBVH + AdditiveCCD"
                met = timed(own <= 0.5 * row["peer_ms"], quick)
                found.append(answer(what, "at most 0.5", text, met))
    for row in _of(rows, "frame mean"):
        bar = FRAME_MEANS.get(row["method"])
        if bar is None:
            continue
        what = f"a frame, mean of {row['scenes']} scenes: {row['method']} over ab2pf, "
        text = (
            f"{row['times_ab2pf_mean']:.3g} "
            f"({row['times_ab2pf_least']:.3g} to {row['times_ab2pf_most']:.3g})"
        )
        if row["volume"] == "k_dop18":
            met = timed(row["times_ab2pf_mean"] >= bar, quick) if recorded else ABSENT
            found.append(answer(what + "each on its own volume", f"{bar}", text, met))
        else:
            found.append(answer(what + f"both on {row['volume']}", "-", text))
    return found


def _frame_ms(rows: list[Row], method: str) -> float | None:
    for row in _of(rows, "frame"):
        if (row["scene"], row["method"], row["volume"]) == ("cloth-ball", method, "k_dop18"):
            return float(row["frame_ms"]["median"])
    return None


def _growth(rows: list[Row]) -> list[Row]:
    found: list[Row] = []
    size = _of(rows, "size")
    exponents = [row["exponent"] for row in size if row["exponent"] is not None]
    if exponents:
        low, high = min(row["triangles"] for row in size), max(row["triangles"] for row in size)
        what = f"a frame's time, {low} to {high} triangles: exponent"
        found.append(answer(what, "-", f"{min(exponents):.2f} to {max(exponents):.2f}"))
        most = max(row["bytes_per_triangle"] for row in size)
        found.append(answer("bytes a triangle, most", "-", f"{most:.0f}"))
    for study, key, what in (
        ("front", "descent_saved", "descent saved by the front"),
        ("front", "node_tests_saved", "node tests saved by the front"),
        ("threads", "speedup", "two threads against one"),
    ):
        values = [row[key] for row in _of(rows, study) if key in row]
        if values:
            found.append(answer(what, "-", f"{min(values):.2g} to {max(values):.2g}"))
    same = [row["same_bits"] for row in _of(rows, "threads")]
    if same:
        found.append(
            answer("same bits with two threads", "yes", "yes" if all(same) else "no", all(same))
        )
    return found
