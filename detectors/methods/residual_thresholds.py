"""Per-joint thresholds on the residual: constant ones, and ones that follow the motion."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors import _observer
from tauguard.detectors.estimation.gains import PLAIN_GAIN
from tauguard.detectors.features.front_end import FrontEnd, FrontEndSettings
from tauguard.detectors.features.native_stream import NativeStream
from tauguard.detectors.features.scaling import Scaling
from tauguard.detectors.methods.per_joint import FittedPerJoint, PerJoint
from tauguard.traces.trace import Trace


@dataclass(frozen=True)
class ResidualThresholds(PerJoint["FittedThresholds"]):
    """The classical detector: the calibrated momentum observer, one constant threshold a joint.

    The score is the largest ratio of |residual| to its joint's limit [N m], so a threshold of 1 on
    the score is what collision-free motion exceeds in one training sample of a thousand.
    """

    front: FrontEndSettings = field(
        default_factory=lambda: FrontEndSettings(gain=PLAIN_GAIN, adapt=False, settle=0.5)
    )
    name: ClassVar[str] = "residual-thresholds"

    def scaling(self, front: FrontEnd) -> Scaling:
        """The residual in N m."""
        return Scaling(front.joints)

    def fitted(self, front: FrontEnd, scaling: Scaling, limits: Array) -> FittedThresholds:
        """See the class."""
        return FittedThresholds(front, scaling, limits, self.name)


@dataclass(frozen=True)
class MovingThresholds(PerJoint["FittedThresholds"]):
    """Thresholds that follow speed, acceleration and what has been learned of the payload.

    The score is the largest ratio of |residual that the payload-tracking estimator cannot explain|
    to its envelope, in units of the ratio that collision-free motion exceeds in one sample of a
    thousand.
    """

    name: ClassVar[str] = "moving-thresholds"

    def fitted(self, front: FrontEnd, scaling: Scaling, limits: Array) -> FittedThresholds:
        """See the class."""
        return FittedThresholds(front, scaling, limits, self.name)


@dataclass(frozen=True, eq=False)
class FittedThresholds(FittedPerJoint):
    """The largest ratio of scaled residual to limit."""

    name: str

    def scores(self, trace: Trace) -> Array:
        """The largest ratio over the joints, shape (T,)."""
        scaled = self.front.scaled(trace, self.scaling)
        score: Array = (np.abs(scaled) / self.limits).max(axis=1)
        return score

    def stream(self) -> NativeStream:
        """The same, sample by sample."""
        estimator, scaling = self.front.estimator().native, self.scaling.numbers
        scores = _observer.limit_scores(estimator, *scaling, self.limits.tolist())
        return NativeStream(scores, self.dt)
