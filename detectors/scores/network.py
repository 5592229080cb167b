"""A feed-forward network: scikit-learn trains it, native code evaluates it."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.detectors import _network
from tauguard.detectors.frozen import Frozen


@dataclass(frozen=True, eq=False)
class Network(Frozen):
    """Affine layers with rectifiers between them, for standardised inputs and outputs."""

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
    ) -> Network:
        """Least squares by Adam, with early stopping by the loss on a tenth of the rows.

        Args:
            x: inputs, shape (N, d).
            y: outputs, shape (N,) or (N, m).
            hidden: widths of the hidden layers.
            seed: seed of the initial weights, the order of the rows and the held-out tenth.
            epochs: largest number of epochs.
        """
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.neural_network import MLPRegressor

        centre, scale = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-9)
        outputs = y.reshape(len(y), -1)
        mean, spread = outputs.mean(axis=0), np.maximum(outputs.std(axis=0), 1e-9)
        model = MLPRegressor(
            hidden_layer_sizes=tuple(hidden),
            max_iter=epochs,
            early_stopping=True,
            n_iter_no_change=6,
            random_state=seed,
        )
        target = (outputs - mean) / spread
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # raised after the last epoch
            model.fit((x - centre) / scale, target[:, 0] if target.shape[1] == 1 else target)
        weights = [np.ascontiguousarray(w) for w in model.coefs_]
        biases = [np.ascontiguousarray(b) for b in model.intercepts_]
        weights[-1], biases[-1] = weights[-1] * spread, biases[-1] * spread + mean
        return cls(tuple(weights), tuple(biases), centre, scale)

    @cached_property
    def _flat(self) -> tuple[NDArray[np.int64], Array, Array, Array, Array]:
        widths = [len(self.centre), *(len(bias) for bias in self.biases)]
        return (
            np.array(widths, dtype=np.int64),
            np.concatenate([weight.ravel() for weight in self.weights]),
            np.concatenate(self.biases),
            np.ascontiguousarray(self.centre),
            np.ascontiguousarray(self.scale),
        )

    def __call__(self, x: Array) -> Array:
        """Outputs at the rows of x, shape (N, d) -> (N, m)."""
        rows = np.ascontiguousarray(x, dtype=np.float64)
        out = np.empty((len(rows), len(self.biases[-1])))
        _network.network(rows, *self._flat, out, 0)
        return out
