"""Rigid bodies: convex pairs (table 2.1), meshes (2.2), volumes (figure 1.1), motion, claims."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tauguard.benchmarks import rigid_claims, rigid_convex, rigid_impact, rigid_mesh, rigid_volumes
from tauguard.benchmarks.report import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PARTS = (rigid_convex, rigid_mesh, rigid_volumes, rigid_impact)


def run(quick: bool, seed: int) -> list[Row]:
    """The rows of every part, and what was asked of them beside what they measured."""
    rows = [row for part in PARTS for row in part.run(quick, seed)]
    return rows + rigid_claims.claims(rows, quick)


def draw(rows: list[Row], figure: Figure) -> None:
    """Table 2.1 above, the other parts below."""
    grid = figure.add_gridspec(2, 3)
    panels = [grid[0, :], *(grid[1, k] for k in range(3))]
    for part, panel in zip(PARTS, panels, strict=True):
        part.draw(rows, figure.add_subplot(panel))
