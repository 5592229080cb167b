"""Gradient-boosted trees on windows of the residual."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingRegressor

from tauguard.detectors.windowed import Windowed

Array = NDArray[np.float64]


@dataclass
class Boosting(Windowed):
    """Histogram gradient boosting that ranks windows by the severity of what happens in them."""

    trees: int = 120
    leaves: int = 15
    rate: float = 0.1
    trained: HistGradientBoostingRegressor | None = None
    name: ClassVar[str] = "boosting"

    def _learn(self, x: Array, y: Array) -> None:
        model = HistGradientBoostingRegressor(
            max_iter=self.trees,
            max_leaf_nodes=self.leaves,
            learning_rate=self.rate,
            early_stopping=False,
            random_state=self.seed,
        )
        self.trained = model.fit(x, y)

    def _predict(self, x: Array) -> Array:
        assert self.trained is not None
        value: Array = self.trained.predict(x)
        return value

    def _own_parts(self) -> dict[str, Any]:
        return {"trees": self.trained}

    def _restore(self, parts: dict[str, Any]) -> None:
        trees = parts["trees"]
        if not isinstance(trees, HistGradientBoostingRegressor):
            raise KeyError("trees")
        self.trained = trees
