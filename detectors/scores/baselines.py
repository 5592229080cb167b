"""Baselines that learn one number for each joint: thresholds of the residual and CUSUM."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array, Bools
from tauguard.detectors import _observer, _ranking
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
from tauguard.traces.trace import Trace


@dataclass(frozen=True, eq=False)
class FittedPerJoint(OnFrontEnd, ABC):
    """The common part of fitted methods; with scores they are a ``FittedDetector``."""

    front: FrontEnd
    scaling: Scaling
    limits: Array  #: scaled residual whose score is one, shape (joints,)

    def __post_init__(self) -> None:
        """Check: ``ValueError``."""
        if self.limits.shape != (len(self.scaling.joints),) or not (self.limits > 0).all():
            raise ValueError("limits: expected one number above 0 a joint")


Fitted = TypeVar("Fitted", bound=FittedPerJoint)


@dataclass(frozen=True)
class PerJoint(ABC, Generic[Fitted]):
    """Settings of a method that compares each joint's residual with a limit.

    A limit is what collision-free motion exceeds in a fraction 1 - ``fraction`` of its samples.
    """

    front: FrontEndSettings = field(default_factory=FrontEndSettings)
    fraction: float = 0.999
    name: ClassVar[str] = "per-joint"

    @abstractmethod
    def fitted(self, front: FrontEnd, scaling: Scaling, limits: Array) -> Fitted:
        """The fitted method."""

    def scaling(self, front: FrontEnd) -> Scaling:
        """The signal that is compared with the limits."""
        return front.scaling()

    def fit(self, traces: Sequence[Trace], arm: ArmModel) -> Fitted:
        """Calibrate the arm, fit the noise model and take each joint's quantile.

        Raises:
            ValueError: traces that do not fit, or without collision-free motion.
        """
        front = self.front.fit(traces, arm)
        scaling = self.scaling(front)
        rows = undisturbed_rows(traces, front.settle)
        free = [np.abs(front.scaled(t, scaling)[r]) for t, r in zip(traces, rows, strict=True)]
        limits = np.maximum(np.quantile(np.concatenate(free), self.fraction, axis=0), 1e-9)
        return self.fitted(front, scaling, limits)


@dataclass(frozen=True)
class ResidualThresholds(PerJoint["FittedThresholds"]):
    """The classical detector: the calibrated momentum observer, one constant threshold a joint.

    The score is the largest ratio of |residual| to its joint's limit [N m]. Collision-free
    motion exceeds a score of 1 in one training sample of a thousand.
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
    to its standard deviation, in units of the ratio that collision-free motion exceeds in one
    sample of a thousand.
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


#: When the statistic falls, it is limited so that it reaches 0 after this time without a residual
#: [s]. Otherwise the alarm of a long contact would last longer than the contact.
RECOVERY = 0.1


def bounded_cusum(increments: ArrayLike, cap: ArrayLike, state: Array | None = None) -> Array:
    """g_k = max(0, g + x_k) down the rows, g = g_{k-1}, or min(cap, g_{k-1}) where x_k < 0.

    Args:
        increments: shape (T, c).
        cap: at or above 0, one number or one a column.
        state: g before the first row, shape (c,) (default: 0); holds the last g afterwards.
    """
    x = np.ascontiguousarray(increments, dtype=np.float64)
    bound = np.ascontiguousarray(np.broadcast_to(cap, x.shape[1:]), dtype=np.float64)
    out = np.empty_like(x)
    _ranking.bounded_cusum(x, bound, np.zeros(x.shape[1]) if state is None else state, out)
    return out


@dataclass(frozen=True)
class Cusum(PerJoint["FittedCusum"]):
    """Two-sided CUSUM of every joint's residual in standard deviations; the largest counts.

    The statistic grows by (|ratio| - drift) dt while the ratio keeps its sign. Otherwise it
    falls to 0, from a limited value. The score is in seconds times the drift. The residual of
    collision-free motion is not white, because friction errors last. So the drift is the limit
    that such motion exceeds in one sample of a hundred; half of a shift would be right for white
    noise.
    """

    fraction: float = 0.99
    name: ClassVar[str] = "cusum"

    def fitted(self, front: FrontEnd, scaling: Scaling, limits: Array) -> FittedCusum:
        """See the class."""
        return FittedCusum(front, scaling, limits)


@dataclass(frozen=True, eq=False)
class FittedCusum(FittedPerJoint):
    """The statistic over its drift; it begins when the estimator has settled."""

    name: ClassVar[str] = "cusum"

    def scores(self, trace: Trace) -> Array:
        """The largest statistic over joints and signs, in units of its drift [s], shape (T,)."""
        settled = trace.t - trace.t[0] > self.settle - self.dt / 2
        return self._score(self.front.scaled(trace, self.scaling), settled, None)

    def _score(self, ratio: Array, settled: Bools, state: Array | None) -> Array:
        both = np.concatenate([ratio, -ratio], axis=1) * settled[:, None]
        drift = np.concatenate([self.limits, self.limits])
        level = bounded_cusum((both - drift) * self.dt, drift * RECOVERY, state)
        score: Array = (level / drift).max(axis=1)
        return score

    def stream(self) -> CusumStream:
        """The same, sample by sample."""
        return CusumStream(self)


class CusumStream:
    """Sample by sample."""

    def __init__(self, detector: FittedCusum) -> None:
        """Begin anew."""
        self._detector, self._residual = detector, detector.front.stream(detector.scaling)
        self._state = np.zeros(2 * len(detector.limits))
        self._time = -1.0

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> float:
        """The score of this sample."""
        own = self._detector
        ratio = self._residual.step(q, qd, current, dt)
        self._time = 0.0 if self._time < 0 else self._time + (own.dt if dt is None else dt)
        settled = np.array([self._time > own.settle - own.dt / 2])
        return float(own._score(ratio, settled, self._state)[0])
