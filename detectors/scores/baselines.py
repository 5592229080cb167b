"""Baselines: thresholds of the residual, one per joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors import _observer
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.estimation.observer import PLAIN_GAIN
from tauguard.detectors.events import undisturbed_rows
from tauguard.detectors.features.front_end import (
    FrontEnd,
    FrontEndSettings,
    NativeStream,
    OnFrontEnd,
    Scaling,
)
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace


@dataclass(frozen=True)
class MovingThresholds:
    """Thresholds that depend on speed, acceleration and the estimated payload.

    A joint's ratio is its |unexplained residual| divided by its standard deviation. The score is
    the largest ratio of all joints, each divided by the quantile ``fraction`` of this joint's ratio
    in collision-free motion.
    """

    front: FrontEndSettings = field(default_factory=FrontEndSettings)
    fraction: float = 0.999
    name: ClassVar[str] = "moving-thresholds"

    def scaling(self, front: FrontEnd) -> Scaling:
        """Scaling of the residual that is compared with the limits."""
        return front.scaling()

    def fit(self, traces: Sequence[Trace], arm: ArmModel) -> FittedThresholds:
        """Calibrate the arm, fit the noise model and compute each joint's quantile.

        Raises:
            ArgumentError: traces of different arms or rates, or without collision-free motion.
        """
        front = self.front.fit(traces, arm)
        scaling = self.scaling(front)
        rows = undisturbed_rows(traces, front.settle)
        free = [np.abs(front.scaled(t, scaling)[r]) for t, r in zip(traces, rows, strict=True)]
        limits = np.maximum(np.quantile(np.concatenate(free), self.fraction, axis=0), 1e-9)
        return FittedThresholds(front, scaling, limits, self.name)


@dataclass(frozen=True)
class ResidualThresholds(MovingThresholds):
    """The classical detector: calibrated momentum observer, one constant threshold per joint.

    The score is the largest ratio of a joint's |residual| to the joint's limit [N m].
    """

    front: FrontEndSettings = field(
        default_factory=lambda: FrontEndSettings(gain=PLAIN_GAIN, adapt=False, settle=0.5)
    )
    name: ClassVar[str] = "residual-thresholds"

    def scaling(self, front: FrontEnd) -> Scaling:
        """The residual in N m."""
        return Scaling(front.joints)


@dataclass(frozen=True, eq=False)
class FittedThresholds(OnFrontEnd):
    """The largest ratio of scaled residual to limit."""

    front: FrontEnd
    scaling: Scaling
    limits: Array  #: scaled residual whose score is one, shape (joints,)
    name: str

    def __post_init__(self) -> None:
        """Check: ``ArgumentError``."""
        if self.limits.shape != (len(self.scaling.joints),) or not (self.limits > 0).all():
            raise ArgumentError("limits: expected one number above 0 per joint")

    def scores(self, trace: Trace) -> Array:
        """The largest ratio over the joints, shape (T,)."""
        scaled = self.front.scaled(trace, self.scaling)
        score: Array = (np.abs(scaled) / self.limits).max(axis=1)
        return score

    def stream(self) -> NativeStream:
        """A new stream of the scores, sample by sample."""
        estimator, scaling = self.front.estimator().native, self.scaling.numbers
        scores = _observer.limit_scores(estimator, *scaling, self.limits.tolist())
        return NativeStream(scores, self.dt)
