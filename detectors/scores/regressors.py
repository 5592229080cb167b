"""A forest of regression trees in flat arrays: scikit-learn grows it, native code walks it."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.detectors import _ranking
from tauguard.detectors.frozen import Frozen

Ids = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Forest:
    """Trees of all nodes in one table; a leaf is its own left and right child."""

    roots: Ids  #: first node of each tree, shape (trees,)
    feature: Ids  #: column that a node compares, shape (nodes,)
    threshold: Array  #: at or below goes left, shape (nodes,)
    left: Ids  #: shape (nodes,)
    right: Ids  #: shape (nodes,)
    value: Array  #: of a leaf, shape (nodes,)
    base: float  #: added to the sum of one leaf a tree
    inputs: int  #: columns that a row must have

    @classmethod
    def boosted(
        cls, x: Array, y: Array, *, trees: int, depth: int, rate: float, seed: int
    ) -> Forest:
        """Stochastic gradient boosting (Friedman 2002) on squares.

        Args:
            x: shape (N, d).
            y: shape (N,).
            trees: how many.
            depth: of each.
            rate: what each counts.
            seed: seed of the half of the rows and the fraction of the columns that each tree sees.
        """
        from sklearn.ensemble import GradientBoostingRegressor

        model = GradientBoostingRegressor(
            n_estimators=trees,
            max_depth=depth,
            learning_rate=rate,
            subsample=0.5,
            max_features=0.3,
            min_samples_leaf=10,
            init="zero",
            random_state=seed,
        )
        base = float(np.mean(y))
        model.fit(x, y - base)
        grown = [tree.tree_ for tree in model.estimators_[:, 0]]
        roots = np.cumsum([0, *(tree.node_count for tree in grown)])[:-1]
        columns: list[list[NDArray[Any]]] = [[], [], [], [], []]
        for root, tree in zip(roots, grown, strict=True):
            own = np.arange(tree.node_count)
            leaf = tree.children_left < 0
            columns[0].append(np.where(leaf, 0, tree.feature))
            columns[1].append(tree.threshold)
            columns[2].append(root + np.where(leaf, own, tree.children_left))
            columns[3].append(root + np.where(leaf, own, tree.children_right))
            columns[4].append(rate * tree.value[:, 0, 0])
        feature, threshold, left, right, value = (np.concatenate(c) for c in columns)
        ids = [np.ascontiguousarray(a, dtype=np.int64) for a in (roots, feature, left, right)]
        return cls(ids[0], ids[1], threshold, ids[2], ids[3], value, base, x.shape[1])

    def __call__(self, x: Array, *, threads: int = 0) -> Array:
        """Values at the rows of x, shape (N, inputs) -> (N,); the threads do not change them.

        Raises:
            ValueError: rows of another length.
        """
        rows = np.ascontiguousarray(x, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != self.inputs:
            raise ValueError(f"x: shape {rows.shape}, expected (N, {self.inputs})")
        out = np.empty(len(rows))
        tables = (self.roots, self.feature, self.threshold, self.left, self.right, self.value)
        _ranking.forest(rows, *tables, self.base, out, threads)
        return out


@dataclass(frozen=True, eq=False)
class Network(Frozen):
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
            seed: seed of the start, the order and the held-out tenth.
            epochs: at most.
            decay: weight of the squared weights.
        """
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.neural_network import MLPRegressor

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
        """Outputs at the rows of x, shape (N, d) -> (N, m); each depends on its row alone."""
        rows = np.ascontiguousarray(x, dtype=np.float64)
        out = np.empty((len(rows), len(self.biases[-1])))
        _ranking.network(rows, *self._flat, out, 0)
        return out
