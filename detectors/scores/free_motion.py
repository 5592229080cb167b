"""A detector that learns only from collision-free motion.

A momentum observer at 30/s gives the residual. Errors by load and friction are estimated while
joints move, and subtracted. The score is the largest ratio of a joint's signal to the joint's bound
(:mod:`~tauguard.detectors.features.free_bound`); the threshold is 1.

The prior bounds are multiples of each joint's friction. The bound in motion is then fitted to the
residuals of held-out logs by a regression that keeps the prior where the logs have few data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from tqdm import tqdm

from tauguard.arrays import Array, Bools
from tauguard.detectors import _observer
from tauguard.detectors.calibration.identification import REAL_FRICTION, Subsets
from tauguard.detectors.calibration.recording import (
    LEAST,
    LEAST_STANDING,
    UNKNOWN_LOAD,
    Load,
    LoadDeviation,
    Recording,
    check_length,
    laden,
    motion_length,
    moves,
    pieces,
)
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.estimation.observer import intervals
from tauguard.detectors.events import sustained
from tauguard.detectors.features.free_bound import (
    CREEP,
    PRIOR,
    SLOW,
    Bound,
    friction_levels,
    native,
    standing_positions,
    upper_quantile,
)
from tauguard.detectors.features.front_end import NativeStream
from tauguard.detectors.features.motion_regimes import (
    EVERY,
    SHORTLY,
    Unseen,
    exceeded,
    unseen,
)
from tauguard.detectors.frozen import Frozen
from tauguard.detectors.samples import check_joints
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace

#: Confirmation time of an alarm [s]: 0, because scores include the confirmation.
CONFIRMATION = 0.0
#: The quantile of the residual in motion that is learned.
QUANTILE = 0.99
#: Weight of the prior: that of 20 s of motion in which the inputs of the quantile are USUAL, in the
#: order of PRIOR.
WORTH, USUAL = 20.0, np.array([1.0, 0.5, 2.0, 4.0, 0.3])
#: Least value of ``Bound.fast`` and ``Bound.hard`` [rad/s, rad/s^2].
LEAST_SHOWN = 0.05
#: Motion is beyond the logs if its excess speed and acceleration, relative to the logs', add more.
FURTHER = 0.25
#: Largest number of calibrations with held-out logs.
FOLDS = 5
#: Numbers of the factors ``Bound.scale``, for the bounds at rest, after motion and in motion:
#: factor on the largest signals of held-out logs, least factor, and largest factor.
SCALE_MARGIN, SCALE_LEAST, SCALE_MOST = (1.5, 1.5, 1.3), (1.0, 1.0, 0.4), 3.0
#: Weight of the factor 1 in ``Bound.scale``, in seconds of logs.
SCALE_WORTH = (30.0, 20.0, 60.0)
#: For an arm that moves in no log. QUIETEST: least noise of a joint relative to the noisiest joint.
#: KEEPS: torque that static friction may hold, in standard deviations of the noise.
QUIETEST, KEEPS = 0.2, 10.0
#: The noise of a standing arm is at most CALM times the standard deviation in the calmest tenth of
#: pieces of PIECE [s], because some pieces have no contact. In free logs of two arms, the ratio of
#: the median to that deviation is 1.03 to 1.68, so the limit hardly changes their noise.
CALM, PIECE = 1.45, 0.3
#: Time at the beginning of a log that is used neither in training nor in detection [s].
SETTLE = 0.5


@dataclass(frozen=True, eq=False)
class Judged:
    """A detector's signals along a trace, one row per sample."""

    t: Array  #: [s], shape (T,)
    qd: Array  #: [rad/s], shape (T, n)
    qdd: Array  #: absolute accelerations [rad/s^2], shape (T, n)
    shaken: Array  #: accelerations in the bound, which decay; 0 at rest [rad/s^2], shape (T, n)
    around: Array  #: the same of the joint that accelerates most [rad/s^2], shape (T, n)
    ratio: Array  #: each joint's signal over its bound, at most 1 until confirmed, (T, n)
    bound: Array  #: [N m], shape (T, n)
    residual: Array  #: minus the estimated errors of the model [N m], shape (T, n)
    rest: Bools  #: whether each joint is at rest, shape (T, n)
    hides: Array
    """Why joints are not judged: 1 at a joint that moves, and 2 at one that stands elsewhere, if no
    training log shows its motion; else 0, shape (T, n)"""

    @property
    def dt(self) -> float:
        """Median sample interval [s]."""
        return float(np.median(np.diff(self.t)))


