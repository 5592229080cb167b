"""Rigid bodies: convex pairs (table 2.1)."""

from __future__ import annotations

from matplotlib.figure import Figure

from tauguard.benchmarks import rigid_convex
from tauguard.benchmarks.report import Row


def run(quick: bool, seed: int) -> list[Row]:
    """The rows of table 2.1 and what belongs to it."""
    return rigid_convex.run(quick, seed)


def draw(rows: list[Row], figure: Figure) -> None:
    """Ratios of table 2.1."""
    rigid_convex.draw(rows, figure.add_subplot())
