"""A collision detector behind one object: estimator, features, regressor, threshold, filter."""

from __future__ import annotations

import copy
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.calibration.calibrate import calibrate, free_rows
from tauguard.detectors.dynamics.friction import FrictionModel
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.detectors.estimation.estimator import ArmModel, Estimate, Estimator, Unknowns
from tauguard.detectors.evaluation.events import find_alarms
from tauguard.detectors.features.training import (
    Prepared,
    binary_target,
    draw_windows,
    peaks,
    severity_target,
)
from tauguard.detectors.features.windows import Envelope, Features, WindowShape, median_distance
from tauguard.detectors.methods.svr_regressor import SrqSVR
from tauguard.detectors.thresholds.confirmation import (
    CONFIRMATION,
    Confirmation,
    confirmation_samples,
    confirmed,
)
from tauguard.detectors.thresholds.rates import sustained, threshold_for_rate
from tauguard.traces.trace import Detection, Trace

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DetectorSettings:
    """What can be chosen about a detector; the defaults are what worked, the plain form below."""

    joints: tuple[int, ...] = (1, 2, 3, 4)  #: whose residuals feed the features, 1-based
    observer_gain: float = 200.0  #: [1/s]
    window: float = 80e-3  #: t_W [s]
    interval: float = 8e-3  #: t_I [s]
    confirmation: float = CONFIRMATION  #: t_c [s]
    sigma: float = 3.0  #: of the SRQ kernel
    C: float = 1.0
    epsilon: float = 0.02
    units: float = 5.0  #: envelopes of free motion that count one before the asinh
    distance: float = 2.0
    """Median distance of struck to free windows after scaling; 0 leaves the windows unscaled."""
    reference: tuple[float, ...] = (20.0, 20.0, 15.0, 6.0)
    """Torque that counts 1 in the training target, one a chosen joint (the last is repeated)."""
    windows: int = 3000  #: for the regressor
    mined: int = 300  #: worst moments of free motion added as negatives, in each of two rounds
    held_out: float = 0.34  #: share of the free traces kept for the threshold, never mined
    false_alarms_per_hour: float = 10.0  #: to accept when the threshold is chosen
    settle: float = 3.0  #: at the beginning of a trace, never an alarm [s]
    calibrate: bool = True  #: identify friction, inertia and gains from the free motion
    adapt: bool = True  #: track payload, offsets and friction errors
    plain: bool = False
    """The dissertation's form: raw residuals times one factor, labels 0/1, no mining."""
    seed: int = 0  #: of the windows drawn

    @classmethod
    def plain_form(cls, **changes: object) -> DetectorSettings:
        """The dissertation's features and labels on the nominal observer.

        Residuals in N m lie some 100 apart, where a kernel of sigma = 3 is diagonal and nothing is
        learnt; one factor for all joints brings the median distance to sigma. ``distance=0``
        gives the literal form without it.
        """
        plain = cls(plain=True, calibrate=False, adapt=False, mined=0, settle=0.5, distance=3.0)
        return replace(plain, **changes)  # type: ignore[arg-type]

    def references(self, joints: int) -> Array:
        """One reference torque for each chosen joint [N m]."""
        own = list(self.reference) + [self.reference[-1]] * joints
        return np.array(own[:joints])


