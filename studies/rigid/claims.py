"""What the study of rigid bodies claims, each claim beside what the same run measured."""

from __future__ import annotations

from collections.abc import Iterable

from studies.framework import timed
from tauguard.report import Row

METHODS = ("abfme", "sat", "auto")


def claims(rows: list[Row], quick: bool, volume: str = "obb") -> list[Row]:
    """One row a claim: asked, measured, met; ``volume`` is the mesh tree's that is judged."""
    found = [
        *wrong_answers(rows),
        *convex_ratios(rows),
        *mesh_ratios(rows, volume),
        *impacts(rows),
        *distances(rows),
        *rounded(rows),
    ]
    for row in found:
        if row["met"] is False and row["of"] == "time":
            row["met"] = timed(False, quick)
    return found


def of(rows: Iterable[Row], study: str, **fields: object) -> list[Row]:
    """The rows of a study whose fields have the given values."""
    return [
        row
        for row in rows
        if row["study"] == study and all(row.get(name) == value for name, value in fields.items())
    ]


def claim(
    what: str, kind: str, bound: float, values: list[float | None], least: bool = False
) -> Row:
    """Judges the worst of several figures; a figure that could not be measured leaves it open.

    ``kind`` is "error", or "time" for what a quick run may miss by chance; ``least``: the figures
    are to reach the bound, otherwise to keep within it.
    """
    asked = f"{'at least' if least else 'at most'} {bound:g}"
    row: Row = {"study": "claims", "claim": what, "of": kind, "asked": asked}
    known = [value for value in values if value is not None]
    if not known or len(known) < len(values):
        return row | {"measured": None, "met": None}
    measured = min(known) if least else max(known)
    met = measured >= bound if least else measured <= bound
    return row | {"measured": measured, "met": met}


def at_least(what: str, bound: float, values: list[float | None]) -> Row:
    """The smallest ratio of times reaches the bound."""
    return claim(what, "time", bound, values, least=True)


def at_most(what: str, bound: float, values: list[float | None]) -> Row:
    """The longest time keeps within the bound."""
    return claim(what, "time", bound, values)


def error_at_most(what: str, bound: float, values: list[float | None]) -> Row:
    """The largest error, or count of errors, keeps within the bound."""
    return claim(what, "error", bound, values)


def count(rate: Row) -> float | None:
    """How many of a rate's trials; None where there was no trial."""
    return None if rate["value"] is None else float(round(rate["value"] * rate["n"]))


def wrong_answers(rows: list[Row]) -> list[Row]:
    """Of every method, over all cells and all hard cases."""
    static, hard = of(rows, "table 2.1 static"), of(rows, "hard cases")
    kinds = ("false_hit", "false_clear")
    pairs, each = sum(row["pairs"] for row in static), min(row["pairs"] for row in hard)
    return [
        *(
            error_at_most(
                f"{m}: wrong of {pairs} pairs", 0, [count(r[f"{m}_wrong"]) for r in static]
            )
            for m in METHODS
        ),
        *(
            error_at_most(
                f"{m}: wrong of {each} of each of {len(hard)} hard cases",
                0,
                [float(row[f"{m}_{kind}"]) for row in hard for kind in kinds],
            )
            for m in METHODS
        ),
    ]


def convex_ratios(rows: list[Row]) -> list[Row]:
    """Elimination against textbook SAT, auto against tuned SAT and coal, the batch path."""
    static = of(rows, "table 2.1 static")
    found = [
        at_least(
            f"abfme over textbook SAT, {row['pair']}, {row['outcome']} (published)",
            row["published"],
            [row["abfme_vs_textbook"]],
        )
        for row in static
        if row["published"]
    ]
    tetrahedra = of(rows, "table 2.1 static", pair="tetrahedra-tetrahedra")
    for outcome, bound in (("collision", 4.2), ("non-collision", 1.2)):
        ratios = [r["abfme_vs_textbook"] for r in tetrahedra if r["outcome"] == outcome]
        found.append(at_least(f"abfme over textbook SAT, two tetrahedra, {outcome}", bound, ratios))
    boxes = of(rows, "table 2.1 static", pair="boxes-boxes")
    batch = of(rows, "batched box-box")
    return [
        *found,
        at_least("auto over tuned SAT, every cell", 1, [r["auto_vs_sat"] for r in static]),
        at_least("auto over coal, every cell", 6, [r["auto_vs_coal_net"] for r in static]),
        at_least("auto over coal, two boxes", 15, [r["auto_vs_coal_net"] for r in boxes]),
        at_most("batched boxes, ns a pair", 10, [r["vectors_ns"]["median"] for r in batch]),
    ]


