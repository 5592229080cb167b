"""A detector that learns from collision-free motion alone.

Estimator (friction, momentum observer, payload and slow offsets tracked), then per joint the
residual that is left over its allowance: what collision-free motion leaves at that speed and
acceleration, apart for joints that stand still. Static friction is indeterminate there: the torque
of a joint at rest wanders with the others' motion, which the tracked offset follows.

Allowances come from residuals of logs that the calibration in use did not see: every training log
is judged by a calibration from the others, as new logs will be. The allowances at rest and in
motion are scaled to half of the false alarms to accept each. The tail of the ratios of residual to
allowance is taken to be that of all joints together: one joint's share of some minutes says too
little of what it does once in hours. The score is the root of the sum of the squares of the joints'
ratios, and a last factor makes 1 its threshold: friction errs in one joint at a time, a push at a
link loads several. A joint that no log shows at rest, or in motion, has the allowance of the other
regime there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from tauguard.detectors.calibration.identification import REAL_FRICTION, Beliefs, identify
from tauguard.detectors.calibration.recording import Recording
from tauguard.detectors.calibration.regression import filtered
from tauguard.detectors.calibration.resampling import coarser, rows_known, samples_each
from tauguard.detectors.detector import check_joints
from tauguard.detectors.estimation.estimator import ArmModel, Estimator, Unknowns
from tauguard.detectors.evaluation.events import MERGE_GAP, find_alarms
from tauguard.detectors.features.allowance import (
    AT_REST,
    IN_MOTION,
    Allowance,
    acceleration,
    peaks,
    terms,
    torque_change,
)
from tauguard.detectors.features.standstill import still
from tauguard.detectors.thresholds.confirmation import confirmation_samples, confirmed
from tauguard.detectors.thresholds.rates import followed, sustained
from tauguard.traces.trace import Bools, Detection, Trace

Array = NDArray[np.float64]

#: Travel after which a joint that stood still counts as moving [rad].
RELEASE = 5e-3
#: A joint's threshold over its largest training peak is at least this.
HEADROOM = 1.2
#: Share of the peaks that the tail is taken from.
TAIL = 0.02


@dataclass(frozen=True)
class FreeMotionSettings:
    """What can be chosen; the defaults are for real arms at 100 Hz and above."""

    observer_gain: float = 40.0  #: [1/s]
    calibration_rate: float = 20.0  #: of the filter that the calibration looks through [1/s]
    confirmation: float = 0.05  #: t_c [s]
    settle: float = 4.0  #: at the beginning, never an alarm: until motion has shown the load [s]
    false_alarms_per_hour: float = 1.0  #: to accept when the allowances are scaled
    spike: bool = True
    """Take the median of three successive currents, or of five where it jumps: a controller's kick,
    as at a commanded stop, says nothing about contact. It costs one sample of delay or two."""
    unknowns: Unknowns = field(
        default_factory=lambda: Unknowns(
            payload=3.0, moment=0.3, offset=0.3, fast=5.0, slow=300.0, clip=10.0
        )
    )
    """What is tracked; a load that nobody told is more than the training logs show. Loads and the
    friction of gears that warm up change over minutes: what is followed as fast as a hand pushes
    explains the push away. What is followed so slowly has to heed large innovations: a load that a
    standing arm got wrong would otherwise stay, since what contradicts it counts less."""
    beliefs: Beliefs = field(default_factory=Beliefs)  #: of the calibration


@dataclass(frozen=True)
class Judged:
    """What the detector sees of a trace; rows are samples."""

    left: Array  #: residual that the tracked unknowns do not explain [N m], shape (T, n)
    terms: Array  #: of the allowances, shape (T, n, TERMS)
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
            traces: collision-free logs, three or more; plain traces count as without a load. The
                slowest sample rate among them becomes that of all.
            robot: nominal numbers and drive gains, whose scale holds.

        Raises:
            ValueError: fewer than three logs, or other joints.
        """
        recordings = [r if isinstance(r, Recording) else Recording(r) for r in traces]
        if len(recordings) < 3:
            raise ValueError(
                f"{len(recordings)} log{'s' * (len(recordings) != 1)}: give three or more, "
                "to leave each out once (a long one can be cut)"
            )
        check_joints([r.trace for r in recordings], robot)
        self.dt = max(r.trace.dt for r in recordings)
        recordings = [
            replace(r, trace=coarser(r.trace, samples_each(r.trace, self.dt))) for r in recordings
        ]
        bare = replace(robot.friction or REAL_FRICTION, weights=np.empty((0, 0)))
        rate, beliefs = self.settings.calibration_rate, self.settings.beliefs
        numbers, drive = robot.robot, robot.drive_gain
        data = [filtered(r, numbers, drive, bare, rate, beliefs.rest) for r in recordings]

        def without(k: int) -> ArmModel:
            use = [i for i in range(len(recordings)) if i != k]
            return identify(
                robot,
                [recordings[i] for i in use],
                friction=bare,
                beliefs=beliefs,
                rate=rate,
                data=[data[i] for i in use],
            ).arm

        self.model = without(-1)
        assert self.model.friction is not None
        turns = tqdm(recordings, desc="leave out", unit="log", disable=None, leave=False)
        judged = [self._judged(without(k), r.trace) for k, r in enumerate(turns)]
        self._learn(judged, self.model.friction.coulomb())
        self.left_out = [self._alarms(part) for part in judged]
        return self

    def _learn(self, judged: Sequence[Judged], coulomb: Array) -> None:
        """Allowances of left-out residuals, scaled to the false alarms to accept."""
        first, rows = self._first(), self._gap()
        self.seconds = sum(len(part.left) - first for part in judged) * self.dt
        columns = np.concatenate([part.terms[first:] for part in judged])
        bounds, shown = [], []
        for resting, which in ((True, AT_REST), (False, IN_MOTION)):
            level = np.concatenate([self._level(part, resting)[first:] for part in judged])
            allowance = Allowance.fit(level, columns, rows, which)
            factors = self._factors(level / allowance.scale(columns), rows)
            bounds.append(allowance.times(factors))
            shown.append(level.max(axis=0) > 0)
        at_rest = bounds[0].where(shown[0], bounds[1]).at_least(coulomb)
        moving = bounds[1].where(shown[1], bounds[0]).at_least(coulomb)
        room = np.full(len(coulomb), self._room(judged, at_rest, moving))
        self.resting, self.moving = at_rest.times(room), moving.times(room)

    def _room(self, judged: Sequence[Judged], at_rest: Allowance, moving: Allowance) -> float:
        """At least 1: for alarms that several joints, or rest and motion, make together."""
        first, samples, rows = self._first(), self._samples(), self._gap()
        scores = [combined(self._ratio(part, at_rest, moving))[first:] for part in judged]
        levels = [sustained(score, samples) for score in scores]
        found = np.sort(np.concatenate([level[peaks(level, rows)] for level in levels]))[::-1]
        if not len(found):
            return 1.0
        allowed = 2 * self._allowed()
        level = max(1.0, _exceeded(found, allowed))
        return level if allowed >= 1 else max(level, HEADROOM * float(found[0]))

    def _first(self) -> int:
        """The first sample that may be an alarm."""
        return int(np.ceil(self.settings.settle / self.dt))

    def _gap(self) -> int:
        """Samples that have one peak: alarms so near to each other are one."""
        return max(1, round(MERGE_GAP / self.dt))

    def _allowed(self) -> float:
        """False alarms at rest, or in motion, to accept in the training logs."""
        return self.settings.false_alarms_per_hour / 2 * self.seconds / 3600

    def _level(self, judged: Judged, resting: bool) -> Array:
        """What an alarm of each joint would need, 0 in the other regime, shape (T, n)."""
        size = np.where(judged.rest == resting, np.abs(judged.left), 0.0)
        return np.column_stack([sustained(own, self._samples()) for own in size.T])

    def _factors(self, ratio: Array, rows: int) -> Array:
        """What each joint's allowance is to be multiplied by, shape (n,)."""
        own = [np.sort(column[peaks(column, rows)])[::-1] for column in ratio.T]
        pooled = np.sort(np.concatenate(own))[::-1]
        if not len(pooled):
            return np.ones(len(own))
        allowed = self._allowed()
        common = _exceeded(pooled, allowed)
        if allowed >= 1:
            return np.full(len(own), common)
        return np.array([max(common, HEADROOM * float(z[0])) if len(z) else common for z in own])

    # -- detection --------------------------------------------------------------------------------

    def _samples(self) -> int:
        return confirmation_samples(self.settings.confirmation, self.dt)

    def _judged(self, model: ArmModel, trace: Trace) -> Judged:
        t, q, qd, current = trace.t, trace.q, trace.qd, trace.current
        shaken = acceleration(t, qd)  # of this sample, though the residual is of one before
        if self.settings.spike:
            q, qd, current = delayed(q), delayed(qd), without_kicks(current, self._jump(model))
        gain = self.settings.observer_gain
        found = Estimator(model, gain, self.dt, self.settings.unknowns).run(t, q, qd, current)
        change = torque_change(model.robot, t, q, qd, gain)
        rest = resting(q, qd, self.dt)
        return Judged(found.unexplained, terms(qd, shaken, change, rest, self.dt), rest)

    @staticmethod
    def _jump(model: ArmModel) -> Array:
        """What is called a jump of the current [A], shape (n,): twice the Coulomb friction."""
        n = model.robot.joints
        level = model.friction.coulomb() if model.friction else np.full(n, np.inf)
        jump: Array = 2 * level / np.abs(model.drive_gain)
        return jump

    def _checked(self, trace: Trace) -> Judged:
        """At every sample of the trace, whose rate may be higher than training's."""
        model = self._fitted()[0]
        if len(trace.joint_names) != model.robot.joints:
            raise ValueError(
                f"the trace has {len(trace.joint_names)} joints, this detector "
                f"{model.robot.joints}: {', '.join(model.robot.joint_names)}"
            )
        count, length = samples_each(trace, self.dt), len(trace.t)
        if length // count < 2:
            raise ValueError(f"the trace has {length} samples: expected {2 * count} or more")
        seen = self._judged(model, coarser(trace, count))
        rows = rows_known(count, length, len(seen.left))
        return Judged(seen.left[rows], seen.terms[rows], seen.rest[rows])

    def ratios(self, trace: Trace) -> Array:
        """Each joint's residual over its allowance, shape (T, n).

        Raises:
            ValueError: not fitted, other joints or a lower sample rate than the training's.
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
        above = combined(self._ratio(judged, at_rest, moving)) > self.threshold
        t = np.arange(len(above)) * self.dt
        alarm = confirmed(above & (t >= self.settings.settle), self._samples())
        return len(find_alarms(t, alarm))

    def scores(self, trace: Trace) -> Array:
        """All joints' ratios of residual to allowance together, shape (T,)."""
        return combined(self.ratios(trace))

    def detect(self, trace: Trace) -> Detection:
        """Judge a trace; no alarm within the first ``settle`` seconds."""
        judged = self._checked(trace)
        score = combined(self._ratio(judged, *self._fitted()[1:]))
        settled = trace.t - trace.t[0] >= self.settings.settle
        samples = confirmation_samples(self.settings.confirmation, min(self.dt, trace.dt))
        alarm = confirmed((score > self.threshold) & settled, samples)
        alarms = find_alarms(trace.t, alarm)
        return Detection(self.name, trace.t, judged.left, score, self.threshold, alarm, alarms)


