"""Gradient-boosted trees on windows of the residual."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tauguard.arrays import Array
from tauguard.detectors.methods.forest import Forest
from tauguard.detectors.methods.windowed import Windowed


@dataclass(frozen=True)
class Boosting(Windowed):
    """A forest that ranks windows by the severity of what happens in them."""

    trees: int = 150
    depth: int = 4
    rate: float = 0.1
    name: ClassVar[str] = "boosting"

    def learn(self, x: Array, y: Array) -> Forest:
        """Stochastic gradient boosting."""
        return Forest.boosted(
            x, y, trees=self.trees, depth=self.depth, rate=self.rate, seed=self.seed
        )