def mesh_ratios(rows: list[Row], volume: str) -> list[Row]:
    """Build and first hit against coal's OBBRSS, net of its call."""
    build = of(rows, "mesh build", volume=volume)
    first = of(rows, "table 2.2 static", volume=volume)
    name = first[0]["mesh"]
    found = [
        at_least(f"{name}, {volume}: build over coal", 5, [r["times_faster"] for r in build]),
    ]
    for outcome, bound in (("collision", 6), ("non-collision", 4)):
        ratios = [row["times_faster"] for row in first if row["outcome"] == outcome]
        found.append(at_least(f"{name}, {volume}: first hit over coal, {outcome}", bound, ratios))
    everywhere = [count(row["disagree"]) for row in of(rows, "table 2.2 static")]
    poses = first[0]["disagree"]["n"]
    moving = [count(row["late_or_missed"]) for row in of(rows, "table 2.2 dynamic")]
    return [
        *found,
        error_at_most(
            f"{name}: answers of {poses} that differ from coal's, any volume", 0, everywhere
        ),
        error_at_most(f"{name} in motion: late or missed", 0, moving),
    ]


def impacts(rows: list[Row]) -> list[Row]:
    """Time of impact of convex bodies that move and turn."""
    found: list[Row] = []
    for row in of(rows, "time of impact", method="tauguard"):
        name = f"time of impact, {row['pairs']} pairs of {row['bodies']}"
        found += [
            error_at_most(
                f"{name}: late or missed", 0, [count(row[k]) for k in ("late", "missed")]
            ),
            error_at_most(f"{name}: largest error", 1e-7, [row["toi_error_max"]]),
            at_most(f"{name}: us a hit", 20, [row["us_hit"]["median"]]),
        ]
    return found


def distances(rows: list[Row]) -> list[Row]:
    """The sign and the length of every distance."""
    found = of(rows, "distance")
    wrong = [row["wrong_sign"]["value"] for row in found]
    errors = [row["error"] for row in found if row["error"] is not None]
    return [
        claim("distance: wrong signs", "error", 0, wrong),
        claim("distance: error as a share of the extent", "error", 3e-14, errors),
        at_least("distance over coal, random pairs", 1, _over_coal(found)),
    ]


def _over_coal(found: list[Row]) -> list[float | None]:
    return [
        row["coal_ns"] / row["distance_ns"]["median"] if isinstance(row["coal_ns"], float) else None
        for row in found
        if row["outcome"] != "hard case"
    ]


def rounded(rows: list[Row]) -> list[Row]:
    """Bodies with radii and meshes against convex bodies."""
    static, moving = of(rows, "rounded"), of(rows, "rounded in motion")
    mesh = of(rows, "mesh and convex")
    wrong = [row["wrong"] for row in static]
    differ = [row["signs_differ"] for row in static + mesh]
    early = [row.get("passed_before") for row in moving]
    early += [row.get("moving_passed_before") for row in mesh]
    gaps = [row.get("gap_at_toi") for row in moving]
    gaps += [row.get("moving_gap_at_toi") for row in mesh]
    return [
        error_at_most("rounded bodies: wrong overlaps", 0, wrong),
        error_at_most("rounded and mesh: overlaps that distances contradict", 0, differ),
        error_at_most(
            "rounded: error as a share of the extent",
            3e-14,
            [r["error"] for r in static if r["known"]],
        ),
        error_at_most("rounded and mesh in motion: coal says they met before", 0, early),
        error_at_most("rounded and mesh in motion: coal's distance at the time", 1e-6, gaps),
    ]
