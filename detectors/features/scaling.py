"""Residuals in units of their envelope.

Scaling decides whether the SVR works: raw residuals in N m have a median distance near 100, which
makes the matrix of a kernel of length sigma = 3 almost diagonal. Each joint's residual is divided
by its envelope, compressed by asinh (a hard blow must stay within the region of the training data)
and multiplied by one factor.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors import _kernel
from tauguard.detectors.features.envelope import Envelope
from tauguard.detectors.frozen import Frozen


@dataclass(frozen=True, eq=False)
class Scaling(Frozen):
    """``factor asinh(residual / (units envelope))`` of the chosen joints."""

    joints: tuple[int, ...]  #: 0-based
    envelope: Envelope | None = None  #: None: ``factor residual`` in N m
    units: float = 1.0  #: envelopes that count one
    factor: float = 1.0
    compress: bool = False  #: by asinh

    def __post_init__(self) -> None:
        """Check: ``ValueError``."""
        if not self.joints or not (self.units > 0 and np.isfinite(self.factor)):
            raise ValueError(f"Scaling: {self}, expected some joints, units > 0, a finite factor")

    @property
    def numbers(self) -> tuple[list[int], list[float], float, float, bool]:
        """Joints, the envelope's weights, units, factor and whether it compresses: native form."""
        weights = [] if self.envelope is None else self.envelope.weights.ravel().tolist()
        return list(self.joints), weights, self.units, self.factor, self.compress

    @cached_property
    def _native(self) -> _kernel.Scaling:
        weights = np.empty((0, 4)) if self.envelope is None else self.envelope.weights
        joints = np.array(self.joints, dtype=np.int64)
        return _kernel.Scaling(joints, weights, self.units, self.factor, self.compress)

    def rows(
        self, residual: Array, qd: Array, acceleration: Array, out: Array | None = None
    ) -> Array:
        """The scaled residual, shape (T, len(joints)).

        Args:
            residual: [N m], shape (T, n).
            qd: [rad/s], shape (T, n).
            acceleration: [rad/s^2], shape (T, n).
            out: where to write it (default: a new array).
        """
        found = np.empty((len(residual), len(self.joints))) if out is None else out
        self._native.rows(residual, qd, acceleration, found)
        return found
