"""A detector that learns from collision-free motion alone.

Momentum observer at 30/s, slow errors (load, friction) tracked while joints move, and each joint's
bound (:mod:`~tauguard.detectors.features.free_bound`). The score is the largest ratio of a joint's
signal to its bound; 1 is the threshold.

The bounds are prior knowledge in units of each joint's friction. The logs move them: a joint's two
factors, at rest and in motion, follow the largest ratios that logs reach under a calibration that
has not seen them, weighed against :data:`PRIOR_BLOCKS` blocks of the prior. A regime that the logs
do not show keeps the prior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from tauguard.detectors.calibration.identification import REAL_FRICTION, identify
from tauguard.detectors.calibration.recording import Load, Recording, known_load, moves, pieces
from tauguard.detectors.calibration.regression import filtered
from tauguard.detectors.detector import check_joints
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.estimation.observer import intervals
from tauguard.detectors.estimation.slow_errors import UNKNOWN_LOAD, LoadDeviation
from tauguard.detectors.features.free_bound import Bound
from tauguard.detectors.features.free_stream import FreeStream
from tauguard.detectors.frozen import Frozen
from tauguard.detectors.thresholds.alarm import CollisionAlarm
from tauguard.detectors.thresholds.confirmation import confirmation_samples
from tauguard.detectors.thresholds.rates import block_maxima, sustained
from tauguard.traces.trace import Bools, Trace

Array = NDArray[np.float64]

#: Confirmation of an alarm [s].
CONFIRMATION = 0.04
#: Length of the blocks whose peaks the factors follow [s], and how many of them the prior is worth.
BLOCK, PRIOR_BLOCKS = 0.5, 60
#: A factor over the second largest peak, and its range.
HEADROOM, LEAST, MOST = 1.35, 0.8, 3.0
#: Calibrations that leave logs out, at most.
FOLDS = 5
#: Rate of the filter that the calibration looks through [1/s].
CALIBRATION_RATE = 20.0


@dataclass(frozen=True, eq=False)
class Judged:
    """What a detector saw of a trace; rows are samples."""

    t: Array  #: [s], shape (T,)
    ratio: Array  #: of each joint's signal to its bound, shape (T, n)
    bound: Array  #: [N m], shape (T, n)
    residual: Array  #: without slow errors [N m], shape (T, n)
    rest: Bools  #: which joints are at rest, shape (T, n)


@dataclass(frozen=True, eq=False)
class FittedFreeMotion(Frozen):
    """A calibrated arm and the bounds of its collision-free motion."""

    arm: ArmModel
    dt: float  #: of the slowest training log [s]
    bound: Bound
    load: LoadDeviation  #: how uncertain the carried load is
    seconds: float  #: of collision-free motion that the bounds rest on
    alarms: int
    """In the training logs, each under a calibration from others; their bounds have seen them."""
    name: str = "free-motion"
    settle: float = 0.5  #: [s]

    def carrying(self, load: Load) -> FittedFreeMotion:
        """The same detector of the arm with a load in its gripper; ``Load()`` for none."""
        known = known_load(Recording(None, load))  # type: ignore[arg-type]
        moment = 0.1 * load.mass if load.mass and load.centre is None else 0.0
        inertial = self.arm.robot.inertial.copy()
        inertial[-1] += known
        arm = replace(self.arm, robot=self.arm.robot.with_inertial(inertial))
        deviation = LoadDeviation(0.02 * load.mass, moment)
        return replace(self, arm=arm, load=deviation)

    def scores(self, trace: Trace) -> Array:
        """The largest ratio of a joint's signal to its bound, shape (T,)."""
        scores: Array = self.judge(trace).ratio.max(axis=1)
        return scores

    def stream(self) -> FreeStream:
        """The same scores sample by sample."""
        return FreeStream(self.arm, self.bound, self.load, self.dt)

    def judge(self, trace: Trace) -> Judged:
        """Ratios, bounds and residuals of a trace.

        Raises:
            ValueError: other joints than the arm's.
        """
        joints = self.arm.robot.joints
        if len(trace.joint_names) != joints:
            raise ValueError(
                f"the trace has {len(trace.joint_names)} joints, this detector {joints}"
            )
        stream, steps = self.stream(), intervals(trace.t, len(trace.t))
        ratio, bound, residual = (np.empty_like(trace.q) for _ in range(3))
        rest = np.empty(trace.q.shape, dtype=np.bool_)
        dt = trace.dt
        for k in range(len(trace.t)):
            stream.step(trace.q[k], trace.qd[k], trace.current[k], float(steps[k - 1]) if k else dt)
            ratio[k], bound[k] = stream.ratio, stream.regimes.bound
            residual[k], rest[k] = stream.residual, stream.regimes.rest
        return Judged(trace.t, ratio, bound, residual, rest)


def carrying(alarm: CollisionAlarm, load: Load) -> CollisionAlarm:
    """The same alarm for an arm with a load in its gripper.

    Raises:
        ValueError: a detector of another kind: it takes no load.
    """
    if not isinstance(alarm.detector, FittedFreeMotion):
        raise ValueError(f"{alarm.detector.name}: takes no load; only free-motion detectors do")
    return replace(alarm, detector=alarm.detector.carrying(load))


