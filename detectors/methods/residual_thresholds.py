"""Per-joint thresholds on the residual: constant ones, and ones that move with the motion."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.detector import check_trace
from tauguard.detectors.estimation.estimator import Estimate
from tauguard.detectors.features.front_end import FrontEnd
from tauguard.detectors.methods.per_joint import PerJoint
from tauguard.detectors.thresholds.thresholded import PLAIN_GAIN, plain_residual
from tauguard.traces.trace import Trace

Array = NDArray[np.float64]


@dataclass
class ResidualThresholds(PerJoint):
    """The classical detector: the calibrated momentum observer, one constant threshold a joint.

    The score is the largest ratio of |residual| to its joint's limit [N m], so a threshold of 1 on
    the score is what training showed free motion to reach in one sample of a thousand.
    """

    front: FrontEnd = field(
        default_factory=lambda: FrontEnd(gain=PLAIN_GAIN, adapt=False, settle=0.5)
    )
    name: ClassVar[str] = "residual-thresholds"

    def deviation(self, trace: Trace, estimate: Estimate) -> Array:
        """The residual [N m]."""
        return estimate.left[:, : self.front.joints]

    def scores(self, trace: Trace) -> Array:
        """The largest |residual| over its joint's limit, shape (T,)."""
        arm, _ = self.front.fitted()
        assert self.limits is not None
        check_trace(trace, arm.robot.joints, self.front.dt)
        residual = plain_residual(arm, trace)[:, : len(self.limits)]
        score: Array = (np.abs(residual) / self.limits).max(axis=1)
        return score


@dataclass
class MovingThresholds(PerJoint):
    """Thresholds that follow speed, acceleration and what has been learned of the payload.

    The score is the largest ratio of |residual left by the payload-tracking estimator| to its
    envelope, in units of the ratio that free motion exceeds in one sample of a thousand.
    """

    name: ClassVar[str] = "moving-thresholds"

    def deviation(self, trace: Trace, estimate: Estimate) -> Array:
        """The residual over its envelope."""
        return self.front.ratio(trace, estimate)

    def scores(self, trace: Trace) -> Array:
        """The largest ratio over its limit, shape (T,)."""
        ratio = np.abs(self.front.ratio(trace))
        assert self.limits is not None
        score: Array = (ratio / self.limits).max(axis=1)
        return score
