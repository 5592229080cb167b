"""Gradient-boosted trees on windows of the residual."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.methods.forest import Forest
from tauguard.detectors.methods.windowed import Windowed

Array = NDArray[np.float64]


@dataclass
class Boosting(Windowed):
    """A forest that ranks windows by the severity of what happens in them."""

    trees: int = 150
    depth: int = 4
    rate: float = 0.1
    forest: Forest | None = None
    name: ClassVar[str] = "boosting"

    def _learn(self, x: Array, y: Array) -> None:
        self.forest = Forest.boosted(
            x, y, trees=self.trees, depth=self.depth, rate=self.rate, seed=self.seed
        )

    def _predict(self, x: Array) -> Array:
        assert self.forest is not None
        return self.forest(x)

    def _own_parts(self) -> dict[str, Any]:
        assert self.forest is not None
        return {"forest": self.forest.parts()}

    def _restore(self, parts: dict[str, Any]) -> None:
        self.forest = Forest.from_parts(parts["forest"])
