"""A detector that learns from collision-free motion alone.

Estimator (friction, momentum observer, payload and slow offsets tracked), then per joint the
residual that is left over its allowance: what collision-free motion leaves at that speed and
acceleration, apart for joints that stand still. Static friction is indeterminate there: the torque
of a joint at rest wanders with the others' motion, which the tracked offset follows.

Allowances come from residuals of logs that the calibration in use did not see: every training log
is judged by a calibration from the others, as new logs will be. Each joint's allowance at rest and
in motion is scaled to its own share of the false alarms to accept, so that 1 is the threshold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.allowance import Allowance, terms, torque_change
from tauguard.detectors.detector import check_interval, common_interval
from tauguard.detectors.estimator import ArmModel, Estimator, Unknowns
from tauguard.detectors.events import find_alarms
from tauguard.detectors.filter import confirmation_samples, confirmed
from tauguard.detectors.identification import (
    REAL_FRICTION,
    Beliefs,
    Recording,
    filtered,
    identify,
)
from tauguard.detectors.operating_point import sustained, threshold_for_rate
from tauguard.detectors.thresholds import still
from tauguard.traces.trace import Bools, Detection, Trace

Array = NDArray[np.float64]

#: Travel after which a joint that stood still counts as moving [rad].
RELEASE = 5e-3


@dataclass(frozen=True)
class FreeMotionSettings:
    """What can be chosen; the defaults are for real arms at 100 Hz and above."""

    observer_gain: float = 20.0  #: [1/s]
    confirmation: float = 0.04  #: t_c [s]
    settle: float = 2.0  #: seconds at the beginning that are never an alarm
    false_alarms_per_hour: float = 1.0  #: to accept when the allowances are scaled
    spike: bool = True
    """Take the median of three successive currents: a controller's kick of one sample, as at a
    commanded stop, says nothing about contact. It costs one sample of delay."""
    unknowns: Unknowns = field(default_factory=Unknowns)  #: what is tracked
    beliefs: Beliefs = field(default_factory=Beliefs)  #: of the calibration


@dataclass(frozen=True)
class Judged:
    """What the detector sees of a trace; rows are samples."""

    left: Array  #: residual that the tracked unknowns do not explain [N m], shape (T, n)
    terms: Array  #: of the allowances, shape (T, n, 5)
    rest: Bools  #: which joints stand still, shape (T, n)


@dataclass
class FreeMotionDetector:
    """Calibration and allowances from logs in which nothing touched the arm."""

    settings: FreeMotionSettings = field(default_factory=FreeMotionSettings)
    name: str = "free-motion"
    model: ArmModel | None = None
    resting: Allowance | None = None
    moving: Allowance | None = None
    dt: float = 0.0  #: sample interval of the training logs [s]
    seconds: float = 0.0  #: of motion that the allowances rest on
    left_out: list[int] = field(default_factory=list)
    """Alarms in each training log under the calibration from the others; not a test, since the
    allowances have seen its residual."""

    threshold = 1.0  #: of the score

    @property
    def settle(self) -> float:
        """Seconds at the beginning of a trace whose scores mean nothing yet."""
        return self.settings.settle

    @property
    def arm(self) -> ArmModel:
        """The calibrated arm."""
        return self._fitted()[0]

    def _fitted(self) -> tuple[ArmModel, Allowance, Allowance]:
        if self.model is None or self.resting is None or self.moving is None:
            raise ValueError("this detector is not fitted: call fit or load first")
        return self.model, self.resting, self.moving

    # -- training ---------------------------------------------------------------------------------

    def fit(self, traces: Sequence[Trace | Recording], robot: ArmModel) -> FreeMotionDetector:
        """Calibrate, then learn allowances from left-out logs.

        Args:
            traces: collision-free logs, three or more; plain traces count as without a load.
            robot: nominal numbers and drive gains, whose scale holds.

        Raises:
            ValueError: fewer than three logs, other joints, different sample rates.
        """
        recordings = [r if isinstance(r, Recording) else Recording(r) for r in traces]
        if len(recordings) < 3:
            raise ValueError(f"{len(recordings)} logs: give three or more, to leave each out once")
        self.dt = common_interval([r.trace for r in recordings], robot)
        bare = replace(robot.friction or REAL_FRICTION, weights=np.empty((0, 0)))
        gain, beliefs = self.settings.observer_gain, self.settings.beliefs
        numbers, drive = robot.robot, robot.drive_gain
        data = [filtered(r, numbers, drive, bare, gain, beliefs.rest) for r in recordings]

        def without(k: int) -> ArmModel:
            use = [i for i in range(len(recordings)) if i != k]
            return identify(
                robot,
                [recordings[i] for i in use],
                friction=bare,
                beliefs=beliefs,
                rate=gain,
                data=[data[i] for i in use],
            ).arm

        self.model = without(-1)
        assert self.model.friction is not None
        judged = [self._judged(without(k), r.trace) for k, r in enumerate(recordings)]
        self._learn(judged, self.model.friction.coulomb())
        self.left_out = [self._alarms(part) for part in judged]
        return self

    def _learn(self, judged: Sequence[Judged], coulomb: Array) -> None:
        """Allowances of left-out residuals, scaled to the false alarms to accept."""
        first = int(np.ceil(self.settings.settle / self.dt))
        parts = [Judged(j.left[first:], j.terms[first:], j.rest[first:]) for j in judged]
        left, columns, rest = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("left", "terms", "rest")
        )
        self.seconds = len(left) * self.dt
        at_rest = self._scaled(Allowance.fit(left, columns, rest), parts, True)
        # In motion friction's share is known, and changes of torque allow nothing.
        steady = columns.copy()
        steady[..., -1] = 0.0
        moving = self._scaled(Allowance.fit(left, steady, ~rest), parts, False)
        self.resting, self.moving = at_rest.at_least(coulomb, 1.0), moving.at_least(coulomb, 0.5)

    def _scaled(self, allowance: Allowance, parts: Sequence[Judged], resting: bool) -> Allowance:
        """Each joint's allowance times its threshold for a share of the false alarms."""
        joints = len(allowance.weights)
        rate = self.settings.false_alarms_per_hour / (2 * joints)
        levels: list[list[Array]] = [[] for _ in range(joints)]
        for part in parts:
            ratio = np.abs(part.left) / allowance.scale(part.terms)
            ratio[part.rest != resting] = 0.0
            for j in range(joints):
                levels[j].append(sustained(ratio[:, j], self._samples()))
        return allowance.times(np.array([threshold_for_rate(own, self.dt, rate) for own in levels]))

    # -- detection --------------------------------------------------------------------------------

    def _samples(self) -> int:
        return confirmation_samples(self.settings.confirmation, self.dt)

    def _judged(self, model: ArmModel, trace: Trace) -> Judged:
        t, q, qd, current = trace.t, trace.q, trace.qd, trace.current
        if self.settings.spike:
            q, qd, current = delayed(q), delayed(qd), median_of_three(current)
        gain = self.settings.observer_gain
        found = Estimator(model, gain, self.dt, self.settings.unknowns).run(t, q, qd, current)
        change = torque_change(model.robot, t, q, qd, gain)
        return Judged(found.left, terms(qd, found.acceleration, change), resting(q, qd, self.dt))

    def _checked(self, trace: Trace) -> Judged:
        model = self._fitted()[0]
        if len(trace.joint_names) != model.robot.joints:
            raise ValueError(
                f"the trace has {len(trace.joint_names)} joints, this detector "
                f"{model.robot.joints}: {', '.join(model.robot.joint_names)}"
            )
        check_interval("the trace", trace, self.dt)
        return self._judged(model, trace)

    def ratios(self, trace: Trace) -> Array:
        """Each joint's residual over its allowance, shape (T, n).

        Raises:
            ValueError: not fitted, other joints or another sample rate than the training's.
        """
        return self._ratio(self._checked(trace), *self._fitted()[1:])

    def rests(self, trace: Trace) -> Bools:
        """Which joints are at rest at each sample, shape (T, n)."""
        return self._checked(trace).rest

    @staticmethod
    def _ratio(judged: Judged, at_rest: Allowance, moving: Allowance) -> Array:
        bound = np.where(judged.rest, at_rest.scale(judged.terms), moving.scale(judged.terms))
        ratio: Array = np.abs(judged.left) / bound
        return ratio

    def _alarms(self, judged: Judged) -> int:
        _, at_rest, moving = self._fitted()
        above = self._ratio(judged, at_rest, moving).max(axis=1) > self.threshold
        t = np.arange(len(above)) * self.dt
        alarm = confirmed(above & (t >= self.settings.settle), self._samples())
        return len(find_alarms(t, alarm))

    def scores(self, trace: Trace) -> Array:
        """The largest ratio of a joint's residual to its allowance, shape (T,)."""
        return np.asarray(self.ratios(trace).max(axis=1))

    def detect(self, trace: Trace) -> Detection:
        """Judge a trace; no alarm within the first ``settle`` seconds."""
        judged = self._checked(trace)
        score = self._ratio(judged, *self._fitted()[1:]).max(axis=1)
        settled = trace.t - trace.t[0] >= self.settings.settle
        alarm = confirmed((score > self.threshold) & settled, self._samples())
        alarms = find_alarms(trace.t, alarm)
        return Detection(self.name, trace.t, judged.left, score, self.threshold, alarm, alarms)


