"""What the detectors with one learned number a joint share: the front end and that number."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.calibration.calibrate import free_rows
from tauguard.detectors.estimation.estimator import ArmModel, Estimate
from tauguard.detectors.features.front_end import FrontEnd, OnFrontEnd
from tauguard.traces.trace import Trace

Array = NDArray[np.float64]


@dataclass
class PerJoint(OnFrontEnd, ABC):
    """A detector that compares each joint's deviation with what free motion seldom exceeds."""

    limits: Array | None = None  #: deviation that counts one, shape (joints,)
    name: ClassVar[str] = "per-joint"
    share: ClassVar[float] = 0.999  #: of free motion that stays below a limit

    @abstractmethod
    def deviation(self, trace: Trace, estimate: Estimate) -> Array:
        """What is compared with the limits in training, signed, shape (T, joints)."""

    @abstractmethod
    def scores(self, trace: Trace) -> Array:
        """One score a sample, shape (T,)."""

    def fit(self, traces: Sequence[Trace], robot: ArmModel) -> Self:
        """Calibrate the arm, fit the envelope and take each joint's quantile of free motion."""
        estimates = self.front.fit(traces, robot)
        free = [
            np.abs(self.deviation(t, e)[free_rows(t, self.settle)])
            for t, e in zip(traces, estimates, strict=True)
        ]
        self.limits = np.maximum(np.quantile(np.concatenate(free), self.share, axis=0), 1e-9)
        return self

    def parts(self) -> dict[str, Any]:
        """What a model file keeps."""
        return {"front": self.front.parts(), "limits": self.limits}

    @classmethod
    def from_parts(cls, parts: dict[str, Any]) -> Self:
        """The detector again from :meth:`parts`."""
        return cls(FrontEnd.from_parts(parts["front"]), np.asarray(parts["limits"]))
