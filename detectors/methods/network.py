"""A small feed-forward network: scikit-learn fits it, plain arrays keep it, numpy evaluates it."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPRegressor

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Network:
    """Affine layers with rectifiers in between, on standardised inputs and outputs."""

    weights: tuple[Array, ...]  #: of each layer, shape (in, out)
    biases: tuple[Array, ...]  #: of each layer, shape (out,)
    centre: Array  #: of the inputs, shape (d,)
    scale: Array  #: of the inputs, shape (d,)

    @classmethod
    def fit(
        cls,
        x: Array,
        y: Array,
        hidden: Sequence[int],
        *,
        seed: int = 0,
        epochs: int = 60,
        decay: float = 1e-4,
    ) -> Network:
        """Least squares by Adam; a tenth of the rows decides when to stop.

        Args:
            x: inputs, shape (N, d).
            y: outputs, shape (N,) or (N, m).
            hidden: widths of the hidden layers.
            seed: of the start, the order and the held-out tenth.
            epochs: at most.
            decay: weight of the squared weights.
        """
        centre, scale = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-9)
        outputs = y.reshape(len(y), -1)
        mean, spread = outputs.mean(axis=0), np.maximum(outputs.std(axis=0), 1e-9)
        model = MLPRegressor(
            hidden_layer_sizes=tuple(hidden),
            alpha=decay,
            max_iter=epochs,
            early_stopping=True,
            n_iter_no_change=6,
            random_state=seed,
        )
        target = (outputs - mean) / spread
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # epochs is the budget
            model.fit((x - centre) / scale, target[:, 0] if target.shape[1] == 1 else target)
        weights = [np.ascontiguousarray(w) for w in model.coefs_]
        biases = [np.ascontiguousarray(b) for b in model.intercepts_]
        weights[-1], biases[-1] = weights[-1] * spread, biases[-1] * spread + mean
        return cls(tuple(weights), tuple(biases), centre, scale)

    def __call__(self, x: Array) -> Array:
        """Outputs at the rows of x, shape (N, d) -> (N, m)."""
        value = (x - self.centre) / self.scale
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            value = value @ weight + bias
            if k + 1 < len(self.weights):
                np.maximum(value, 0.0, out=value)
        return value

    def parts(self) -> dict[str, Any]:
        """What a model file keeps."""
        return {
            "weights": list(self.weights),
            "biases": list(self.biases),
            "centre": self.centre,
            "scale": self.scale,
        }

    @classmethod
    def from_parts(cls, parts: dict[str, Any]) -> Network:
        """The network again from :meth:`parts`."""
        return cls(
            tuple(np.asarray(w) for w in parts["weights"]),
            tuple(np.asarray(b) for b in parts["biases"]),
            np.asarray(parts["centre"]),
            np.asarray(parts["scale"]),
        )