def resting(q: Array, qd: Array, dt: float) -> Bools:
    """Which joints are at rest at each sample, shape (T, n).

    A joint comes to rest when it has stood still for a while (see
    :mod:`~tauguard.detectors.thresholds`) and leaves it by ``RELEASE`` of travel: the twitch of a
    joint that is shaken by the others is no motion.
    """
    stopped = still(qd, dt)
    out = np.empty_like(stopped)
    for j in range(q.shape[1]):
        at_rest, anchor = True, float(q[0, j])
        stops, angles = stopped[:, j].tolist(), q[:, j].tolist()
        for k, (stop, angle) in enumerate(zip(stops, angles, strict=True)):
            if at_rest:
                at_rest = abs(angle - anchor) <= RELEASE
            elif stop:
                at_rest, anchor = True, angle
            out[k, j] = at_rest
    return out


def delayed(x: Array) -> Array:
    """The sample before, shape (T, n); the first one twice."""
    return np.ascontiguousarray(np.concatenate([x[:1], x[:-1]]))


def median_of_three(x: Array) -> Array:
    """Median of the sample before and its neighbours, shape (T, n): causal, one sample late."""
    before = delayed(x)
    return np.ascontiguousarray(np.median(np.stack([x, before, delayed(before)]), axis=0))
