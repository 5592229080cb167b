"""The calibrated arm, its estimator and noise model; residuals in standard deviations.

Scaling decides whether the SVR works: raw residuals in N m have a median distance near 100, which
makes the matrix of a kernel of length sigma = 3 almost diagonal. Each joint's residual is divided
by its standard deviation, compressed by asinh (a hard impact must stay within the region of the
training data) and multiplied by one factor.
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
from tauguard.detectors.frozen import Frozen
from tauguard.detectors.samples import check_trace, common_interval
from tauguard.traces.trace import Trace


@dataclass(frozen=True, eq=False)
class Scaling(Frozen):
    """``factor asinh(residual / (units deviation))`` of the chosen joints."""

    joints: tuple[int, ...]  #: 0-based
    noise_model: NoiseModel | None = None  #: None: ``factor residual`` in N m
    units: float = 1.0  #: standard deviations that count one
    factor: float = 1.0
    compress: bool = False  #: by asinh

    def __post_init__(self) -> None:
        """Check: ``ValueError``."""
        if not self.joints or not (self.units > 0 and np.isfinite(self.factor)):
            raise ValueError(f"Scaling: {self}, expected some joints, units > 0, a finite factor")

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
            motion: of the estimate, shape (T, 4, n).
        """
        found = np.empty((len(residual), len(self.joints)))
        self._native.rows(residual, qd, motion, found)
        return found


class NativeStream:
    """The scores of one recording as its samples come in.

    Attributes:
        native: what gives them.
    """

    def __init__(self, native: _observer.Scores, dt: float) -> None:
        """Take the native stream and the interval of steps that do not say theirs [s]."""
        self.native, self._dt = native, dt

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> float:
        """The score of this sample.

        Args:
            q: [rad], float64, shape (n,).
            qd: [rad/s], shape (n,).
            current: [A], shape (n,).
            dt: time since the last sample [s] (default: the constructor's).

        Raises:
            ValueError: wrong shapes or numbers that are not finite; the state is as before.
        """
        try:
            return self.native.step(q, qd, current, self._dt if dt is None else dt)
        except TypeError:
            raise ValueError(
                f"q, qd, current: expected float64 arrays of shape ({self.native.joints},)"
            ) from None


#: One sample in so many seconds of collision-free motion is enough to fit a noise model.
THIN = 5e-3


@dataclass(frozen=True)
class FrontEndSettings:
    """How the residual is estimated."""

    gain: float = DETECTION_GAIN  #: of the observer [1/s]
    adapt: bool = True  #: track payload, offsets and friction errors
    settle: float = 3.0  #: until the payload is found [s]
    joints: tuple[int, ...] = (1, 2, 3, 4)  #: that are used, 1-based; those that exist
    calibrate: bool = True  #: identify friction, inertia and gains from the collision-free motion

    def fit(self, traces: Sequence[Trace], arm: ArmModel) -> FrontEnd:
        """Identify the arm and its noise model from the collision-free rows.

        The last result for these settings is kept while its traces live: methods with equal
        settings use the same.

        Raises:
            ValueError: traces that do not fit, or without collision-free motion, or joints that
                do not exist.
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
            raise ValueError(f"joints {self.joints}: expected some of 1 to {count}")
        thin = max(1, round(THIN / dt))
        free = [np.flatnonzero(rows)[::thin] for rows in undisturbed_rows(traces, self.settle)]
        if not sum(len(rows) for rows in free):
            raise ValueError(
                f"no collision-free motion after the first {self.settle:g} s of any trace"
            )
        if self.calibrate:
            arm = calibrate(arm, traces, friction=arm.friction).arm
        bare = self.bare(joints, arm, dt)
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

    def bare(self, joints: tuple[int, ...], arm: ArmModel, dt: float) -> FrontEnd:
        """The front end of a calibrated arm before its noise model is known."""
        return FrontEnd(self.gain, self.adapt, self.settle, joints, arm, dt)


@dataclass(frozen=True, eq=False)
class FrontEnd(Frozen):
    """A fitted front end: from a trace to the residual that the model does not explain."""

    gain: float  #: of the observer [1/s]
    adapt: bool  #: track payload, offsets and friction errors
    settle: float  #: [s]
    joints: tuple[int, ...]  #: that are used, 0-based
    arm: ArmModel  #: calibrated
    dt: float  #: sample interval [s]

    def __post_init__(self) -> None:
        """Check: ``ValueError``."""
        if not (self.dt > 0 and self.gain > 0 and self.settle >= 0):
            raise ValueError(f"dt {self.dt}, gain {self.gain}, settle {self.settle}: out of range")
        if not self.joints or not 0 <= min(self.joints) <= max(self.joints) < self.arm.robot.joints:
            raise ValueError(f"joints {self.joints}: expected some of 0 to below the arm's number")

    def estimator(self) -> Estimator:
        """A fresh estimator of this arm."""
        unknowns = Unknowns.for_detection() if self.adapt else Unknowns.none()
        return Estimator(self.arm, self.gain, self.dt, unknowns, sampled=self.dt > SLOWEST)

    def estimate(self, trace: Trace) -> Estimate:
        """The estimate of a trace; the last one is kept while the trace lives.

        Raises:
            ValueError: another arm or another rate.
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
    """Keep the estimate until the trace dies or another front end estimates it."""
    if id(trace) not in _ESTIMATES:
        weakref.finalize(trace, _ESTIMATES.pop, id(trace), None)
    _ESTIMATES[id(trace)] = front, estimate


def plain_residual(arm: ArmModel, trace: Trace) -> Array:
    """The residual of the plain observer, without unknowns [N m], shape (T, n).

    A front end of this arm that has just estimated the trace has it already.
    """
    front, known = _ESTIMATES.get(id(trace), (None, None))
    if front is not None and known is not None and front.arm is arm:
        return known.plain
    estimator = Estimator(arm, PLAIN_GAIN, trace.dt, Unknowns.none(), sampled=trace.dt > SLOWEST)
    return estimator.run(trace.t, trace.q, trace.qd, trace.current).residual


class OnFrontEnd(Frozen):
    """Base of fitted methods that stand on a front end: what they know is what it knows."""

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
        """Until the estimator has settled and found the payload [s]."""
        return self.front.settle