def resting(q: Array, qd: Array, dt: float) -> Bools:
    """Which joints are at rest at each sample, shape (T, n).

    A joint comes to rest when it has stood still for a while (see
    :mod:`~tauguard.detectors.features.standstill`) and leaves it by ``RELEASE`` of travel: the
    twitch of a joint that is shaken by the others is no motion.
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


def _exceeded(ordered: Array, allowed: float) -> float:
    """The level that so many of some peaks, in descending order, are expected to exceed."""
    return followed(ordered, allowed, max(10, round(TAIL * len(ordered))))


def combined(ratio: Array) -> Array:
    """The root of the sum of the squares over the joints, shape (T,), of ``ratio``, (T, n)."""
    return np.asarray(np.sqrt((ratio**2).sum(axis=1)))


def delayed(x: Array) -> Array:
    """The sample before, shape (T, n); the first one twice."""
    return np.ascontiguousarray(np.concatenate([x[:1], x[:-1]]))


def median_of(count: int, x: Array) -> Array:
    """Running median of the last ``count`` samples (odd), shape (T, n); the first counts often."""
    parts = [x]
    for _ in range(count - 1):
        parts.append(delayed(parts[-1]))
    return np.ascontiguousarray(np.median(np.stack(parts), axis=0))


def without_kicks(x: Array, jump: Array) -> Array:
    """Median of the last three samples, or of five where they differ by more than ``jump``.

    Args:
        x: shape (T, n).
        jump: shape (n,).

    Returns:
        Shape (T, n): x one sample late, two where it jumps.
    """
    three, five = median_of(3, x), median_of(5, x)
    return np.where(np.abs(three - five) > jump, five, three)