class CollisionDetector:
    """Momentum observer, SVR with the SRQ kernel, threshold and output filter."""

    name = "srq-svr"

    def __init__(self, settings: DetectorSettings | None = None) -> None:
        """Keep the settings; :meth:`fit` or :meth:`load` makes the detector whole."""
        self.settings = settings or DetectorSettings()
        self.arm: ArmModel | None = None
        self.features: Features | None = None
        self.regressor: SrqSVR | None = None
        self.threshold = float("inf")
        self.dt = 1e-3
        self._online: _Online | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        """What the sample rate could not carry, for the user to read."""
        return self.features.notes if self.features else ()

    def _fitted(self) -> tuple[ArmModel, Features, SrqSVR]:
        if self.arm is None or self.features is None or self.regressor is None:
            raise ValueError("this detector is not fitted: call fit or load first")
        return self.arm, self.features, self.regressor

    def at(self, threshold: float, confirmation: float) -> CollisionDetector:
        """The same detector with another threshold and confirmation [s]; nothing is copied."""
        other = copy.copy(self)
        other.settings = replace(self.settings, confirmation=confirmation)
        other.threshold = float(threshold)
        other.reset()
        return other

    # -- training ---------------------------------------------------------------------------------

    def fit(
        self,
        traces: Sequence[Trace],
        robot: RobotNumbers,
        drive_gain: Array,
        *,
        friction: FrictionModel | None = None,
        quiet: Sequence[Trace] | None = None,
    ) -> CollisionDetector:
        """Calibrate the arm model, train the regressor and choose the threshold.

        Args:
            traces: with truth, of one arm at one sample rate; some with collisions, some without.
            robot: nominal numbers.
            drive_gain: nominal N m per ampere, shape (n,).
            friction: friction model to use, or the columns to identify.
            quiet: collision-free traces for the threshold alone (default: a share
                ``held_out`` of the traces without a collision).

        Returns:
            Itself.

        Raises:
            ValueError: no collision or no free motion, or joints that do not exist.
        """
        settings = self.settings
        if not traces:
            raise ValueError("no traces to train on")
        chosen = tuple(j - 1 for j in settings.joints)
        if not chosen or min(chosen) < 0 or max(chosen) >= robot.joints:
            raise ValueError(f"joints {settings.joints}: expected some of 1 to {robot.joints}")
        self.dt = float(np.median([trace.dt for trace in traces]))
        train, held = self._split(traces, quiet)
        arm = ArmModel(robot, drive_gain, friction if friction and len(friction.weights) else None)
        if settings.calibrate:
            arm = calibrate(arm, train, friction=friction).arm
        self.arm = arm
        estimates = [self._estimate(trace) for trace in train]
        self.features = self._make_features(train, estimates, chosen)
        prepared = [self._prepare(t, e) for t, e in zip(train, estimates, strict=True)]
        self.regressor = self._train(prepared)
        levels = []
        for trace in held:
            level = sustained(self._score(self._estimate(trace), trace), self._samples())
            levels.append(level[free_rows(trace, settings.settle)])
        self.threshold = threshold_for_rate(levels, self.dt, settings.false_alarms_per_hour)
        self._online = None
        return self

    def _split(
        self, traces: Sequence[Trace], quiet: Sequence[Trace] | None
    ) -> tuple[list[Trace], list[Trace]]:
        """Traces to train on, and those for the threshold."""
        if quiet is not None:
            return list(traces), list(quiet)
        empty = [i for i, t in enumerate(traces) if not (t.truth and t.truth.collisions)]
        share = self.settings.held_out
        count = min(len(empty) - 1, max(1, round(share * len(empty)))) if len(empty) > 1 else 0
        if count == 0:
            return list(traces), list(traces)
        # Evenly through the list, which often goes through speeds and payloads in turn.
        kept = {empty[round((k + 0.5) * len(empty) / count - 0.5)] for k in range(count)}
        train = [t for i, t in enumerate(traces) if i not in kept]
        return train, [traces[i] for i in sorted(kept)]

    def _estimate(self, trace: Trace) -> Estimate:
        assert self.arm is not None
        unknowns = Unknowns.wary() if self.settings.adapt else Unknowns.none()
        estimator = Estimator(self.arm, self.settings.observer_gain, self.dt, unknowns)
        return estimator.run(trace.t, trace.q, trace.qd, trace.current)

    def _samples(self) -> int:
        return confirmation_samples(self.settings.confirmation, self.dt)

    def _make_features(
        self, traces: Sequence[Trace], estimates: Sequence[Estimate], chosen: tuple[int, ...]
    ) -> Features:
        settings = self.settings
        shape = WindowShape.at(self.dt, settings.window, settings.interval, settings.confirmation)
        notes = (shape.note,) if shape.note else ()
        if settings.plain:
            features = Features(chosen, shape, None, 1.0, 1.0, False, notes)
        else:
            envelope = self._envelope(traces, estimates)
            features = Features(chosen, shape, envelope, 1.0, settings.units, True, notes)
        if settings.distance <= 0:
            return features
        rng = np.random.default_rng(settings.seed)
        prepared = [self._prepare(t, e, features) for t, e in zip(traces, estimates, strict=True)]
        windows, target = draw_windows(rng, prepared, features, 1000)
        spread = median_distance(windows[target > 0], windows[target == 0], rng)
        factor = settings.distance / spread if spread > 0 else 1.0
        return replace(features, factor=factor)

    def _envelope(self, traces: Sequence[Trace], estimates: Sequence[Estimate]) -> Envelope:
        """What free motion leaves of the residual, from every fifth row."""
        free = [free_rows(trace, self.settings.settle) for trace in traces]
        thin = [np.flatnonzero(f)[::5] for f in free]
        left, qd, acceleration = (
            np.concatenate([value[rows] for value, rows in zip(values, thin, strict=True)])
            for values in (
                [e.left for e in estimates],
                [t.qd for t in traces],
                [e.acceleration for e in estimates],
            )
        )
        return Envelope.fit(left, qd, acceleration)

    def _prepare(
        self, trace: Trace, estimate: Estimate, features: Features | None = None
    ) -> Prepared:
        settings = self.settings
        features = features or self.features
        assert features is not None
        signal = features.signal(estimate.left, trace.qd, estimate.acceleration)
        if settings.plain:
            target = binary_target(trace)
            struck = target > 0
        else:
            joints = features.joints
            reference = settings.references(len(joints))
            target = severity_target(trace, joints, reference, settings.observer_gain)
            struck = target > 0.05
        settled = trace.t >= trace.t[0] + settings.settle
        return Prepared(signal, target, free_rows(trace, settings.settle), struck & settled)

    def _train(self, prepared: Sequence[Prepared]) -> SrqSVR:
        settings = self.settings
        assert self.features is not None
        rng = np.random.default_rng([settings.seed, 1])
        x, y = draw_windows(rng, prepared, self.features, settings.windows)
        regressor = SrqSVR(settings.sigma, settings.C, settings.epsilon).fit(x, y)
        for _ in range(2 if settings.mined else 0):
            hardest = []
            share = -(-settings.mined // len(prepared))
            for p in prepared:
                rows = np.flatnonzero(p.free)[:: self._thin()]
                score = regressor.predict(self.features.windows(p.signal, rows))
                worst = peaks(score, share, max(1, self._gap() // self._thin()))
                hardest.append(self.features.windows(p.signal, rows[worst]))
            x = np.concatenate([x, *hardest])
            y = np.concatenate([y, np.zeros(len(x) - len(y))])
            regressor = SrqSVR(settings.sigma, settings.C, settings.epsilon).fit(x, y)
        return regressor

    def _gap(self) -> int:
        """Rows between two mined moments: 0.1 s."""
        return max(1, round(0.1 / self.dt))

    def _thin(self) -> int:
        """Mining looks at rows half of t_I apart: windows next to each other are alike."""
        return max(1, round(self.settings.interval / self.dt / 2))

    # -- detection --------------------------------------------------------------------------------

    def _scores(self, regressor: SrqSVR, signal: Array) -> Array:
        assert self.features is not None
        out = np.empty(len(signal))
        shape = self.features.shape
        regressor.kernel_sum().series(signal, shape.lag, shape.count, out, 0)
        return out

    def _score(self, estimate: Estimate, trace: Trace) -> Array:
        _, features, regressor = self._fitted()
        signal = features.signal(estimate.left, trace.qd, estimate.acceleration)
        return self._scores(regressor, signal)

    def detect(self, trace: Trace) -> Detection:
        """Judge a trace; no alarm within the first ``settle`` seconds.

        Raises:
            ValueError: not fitted, another number of joints, or another sample rate.
        """
        arm, _, _ = self._fitted()
        if len(trace.joint_names) != arm.robot.joints:
            raise ValueError(
                f"the trace has {len(trace.joint_names)} joints, this detector "
                f"{arm.robot.joints}: {', '.join(arm.robot.joint_names)}"
            )
        if len(trace.t) > 1 and not 0.8 < trace.dt / self.dt < 1.25:
            raise ValueError(
                f"the trace has a sample every {1e3 * trace.dt:g} ms, this detector was trained "
                f"at {1e3 * self.dt:g} ms: resample the recording to that, "
                "or train a detector on recordings of its rate"
            )
        estimate = self._estimate(trace)
        score = self._score(estimate, trace)
        settled = trace.t - trace.t[0] >= self.settings.settle
        raw = (score > self.threshold) & settled
        alarm = confirmed(raw, self._samples())
        alarms = find_alarms(trace.t, alarm)
        return Detection(self.name, trace.t, estimate.left, score, self.threshold, alarm, alarms)

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> bool:
        """Judge one sample online; equal to :meth:`detect` on the same samples.

        Args:
            q: [rad], float64, shape (n,).
            qd: [rad/s], shape (n,).
            current: [A], shape (n,).
            dt: time since the last sample [s] (default: that of the training traces).

        Returns:
            Whether the alarm is up.

        Raises:
            ValueError: not fitted, wrong shapes, numbers that are not finite.
        """
        if self._online is None:
            self._online = _Online(self)
        return self._online.step(q, qd, current, dt)

    @property
    def score(self) -> float:
        """The output at the last online sample."""
        return self._online.score if self._online else 0.0

    @property
    def residual(self) -> Array:
        """What the model does not explain at the last online sample [N m], shape (n,)."""
        arm, _, _ = self._fitted()
        return self._online.left.copy() if self._online else np.zeros(arm.robot.joints)

    def reset(self) -> None:
        """Begin online detection anew."""
        self._online = None

    # -- files ------------------------------------------------------------------------------------

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a model file (see :func:`tauguard.detectors.model_file.save_detector`)."""
        from tauguard.detectors.model_file import save_detector

        save_detector(self, path)

    @staticmethod
    def load(path: str | os.PathLike[str]) -> CollisionDetector:
        """Read a model file (see :func:`tauguard.detectors.model_file.load_detector`)."""
        from tauguard.detectors.model_file import load_detector

        return load_detector(path)

    def describe(self) -> dict[str, object]:
        """Settings and what training found, for reports."""
        arm, features, regressor = self._fitted()
        return asdict(self.settings) | {
            "threshold": self.threshold,
            "support_vectors": len(regressor.support_vectors_),
            "factor": features.factor,
            "robot_joints": arm.robot.joints,
        }


class _Online:
    """State of a detector that runs sample by sample."""

    def __init__(self, detector: CollisionDetector) -> None:
        arm, features, regressor = detector._fitted()
        settings = detector.settings
        unknowns = Unknowns.wary() if settings.adapt else Unknowns.none()
        self._estimator = Estimator(arm, settings.observer_gain, detector.dt, unknowns)
        self._sliding = features.sliding(regressor.kernel_sum())
        self._filter = Confirmation(detector._samples())
        self._threshold, self._settle = detector.threshold, settings.settle
        self._out = tuple(np.zeros((3, arm.robot.joints)))
        self._dt, self._time, self._first = detector.dt, 0.0, True
        self.score = 0.0

    @property
    def left(self) -> Array:
        """Row of the estimator's output that the features see [N m], shape (n,)."""
        return self._out[1]

    def step(self, q: Array, qd: Array, current: Array, dt: float | None) -> bool:
        self._estimator.step(q, qd, current, self._out, dt)
        if not self._first:
            self._time += self._dt if dt is None else dt
        self._first = False
        self.score = self._sliding.step(self._out[1], qd, self._out[2])
        return self._filter.step(self.score > self._threshold and self._time >= self._settle)
