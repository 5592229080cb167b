"""The calibrated arm with estimator and noise model, and residuals in standard deviations.

The SVR needs scaled residuals: residuals in N m have a median distance near 100, at which the
matrix of a kernel of length sigma = 3 is almost diagonal. Each joint's residual is divided by its
standard deviation, compressed by asinh and multiplied by a factor. The asinh keeps hard impacts
within the region of the training data.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors import _kernel, _observer
from tauguard.detectors.calibration.calibrate import calibrate
from tauguard.detectors.estimation.estimator import ArmModel, Estimate, Estimator, Unknowns
from tauguard.detectors.estimation.noise_model import NoiseModel
from tauguard.detectors.estimation.observer import DETECTION_GAIN, PLAIN_GAIN
from tauguard.detectors.estimation.velocity import SLOWEST
from tauguard.detectors.events import undisturbed_rows
from tauguard.detectors.frozen import Frozen, Unshared
from tauguard.detectors.samples import check_trace, common_interval
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace


@dataclass(frozen=True, eq=False)
class Scaling(Frozen):
    """``factor asinh(residual / (units deviation))`` of the chosen joints."""

    joints: tuple[int, ...]  #: 0-based
    noise_model: NoiseModel | None = None  #: None: ``factor residual`` in N m
    units: float = 1.0  #: number of standard deviations with the scaled value 1
    factor: float = 1.0
    compress: bool = False  #: compress by asinh

    def __post_init__(self) -> None:
        """Check: ``ArgumentError``."""
        if not self.joints or not (self.units > 0 and np.isfinite(self.factor)):
            raise ArgumentError(
                f"Scaling: {self}, expected some joints, units > 0, a finite factor"
            )

    @property
    def numbers(self) -> tuple[list[int], list[float], float, float, bool]:
        """Arguments of the native forms: joints, noise weights, units, factor, compress."""
        weights = [] if self.noise_model is None else self.noise_model.weights.ravel().tolist()
        return list(self.joints), weights, self.units, self.factor, self.compress

    @cached_property
    def _native(self) -> _kernel.Scaling:
        return _kernel.Scaling(*self.numbers)

    def rows(self, residual: Array, qd: Array, motion: Array) -> Array:
        """The scaled residual, shape (T, len(joints)).

        Args:
            residual: [N m], shape (T, n).
            qd: [rad/s], shape (T, n).
            motion: ``Estimate.motion``, shape (T, 4, n).
        """
        found = np.empty((len(residual), len(self.joints)))
        self._native.rows(residual, qd, motion, found)
        return found


class NativeStream(Unshared):
    """The scores of one recording, computed sample by sample.

    Attributes:
        native: the C++ stream.
    """

    def __init__(self, native: _observer.Scores, dt: float) -> None:
        """Keep the native stream and the default interval of steps [s]."""
        self.native, self._dt = native, dt

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> float:
        """As :meth:`~tauguard.detectors.ScoreStream.step`; the state is kept after an error."""
        try:
            return self.native.step(q, qd, current, self._dt if dt is None else dt)
        except TypeError:
            raise ArgumentError(
                f"q, qd, current: expected float64 arrays of shape ({self.native.joints},)"
            ) from None


#: Interval of the collision-free samples that a noise model is fitted to [s].
THIN = 5e-3


@dataclass(frozen=True)
class FrontEndSettings:
    """Settings of the estimation of the residual."""

    gain: float = DETECTION_GAIN  #: of the observer [1/s]
    adapt: bool = True  #: estimate payload, offsets and friction errors
    settle: float = 3.0  #: time until the payload is estimated [s]
    joints: tuple[int, ...] = (
        1,
        2,
        3,
        4,
    )  #: used joints, 1-based; missing ones are left out
    calibrate: bool = True  #: identify friction, inertia and gains from the collision-free motion

    def fit(self, traces: Sequence[Trace], arm: ArmModel) -> FrontEnd:
        """Identify the arm and its noise model from the collision-free rows.

        Equal settings return their last result again if traces and arm are the same objects.

        Raises:
            ArgumentError: traces of different arms or rates, or without collision-free motion, or
                no joint of ``joints`` exists.
        """
        given = (*traces, arm)
        known, found = _FITTED.get(self, ((), None))
        same = len(known) == len(given) and all(
            ref() is value for ref, value in zip(known, given, strict=True)
        )
        if found is None or not same:
            found = self._fit(traces, arm)
            _FITTED[self] = tuple(weakref.ref(value) for value in given), found
        return found

    def _fit(self, traces: Sequence[Trace], arm: ArmModel) -> FrontEnd:
        dt, count = common_interval(traces, arm.robot.joint_names), arm.robot.joints
        joints = tuple(j - 1 for j in self.joints if 1 <= j <= count)
        if not joints:
            raise ArgumentError(f"joints {self.joints}: expected some of 1 to {count}")
        thin = max(1, round(THIN / dt))
        free = [np.flatnonzero(rows)[::thin] for rows in undisturbed_rows(traces, self.settle)]
        if not sum(len(rows) for rows in free):
            raise ArgumentError(
                f"no collision-free motion after the first {self.settle:g} s of any trace"
            )
        if self.calibrate:
            arm = calibrate(arm, traces, friction=arm.friction).arm
        bare = self.without_noise_model(joints, arm, dt)
        estimates = [bare.estimator().run(t.t, t.q, t.qd, t.current) for t in traces]
        tables = (
            [e.unexplained for e in estimates],
            [t.qd for t in traces],
            [e.motion for e in estimates],
        )
        noise_model = NoiseModel.fit(
            *(
                np.concatenate([values[rows] for values, rows in zip(own, free, strict=True)])
                for own in tables
            )
        )
        found = replace(bare, arm=replace(arm, noise_model=noise_model))
        for trace, estimate in zip(traces, estimates, strict=True):
            _remember(trace, found, estimate)
        return found

    def without_noise_model(self, joints: tuple[int, ...], arm: ArmModel, dt: float) -> FrontEnd:
        """The front end of a calibrated arm before its noise model is known."""
        return FrontEnd(self.gain, self.adapt, self.settle, joints, arm, dt)


@dataclass(frozen=True, eq=False)
class FrontEnd(Frozen):
    """A fitted front end, which computes the unexplained residual of a trace."""

    gain: float  #: of the observer [1/s]
    adapt: bool  #: estimate payload, offsets and friction errors
    settle: float  #: time until the payload is estimated [s]
    joints: tuple[int, ...]  #: joints that are used, 0-based
    arm: ArmModel  #: calibrated
    dt: float  #: sample interval [s]

    def __post_init__(self) -> None:
        """Check: ``ArgumentError``."""
        if not (self.dt > 0 and self.gain > 0 and self.settle >= 0):
            raise ArgumentError(
                f"dt {self.dt}, gain {self.gain}, settle {self.settle}: out of range"
            )
        if not self.joints or not 0 <= min(self.joints) <= max(self.joints) < self.arm.robot.joints:
            raise ArgumentError(
                f"joints {self.joints}: expected some of 0 to below the arm's number"
            )

    def estimator(self) -> Estimator:
        """A new estimator of this arm."""
        unknowns = Unknowns.for_detection() if self.adapt else Unknowns.none()
        return Estimator(self.arm, self.gain, self.dt, unknowns, sampled=self.dt > SLOWEST)

    def estimate(self, trace: Trace) -> Estimate:
        """The estimate of a trace, cached as long as the trace exists.

        Raises:
            ArgumentError: another arm or another rate.
        """
        front, known = _ESTIMATES.get(id(trace), (None, None))
        if front is self and known is not None:
            return known
        check_trace(trace, self.arm.robot.joints, self.dt)
        found = self.estimator().run(trace.t, trace.q, trace.qd, trace.current)
        _remember(trace, self, found)
        return found

    def scaling(self, units: float = 1.0) -> Scaling:
        """The residual over ``units`` standard deviations."""
        return Scaling(self.joints, self.arm.noise_model, units)

    def scaled(self, trace: Trace, scaling: Scaling) -> Array:
        """The scaled residual of a trace, shape (T, joints)."""
        estimate = self.estimate(trace)
        return scaling.rows(estimate.unexplained, trace.qd, estimate.motion)


_FITTED: dict[FrontEndSettings, tuple[tuple[weakref.ref[object], ...], FrontEnd]] = {}

_ESTIMATES: dict[int, tuple[FrontEnd, Estimate]] = {}


def _remember(trace: Trace, front: FrontEnd, estimate: Estimate) -> None:
    """Cache the estimate until the trace is deleted or another front end estimates it."""
    if id(trace) not in _ESTIMATES:
        weakref.finalize(trace, _ESTIMATES.pop, id(trace), None)
    _ESTIMATES[id(trace)] = front, estimate


def plain_residual(arm: ArmModel, trace: Trace) -> Array:
    """The observer's residual if no unknowns are estimated [N m], shape (T, n).

    It is taken from the cached estimate of a front end of this arm if there is one.
    """
    front, known = _ESTIMATES.get(id(trace), (None, None))
    if front is not None and known is not None and front.arm is arm:
        return known.plain
    estimator = Estimator(arm, PLAIN_GAIN, trace.dt, Unknowns.none(), sampled=trace.dt > SLOWEST)
    return estimator.run(trace.t, trace.q, trace.qd, trace.current).residual


class OnFrontEnd(Frozen):
    """Base of fitted methods with a front end, from which arm, interval and settling time come."""

    front: FrontEnd

    @property
    def arm(self) -> ArmModel:
        """The calibrated arm."""
        return self.front.arm

    @property
    def dt(self) -> float:
        """Sample interval [s]."""
        return self.front.dt

    @property
    def settle(self) -> float:
        """Time until the estimator has settled and estimated the payload [s]."""
        return self.front.settle
