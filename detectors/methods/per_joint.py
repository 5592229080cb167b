"""What the methods with one learned number a joint share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Generic, TypeVar

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.evaluation.events import undisturbed_rows
from tauguard.detectors.features.front_end import FrontEnd, FrontEndSettings, OnFrontEnd
from tauguard.detectors.features.scaling import Scaling
from tauguard.traces.trace import Trace


@dataclass(frozen=True, eq=False)
class FittedPerJoint(OnFrontEnd, ABC):
    """What fitted methods share; with scores they are a ``FittedDetector``."""

    front: FrontEnd
    scaling: Scaling
    limits: Array  #: scaled residual that counts one, shape (joints,)

    def __post_init__(self) -> None:
        """Check: ``ValueError``."""
        if self.limits.shape != (len(self.scaling.joints),) or not (self.limits > 0).all():
            raise ValueError("limits: expected one number above 0 a joint")


Fitted = TypeVar("Fitted", bound=FittedPerJoint)


@dataclass(frozen=True)
class PerJoint(ABC, Generic[Fitted]):
    """Settings of a method that compares each joint's residual with a limit.

    A limit is what collision-free motion exceeds in a share 1 - ``share`` of its samples.
    """

    front: FrontEndSettings = field(default_factory=FrontEndSettings)
    share: float = 0.999
    name: ClassVar[str] = "per-joint"

    @abstractmethod
    def fitted(self, front: FrontEnd, scaling: Scaling, limits: Array) -> Fitted:
        """The fitted method."""

    def scaling(self, front: FrontEnd) -> Scaling:
        """What is compared with the limits."""
        return front.scaling()

    def fit(self, traces: Sequence[Trace], arm: ArmModel) -> Fitted:
        """Calibrate the arm, fit the envelope and take each joint's quantile.

        Raises:
            ValueError: traces that do not fit, or without collision-free motion.
        """
        front = self.front.fit(traces, arm)
        scaling = self.scaling(front)
        rows = undisturbed_rows(traces, front.settle)
        free = [np.abs(front.scaled(t, scaling)[r]) for t, r in zip(traces, rows, strict=True)]
        limits = np.maximum(np.quantile(np.concatenate(free), self.share, axis=0), 1e-9)
        return self.fitted(front, scaling, limits)
