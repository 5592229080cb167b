"""Rigid bodies: convex pairs (table 2.1), meshes (2.2), volumes (figure 1.1), motion, claims."""

from __future__ import annotations

from typing import TYPE_CHECKING

from studies.rigid import claims as rigid_claims
from studies.rigid import convex as rigid_convex
from studies.rigid import gap as rigid_gap
from studies.rigid import impact as rigid_impact
from studies.rigid import mesh as rigid_mesh
from studies.rigid import mesh_bodies as rigid_mesh_bodies
from studies.rigid import rounded as rigid_rounded
from studies.rigid import volumes as rigid_volumes
from tauguard.report import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PARTS = (rigid_convex, rigid_mesh, rigid_volumes, rigid_impact)

#: The chart's size [in].
SIZE = (11.0, 8.5)

#: What the columns of each table mean; a table without a line has its file's docstring.
NOTES = {
    "table 2.1 static": "ns a pair in one pose, one thread. coal_net: without the loop and the "
    "call; a_vs_b: b's time over a's; published: the printed ratio; wrong: of all pairs.",
    "table 2.1 dynamic": "ns a pair that moves by a constant translation; a_vs_b: b's time over "
    "a's.",
    "hard cases": "false_hit and false_clear count wrong answers, exact_share is what was left to "
    "exact arithmetic.",
    "mesh build": "times_faster: coal's time over ours.",
    "table 2.2 static": "first hit of two copies in random poses [us]; times_faster: coal's mean, "
    "net of its call, over ours; disagree: answers that differ from coal's.",
    "figure 1.1 volumes": "tightness: volume over the hull's; false_hits: of the pairs whose "
    "hulls are apart, those that the volumes cannot tell apart.",
    "distance": "signed distance, ns a pair, coal's with the call of its binding; wrong_sign: of "
    "all pairs, by the exact overlap; error: of the `known` rows, as a share of the extent.",
    "rounded": "bodies grown by balls, ns a pair, coal's with the call of its binding. wrong: of "
    "the `known` overlaps by rational arithmetic; signs_differ: distances that say otherwise; "
    "error: of the known distances, as a share of the extent; coal_disagrees: its overlaps.",
    "rounded in motion": "both turn; us a pair. coal_us: advancement over coal's distance, its "
    "calls with the binding. passed_before: pairs that coal says meet before the time given; "
    "gap_at_toi: coal's distance at that time, most; coal_disagrees: hits that differ (it stops "
    "at 1e-6).",
    "mesh and convex": "one mesh (OBBRSS of coal) and convex bodies, us a body, coal's with the "
    "call; coal_differs_most: of distances of pairs apart; moving_: as in the table before.",
    "claims": "the worst figure of each kind beside what was asked of it; a quick run denies no "
    "claim of a time.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """The rows of every part, and what was asked of them beside what they measured."""
    parts = (*PARTS, rigid_gap, rigid_rounded, rigid_mesh_bodies)
    rows = [row for part in parts for row in part.run(quick, seed)]
    return rows + rigid_claims.claims(rows, quick)


def draw(rows: list[Row], figure: Figure) -> None:
    """Table 2.1 above, the other parts below."""
    grid = figure.add_gridspec(2, 3)
    panels = [grid[0, :], *(grid[1, k] for k in range(3))]
    for part, panel in zip(PARTS, panels, strict=True):
        part.draw(rows, figure.add_subplot(panel))