@dataclass(frozen=True, eq=False)
class FittedFreeMotion(Frozen):
    """A calibrated arm and the bounds of its collision-free motion."""

    arm: ArmModel
    dt: float  #: longest sample interval of the training logs [s]
    bound: Bound
    load: LoadDeviation  #: uncertainty of the load
    seconds: float  #: collision-free motion from which the bounds were learned [s]
    unseen: Unseen = ()  #: motion regimes that are in no log
    name: str = "free-motion"
    settle: float = SETTLE  #: [s]

    def carrying(self, load: Load) -> FittedFreeMotion:
        """The detector for the arm with a load in its gripper; ``Load()``: no load."""
        arm, deviation = laden(self.arm, load)
        return replace(self, arm=arm, load=deviation)

    def scores(self, trace: Trace) -> Array:
        """The largest ratio of a joint's signal to its bound, shape (T,)."""
        scores: Array = self.judge(trace).ratio.max(axis=1)
        return scores

    def stream(self) -> NativeStream:
        """A new stream of the scores, sample by sample."""
        scores = _observer.free_scores(native(self.arm, self.bound, self.load))
        return NativeStream(scores, self.dt)

    def beyond(self, judged: Judged) -> tuple[float, dict[int, float]]:
        """Time in which joints are faster, or accelerate more, than in the training logs [s].

        Also returned are the joints, with the 90 % quantile of the bound in this time [N m].
        """
        bound = self.bound
        times = np.abs(judged.qd) / bound.fast - 1, judged.qdd / bound.hard - 1
        more = np.maximum(times[0], 0) + _observer.REGIME_HARDER * np.maximum(times[1], 0)
        rows = ~judged.rest & bound.shown & (more > FURTHER)
        rows &= (judged.t - judged.t[0] > self.settle)[:, None]
        rows &= rows.sum(axis=0) * judged.dt > SHORTLY
        found = {
            int(j): float(np.quantile(judged.bound[rows[:, j], j], 0.9))
            for j in np.flatnonzero(rows.any(axis=0))
        }
        return float(rows.any(axis=1).sum() * judged.dt), found

    def judge(self, trace: Trace) -> Judged:
        """Ratios, bounds and residuals of a trace.

        Raises:
            ArgumentError: other joints than the arm's.
        """
        joints = self.arm.robot.joints
        if len(trace.joint_names) != joints:
            raise ArgumentError(
                f"the trace has {len(trace.joint_names)} joints, this detector {joints}"
            )
        ratio, bound, residual, qdd, shaken, around, rest, hides = (
            np.empty_like(trace.q) for _ in range(8)
        )
        steps = np.concatenate([[self.dt], intervals(trace.t, len(trace.t))])
        q, qd, current = (np.ascontiguousarray(x) for x in (trace.q, trace.qd, trace.current))
        native(self.arm, self.bound, self.load).run(
            steps, q, qd, current, ratio, bound, residual, qdd, shaken, around, rest, hides
        )
        signals = trace.qd, qdd, shaken, around, ratio, bound, residual, rest > 0, hides
        return Judged(trace.t, *signals)


@dataclass(frozen=True)
class FreeMotion:
    """The free-motion detector, which has no settings."""

    name: str = "free-motion"

    def fit(self, traces: Sequence[Trace | Recording], arm: ArmModel) -> FittedFreeMotion:
        """Calibrate the arm and fit the prior bounds to held-out logs.

        Args:
            traces: 10 s of collision-free motion or more in all. Plain traces count as without a
                load. The load of labelled ones is unknown, and those with collisions are left out.
                Long ones are cut, so that each part can be left out once.
            arm: nominal numbers and drive gains; the gains are not identified.

        Raises:
            ArgumentError: no or too little motion, or other joints.
        """
        recordings = [
            r for r in map(_recording, traces) if not (r.trace.truth and r.trace.truth.collisions)
        ]
        if traces and not recordings:
            raise ArgumentError(
                "no trace without collisions: this detector learns from free motion"
            )
        check_joints([r.trace for r in recordings], arm.robot.joint_names)
        parts = pieces(recordings, FOLDS)
        moving = [r for r in parts if moves(r.trace)]
        standing = [r for r in parts if not moves(r.trace)]
        if not moving:
            return standing_detector(arm, standing)
        check_length(recordings)
        models, whole = _calibrations(arm, moving)
        bound = Bound.prior(*friction_levels(whole, moving), *standing_positions(parts))
        dt = max(r.trace.dt for r in recordings)
        prior = FittedFreeMotion(whole, dt, bound, UNKNOWN_LOAD, 0.0)
        left_out = [replace(prior, arm=model) for model in models] + [prior] * len(standing)
        own_arms = zip([*moving, *standing], left_out, strict=True)
        judged = [with_load_of(part, one).judge(part.trace) for part, one in own_arms]
        seconds = sum(float(part.t[-1] - part.t[0]) for part in judged)
        lacking = unseen([r.trace for r in recordings])
        return replace(prior, bound=learned(bound, judged), seconds=seconds, unseen=lacking)


