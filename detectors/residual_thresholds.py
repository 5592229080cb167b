"""Per-joint thresholds on the residual: constant ones, and ones that move with the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.calibrate import free_rows
from tauguard.detectors.detector import check_trace
from tauguard.detectors.estimator import ArmModel
from tauguard.detectors.front_end import FrontEnd
from tauguard.detectors.thresholded import plain_residual
from tauguard.traces.trace import Trace

Array = NDArray[np.float64]

#: A joint's threshold counts one where free motion stays below it this share of the time.
SHARE = 0.999


@dataclass
class ResidualThresholds:
    """The classical detector: the calibrated momentum observer, one constant threshold a joint.

    The score is the largest ratio of |residual| to its joint's threshold, so a threshold of 1 on
    the score is what training showed free motion to reach in one sample of a thousand.
    """

    front: FrontEnd = field(default_factory=lambda: FrontEnd(adapt=False, settle=0.5))
    limits: Array | None = None  #: residual that counts one [N m], shape (joints,)
    name: str = "residual-thresholds"

    @property
    def settle(self) -> float:
        """Seconds at the beginning of a trace whose scores mean nothing yet."""
        return self.front.settle

    @property
    def arm(self) -> ArmModel:
        """The calibrated arm."""
        return self.front.fitted()[0]

    def fit(self, traces: Sequence[Trace], robot: ArmModel) -> ResidualThresholds:
        """Calibrate the arm and take each joint's quantile over the collision-free rows."""
        estimates = self.front.fit(traces, robot)
        free = [
            np.abs(e.left[free_rows(t, self.settle)][:, : self.front.joints])
            for t, e in zip(traces, estimates, strict=True)
        ]
        self.limits = np.maximum(np.quantile(np.concatenate(free), SHARE, axis=0), 1e-9)
        return self

    def scores(self, trace: Trace) -> Array:
        """The largest |residual| over its joint's threshold, shape (T,)."""
        arm, _ = self.front.fitted()
        assert self.limits is not None
        check_trace(trace, arm.robot.joints, self.front.dt)
        residual = plain_residual(arm, trace)[:, : len(self.limits)]
        score: Array = (np.abs(residual) / self.limits).max(axis=1)
        return score

    def parts(self) -> dict[str, Any]:
        """What a model file keeps."""
        return {"front": self.front.parts(), "limits": self.limits}

    @classmethod
    def from_parts(cls, parts: dict[str, Any]) -> ResidualThresholds:
        """The detector again from :meth:`parts`."""
        return cls(FrontEnd.from_parts(parts["front"]), np.asarray(parts["limits"]))


@dataclass
class MovingThresholds:
    """Thresholds that follow speed, acceleration and what has been learned of the payload.

    The score is the largest ratio of |residual left by the payload-tracking estimator| to its
    envelope, in units of the ratio that free motion exceeds in one sample of a thousand.
    """

    front: FrontEnd = field(default_factory=FrontEnd)
    limits: Array | None = None  #: ratio that counts one, shape (joints,)
    name: str = "moving-thresholds"

    @property
    def settle(self) -> float:
        """Seconds at the beginning of a trace whose scores mean nothing yet."""
        return self.front.settle

    @property
    def arm(self) -> ArmModel:
        """The calibrated arm."""
        return self.front.fitted()[0]

    def fit(self, traces: Sequence[Trace], robot: ArmModel) -> MovingThresholds:
        """Calibrate the arm, fit the envelope and take each joint's quantile of the ratio."""
        estimates = self.front.fit(traces, robot)
        free = [
            np.abs(self.front.ratio(t, e)[free_rows(t, self.settle)])
            for t, e in zip(traces, estimates, strict=True)
        ]
        self.limits = np.maximum(np.quantile(np.concatenate(free), SHARE, axis=0), 1e-9)
        return self

    def scores(self, trace: Trace) -> Array:
        """The largest ratio, shape (T,)."""
        ratio = np.abs(self.front.ratio(trace))
        assert self.limits is not None
        score: Array = (ratio / self.limits).max(axis=1)
        return score

    def parts(self) -> dict[str, Any]:
        """What a model file keeps."""
        return {"front": self.front.parts(), "limits": self.limits}

    @classmethod
    def from_parts(cls, parts: dict[str, Any]) -> MovingThresholds:
        """The detector again from :meth:`parts`."""
        return cls(FrontEnd.from_parts(parts["front"]), np.asarray(parts["limits"]))