@dataclass(frozen=True)
class FreeMotion:
    """Settings of the free-motion detector: there are none to choose."""

    name: str = "free-motion"

    def fit(self, traces: Sequence[Trace | Recording], arm: ArmModel) -> FittedFreeMotion:
        """Calibrate, then let left-out logs move the prior bounds.

        Args:
            traces: collision-free, 20 s of motion or more in all; plain traces count as without a
                load. Long ones are cut, so that each part can be left out once.
            arm: nominal numbers and drive gains, whose scale holds.

        Raises:
            ValueError: too little motion, or other joints.
        """
        recordings = [r if isinstance(r, Recording) else Recording(r) for r in traces]
        check_joints([r.trace for r in recordings], arm)
        parts = pieces(recordings, FOLDS)
        bare = replace(arm.friction or REAL_FRICTION, weights=np.empty((0, 0)))
        moving = [r for r in parts if moves(r.trace)]
        standing = [r for r in parts if not moves(r.trace)]
        data = [filtered(r, arm.robot, arm.drive_gain, bare, CALIBRATION_RATE) for r in moving]

        def calibrated(use: Sequence[int]) -> ArmModel:
            own, known = [moving[i] for i in use], [data[i] for i in use]
            return identify(arm, own, friction=bare, rate=CALIBRATION_RATE, data=known).arm

        everything = range(len(moving))
        whole = calibrated(everything)
        prior = _prior(whole, max(r.trace.dt for r in recordings))
        judged = [_judged(prior, r) for r in standing]
        folds = [everything[k::FOLDS] for k in range(min(FOLDS, len(moving)))]
        for fold in tqdm(folds, desc="leave out", unit="part", disable=None, leave=False):
            others = [i for i in everything if i not in fold]
            try:
                model = calibrated(others)
            except ValueError:  # too little motion is left without the fold
                model = whole
            judged += [_judged(replace(prior, arm=model), moving[i]) for i in fold]
        return _moved(prior, judged)


def friction_level(arm: ArmModel) -> Array:
    """What a joint's bounds are measured in [N m], shape (n,).

    Coulomb friction, or 1.5 times the error in motion where that is more; small joints leave more
    of their friction than large ones, and a quarter of the (logarithmic) way to the largest is
    added.
    """
    coulomb = arm.friction.coulomb() if arm.friction else np.zeros(arm.robot.joints)
    level = np.maximum(np.maximum(coulomb, 1.5 * np.asarray(arm.noise)), 1e-3)
    level = np.maximum(level, 0.02 * level.max())
    scaled: Array = level**0.75 * level.max() ** 0.25
    return scaled


def _prior(arm: ArmModel, dt: float) -> FittedFreeMotion:
    one = np.ones(arm.robot.joints)
    level = friction_level(arm)
    bound = Bound(level, 0.02 * level, one, one)
    return FittedFreeMotion(arm, dt, bound, UNKNOWN_LOAD, 0.0, 0)


def _judged(prior: FittedFreeMotion, recording: Recording) -> Judged:
    known = prior if recording.load is None else prior.carrying(recording.load)
    return known.judge(recording.trace)


def _moved(prior: FittedFreeMotion, judged: Sequence[Judged]) -> FittedFreeMotion:
    """The prior with each joint's noise and factors from left-out logs."""
    noise = _noise(judged, prior.bound.noise)
    factors = [_factors(judged, at_rest) for at_rest in (True, False)]
    bound = replace(prior.bound, noise=noise, resting=factors[0], moving=factors[1])
    seconds = sum(float(part.t[-1] - part.t[0]) for part in judged)
    alarms = sum(_alarms(part, bound, prior.bound) for part in judged)
    return replace(prior, bound=bound, seconds=seconds, alarms=alarms)


def _held(part: Judged, ratio: Array) -> Array:
    """What each joint's ratio holds for the time of a confirmation, shape (T, n)."""
    dt = float(np.median(np.diff(part.t)))
    samples = confirmation_samples(CONFIRMATION, dt)
    held = np.column_stack([sustained(column, samples) for column in ratio.T])
    held[part.t - part.t[0] < 0.5] = 0.0
    return held


def _factors(judged: Sequence[Judged], at_rest: bool) -> Array:
    """Each joint's factor, shape (n,), of the bound at rest or in motion."""
    found = []
    for part in judged:
        rows = max(1, round(BLOCK / float(np.median(np.diff(part.t)))))
        held = _held(part, np.where(part.rest == at_rest, part.ratio, 0.0))
        found.append(np.column_stack([block_maxima(column, rows)[0] for column in held.T]))
    peaks = np.concatenate(found)
    out = np.ones(peaks.shape[1])
    for j, own in enumerate(peaks.T):
        shown = np.sort(own[own > 0])[::-1]
        if len(shown):
            seen = HEADROOM * float(shown[min(1, len(shown) - 1)])
            weighed = (PRIOR_BLOCKS + len(shown) * seen) / (PRIOR_BLOCKS + len(shown))
            out[j] = np.clip(weighed, LEAST, MOST)
    return out


def _noise(judged: Sequence[Judged], prior: Array) -> Array:
    """Deviation of a standing joint's residual [N m], shape (n,); ``prior`` where none stands."""
    changes = []
    for part in judged:
        dt = float(np.median(np.diff(part.t)))
        step, settled = max(1, round(0.05 / dt)), max(1, round(1.0 / dt))
        still = sustained(part.rest.all(axis=1).astype(float), settled) > 0
        changes.append((part.residual[step:] - part.residual[:-step])[still[step:]])
    all_of = np.concatenate(changes)
    if len(all_of) < 100:
        return prior
    noise: Array = np.median(np.abs(all_of), axis=0) / 0.6745 / np.sqrt(2)
    return np.maximum(noise, 1e-3 * prior)


def _alarms(part: Judged, bound: Bound, prior: Bound) -> int:
    """Alarms of a left-out part under the factors that were learned."""
    factor = np.where(part.rest, bound.resting, bound.moving)
    held = _held(part, part.ratio / np.minimum(factor, 1.0)).max(axis=1) > 1
    return int(np.count_nonzero(held[1:] & ~held[:-1]))