def standing_detector(arm: ArmModel, recordings: Sequence[Recording]) -> FittedFreeMotion:
    """The detector of an arm that moves in no log; it detects collisions while the arm stands.

    Its bounds come from the calmest pieces of the logs, so contacts in these logs raise alarms.

    Raises:
        ArgumentError: logs that are too short.
    """
    if (length := sum(float(r.trace.t[-1] - r.trace.t[0]) for r in recordings)) < LEAST_STANDING:
        raise ArgumentError(
            f"no joint moves in these logs, and they are too short, {length:.1f} s in all: "
            f"{LEAST_STANDING:g} s are the least, ten are good"
        )
    n, dt = arm.robot.joints, max(r.trace.dt for r in recordings)
    bare = replace(REAL_FRICTION, weights=np.zeros((n, REAL_FRICTION.columns)))
    arm = replace(arm, friction=bare, noise=np.ones(n))
    bound = Bound.prior(np.ones(n), np.ones(n), *standing_positions(recordings))
    prior = FittedFreeMotion(arm, dt, bound, LoadDeviation(), 0.0)
    judged = [with_load_of(r, prior).judge(r.trace) for r in recordings]
    noise = np.fmin(_noise(judged, np.full(n, np.nan)), CALM * _calmest(judged, n))
    if not np.isfinite(noise).all():
        raise ArgumentError(
            "no log is free of motion for long enough: give one of two seconds or more"
        )
    noise = np.maximum(noise, max(QUIETEST * float(noise.max()), 1e-6))
    bound = replace(bound, noise=noise, static=KEEPS * noise, friction=KEEPS * noise)
    seconds = sum(float(part.t[-1] - part.t[0]) for part in judged)
    lacking = unseen([r.trace for r in recordings])
    return replace(prior, bound=bound, seconds=seconds, unseen=lacking)


def _calmest(judged: Sequence[Judged], joints: int) -> Array:
    """Standard deviation of the residual in the calmest tenth of pieces [N m], shape (n,)."""
    found = [np.full((1, joints), np.inf)]
    for part in judged:
        length = max(4, round(PIECE / part.dt))
        still = part.rest.all(axis=1) & (part.t - part.t[0] > 2 * SETTLE)
        if len(still) < length:
            continue
        rows = np.arange(0, len(still) - length + 1, max(1, length // 4))
        rows = rows[sliding_window_view(still, length)[rows].all(axis=1)]
        placed = sliding_window_view(part.residual, length, axis=0)[rows]
        found.append(placed.std(axis=2, ddof=1))
    calm: Array = np.quantile(np.concatenate(found), 0.1, axis=0, method="lower")
    return calm


def _recording(trace: Trace | Recording) -> Recording:
    """A log with its load, which is unknown if the log is labelled."""
    if isinstance(trace, Recording):
        return trace
    return Recording(trace) if trace.truth is None else Recording(trace, None)


def _calibrations(arm: ArmModel, parts: Sequence[Recording]) -> tuple[list[ArmModel], ArmModel]:
    """For each part, the calibration from the parts of all other folds; then that of all parts."""
    calibrated, everything = Subsets(arm, parts), range(len(parts))
    whole = calibrated(everything, 0.0)  # the uncut logs have enough
    models = [whole] * len(parts)
    turns = range(min(FOLDS, len(parts)))
    for fold in tqdm(turns, desc="leave out", unit="part", disable=None, leave=False):
        use = [i for i in everything if i % FOLDS != fold]
        enough = motion_length([parts[i] for i in use]) >= LEAST
        model = calibrated(use) if enough else whole
        models[fold::FOLDS] = [model] * len(models[fold::FOLDS])
    return models, whole


def with_load_of(recording: Recording, detector: FittedFreeMotion) -> FittedFreeMotion:
    """The detector for the arm with the load of a recording, if that is known."""
    return detector if recording.load is None else detector.carrying(recording.load)


def learned(prior: Bound, judged: Sequence[Judged]) -> Bound:
    """The prior bounds fitted to held-out logs."""
    quantile = _quantiles(judged, prior.friction)
    bound = replace(prior, noise=_noise(judged, prior.noise), quantile=quantile)
    fast, hard = (
        np.maximum(exceeded([(p.t, np.abs(getattr(p, name))) for p in judged]), LEAST_SHOWN)
        for name in ("qd", "qdd")
    )
    return replace(bound, scale=_scale(prior, bound, judged), fast=fast, hard=hard)


def _scale(prior: Bound, bound: Bound, judged: Sequence[Judged]) -> Array:
    """Ratio of the logs' largest signals to the bounds, as :attr:`Bound.scale`, shape (3, n).

    The largest signal is the second largest peak of pieces of 2 s, so that a single contact in the
    logs has no effect. The result is a weighted mean of this ratio and 1, see :data:`SCALE_WORTH`.

    Args:
        prior: the bound with which the logs were judged.
        bound: the bound with quantiles and noise of the logs.
        judged: the held-out logs.
    """
    n = len(prior.friction)
    peaks: list[list[Array]] = [[], [], []]
    seconds = np.zeros((3, n))
    for part in judged:
        dt, settled = part.dt, (part.t - part.t[0] > 2 * SETTLE)[:, None]
        signal = part.ratio * part.bound
        stirred = (part.bound - prior.rest) / prior.stop
        moving = ~part.rest & settled
        calm, soon = (part.rest & settled & on for on in (stirred < 0.1, stirred > 0.2))
        added = np.maximum(signal - prior.rest, 0.0) / np.where(soon, prior.stop * stirred, 1.0)
        over = np.abs(part.residual) / _in_motion(bound, part)
        length = max(1, round(0.04 / dt))
        lasting = np.stack([sustained(column, length) for column in over.T], axis=1)
        pieces_of = np.arange(0, len(part.t), max(1, round(2.0 / dt)))
        for k, (on, x) in enumerate(
            ((calm, signal / prior.rest), (soon, added), (moving, lasting))
        ):
            seconds[k] += on.sum(axis=0) * dt
            peaks[k].append(np.maximum.reduceat(np.where(on, x, 0.0), pieces_of, axis=0))
    scale = np.ones((3, n))
    for k, own in enumerate(peaks):
        blocks = np.sort(np.concatenate(own), axis=0) if own else np.zeros((0, n))
        if len(blocks) < 2:
            continue
        known = seconds[k] / (seconds[k] + SCALE_WORTH[k])
        seen = np.clip(SCALE_MARGIN[k] * blocks[-2], SCALE_LEAST[k], SCALE_MOST)
        scale[k] = known * seen + 1 - known
    return scale


def _in_motion(bound: Bound, part: Judged) -> Array:
    """The bound of joints in motion without the additions at starts [N m], shape (T, n)."""
    terms = _terms(np.abs(part.qd), part.shaken, part.around)
    bounds: Array = np.maximum(np.einsum("ktj,jk->tj", terms, bound.moving), bound.least)
    return bounds


def _terms(speed: Array, shaken: Array, around: Array) -> Array:
    """What the bound in motion is linear in, ordered as :data:`PRIOR`, shape (5, ...)."""
    return np.stack([np.ones_like(speed), speed, shaken, around, np.exp(-speed / CREEP)])


def _quantiles(judged: Sequence[Judged], friction: Array) -> Array:
    """Each joint's quantile of the residual in motion, shape (n, 5)."""
    settled = [np.flatnonzero(p.t - p.t[0] > 2 * SETTLE) for p in judged]
    rows = [r[:: max(1, round(EVERY / p.dt))] for p, r in zip(judged, settled, strict=True)]
    pairs = list(zip(judged, rows, strict=True))

    def stacked(name: str) -> Array:
        parts = [np.abs(getattr(p, name)[r]) for p, r in pairs]
        return np.concatenate([np.empty((0, len(friction))), *parts])

    terms = _terms(*map(stacked, ("qd", "shaken", "around")))
    residual = stacked("residual")
    found = np.empty((len(friction), len(PRIOR)))
    for j, level in enumerate(friction):
        on = terms[1, :, j] >= SLOW
        x = terms[:, on, j].T
        weight = WORTH / EVERY * USUAL
        found[j] = level * upper_quantile(x, residual[on, j] / level, QUANTILE, PRIOR, weight)
    return found


def _noise(judged: Sequence[Judged], prior: Array) -> Array:
    """Standard deviation of the residual at rest [N m], (n,); ``prior`` if a joint never rests."""
    changes = []
    for part in judged:
        step, settled = max(1, round(0.05 / part.dt)), max(1, round(1.0 / part.dt))
        still = sustained(part.rest.all(axis=1).astype(float), settled) > 0
        changes.append((part.residual[step:] - part.residual[:-step])[still[step:]])
    all_of = np.concatenate(changes or [np.empty((0, len(prior)))])
    if len(all_of) < 100:
        return prior
    noise: Array = np.median(np.abs(all_of), axis=0) / 0.6745 / np.sqrt(2)
    return np.fmax(noise, 1e-3 * prior)
