"""A detector that learns from collision-free motion alone.

Momentum observer at 30/s, biases (load, friction) tracked while joints move, and each joint's
bound (:mod:`~tauguard.detectors.features.free_bound`). The score is the largest ratio of a joint's
signal to its bound; 1 is the threshold.

The bounds are prior knowledge in units of each joint's friction. Logs move the bound in motion: a
regression on what is left of the residual in logs that the calibration has not seen, pulled
towards the prior where the logs show little.
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
    LEAST_STANDING,
    UNKNOWN_LOAD,
    Load,
    LoadDeviation,
    Recording,
    check_length,
    laden,
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
from tauguard.traces.trace import Trace

#: Confirmation of an alarm [s]: none, since scores pass 1 only once they are confirmed.
CONFIRMATION = 0.0

#: The quantile of the residual in motion that is learned.
QUANTILE = 0.99

#: Weight of the prior in seconds of motion at these speeds and accelerations [rad/s, ...].
WORTH, USUAL = 20.0, np.array([1.0, 0.5, 2.0, 4.0, 0.3])

#: The least speed and acceleration that count as shown in any case [rad/s, rad/s^2].
LEAST_SHOWN = 0.05

#: Motion counts as beyond the logs where it adds this to the bound, in friction levels.
FURTHER = 0.25

#: Largest number of calibrations with held-out logs.
FOLDS = 5

#: Factor on the largest signals of held-out logs; their least and largest value as fractions of the
#: bounds at rest, after motion and in motion; weight of the prior in seconds.
SCALE_MARGIN, SCALE_LEAST, SCALE_MOST = (1.5, 1.5, 1.3), (1.0, 1.0, 0.4), 3.0
SCALE_WORTH = (30.0, 20.0, 60.0)

#: For an arm that moves in no log: least noise of a joint over the largest, and the torque that
#: static friction is assumed to hold, in standard deviations of the noise.
QUIETEST, KEEPS = 0.2, 10.0

#: Noise of a standing arm: at most this factor times the standard deviation in the calmest tenth of
#: pieces of this length [s], because contacts leave some pieces calm. In free logs of two arms the
#: median over that deviation is 1.03 to 1.68, so the median counts there, or nearly.
CALM, PIECE = 1.45, 0.3

#: Beginning of a log that is neither learned from nor watched [s].
SETTLE = 0.5


@dataclass(frozen=True, eq=False)
class Judged:
    """A detector's signals along a trace; rows are samples."""

    t: Array  #: [s], shape (T,)
    qd: Array  #: [rad/s], shape (T, n)
    qdd: Array  #: sizes of accelerations [rad/s^2], shape (T, n)
    ratio: Array  #: each joint's signal over its bound, at most 1 until confirmed, (T, n)
    bound: Array  #: [N m], shape (T, n)
    residual: Array  #: without biases [N m], shape (T, n)
    rest: Bools  #: which joints are at rest, shape (T, n)


@dataclass(frozen=True, eq=False)
class FittedFreeMotion(Frozen):
    """A calibrated arm and the bounds of its collision-free motion."""

    arm: ArmModel
    dt: float  #: of the slowest training log [s]
    bound: Bound
    load: LoadDeviation  #: how uncertain the carried load is
    seconds: float  #: collision-free motion that the bounds were learned from [s]
    unseen: Unseen = ()  #: what the logs do not show
    name: str = "free-motion"
    settle: float = SETTLE  #: [s]

    def carrying(self, load: Load) -> FittedFreeMotion:
        """The same detector of the arm with a load in its gripper; ``Load()`` for none."""
        arm, deviation = laden(self.arm, load)
        return replace(self, arm=arm, load=deviation)

    def scores(self, trace: Trace) -> Array:
        """The largest ratio of a joint's signal to its bound, shape (T,)."""
        scores: Array = self.judge(trace).ratio.max(axis=1)
        return scores

    def stream(self) -> NativeStream:
        """The same scores sample by sample."""
        scores = _observer.free_scores(native(self.arm, self.bound, self.load))
        return NativeStream(scores, self.dt)

    def unwatched(self, trace: Trace) -> tuple[float, tuple[str, ...]]:
        """Seconds in which joints move whose motion no log showed, and their names."""
        hidden = ~self.bound.shown
        moved = (np.abs(trace.qd) > _observer.REGIME_FULL_SPEED) | (trace.q < self.bound.low)
        moved = (moved | (trace.q > self.bound.high)) & hidden
        names = tuple(np.array(trace.joint_names)[moved.any(axis=0)].tolist())
        rows = np.flatnonzero(moved.any(axis=1))
        after = np.searchsorted(trace.t, trace.t[rows] + _observer.REGIME_SETTLES)
        blind = np.zeros(len(trace.t) + 1, dtype=np.int64)
        np.add.at(blind, rows, 1)
        np.add.at(blind, after, -1)
        steps = np.diff(trace.t, append=trace.t[-1])
        return float(steps[np.cumsum(blind)[:-1] > 0].sum()), names

    def beyond(self, trace: Trace) -> tuple[float, dict[str, float]]:
        """Seconds in which joints are faster than the logs show, or accelerate harder, and their
        names with the bound that nine tenths of these seconds stay below [N m]."""
        judged, bound = self.judge(trace), self.bound
        times = np.abs(judged.qd) / bound.fast - 1, judged.qdd / bound.hard - 1
        more = np.maximum(times[0], 0) + _observer.REGIME_HARDER * np.maximum(times[1], 0)
        rows = ~judged.rest & bound.shown & (more > FURTHER)
        rows &= (judged.t - judged.t[0] > self.settle)[:, None]
        rows &= rows.sum(axis=0) * trace.dt > SHORTLY
        found = {
            name: float(np.quantile(judged.bound[rows[:, j], j], 0.9))
            for j, name in enumerate(trace.joint_names)
            if rows[:, j].any()
        }
        return float(rows.any(axis=1).sum() * trace.dt), found

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
        ratio, bound, residual, qdd, rest = (np.empty_like(trace.q) for _ in range(5))
        steps = np.concatenate([[self.dt], intervals(trace.t, len(trace.t))])
        q, qd, current = (np.ascontiguousarray(x) for x in (trace.q, trace.qd, trace.current))
        native(self.arm, self.bound, self.load).run(
            steps, q, qd, current, ratio, bound, residual, qdd, rest
        )
        return Judged(trace.t, trace.qd, qdd, ratio, bound, residual, rest > 0)


@dataclass(frozen=True)
class FreeMotion:
    """Settings of the free-motion detector: there are none to choose."""

    name: str = "free-motion"

    def fit(self, traces: Sequence[Trace | Recording], arm: ArmModel) -> FittedFreeMotion:
        """Calibrate, then let left-out logs move the prior bounds.

        Args:
            traces: 10 s of collision-free motion or more in all. Plain traces count as without a
                load; of labelled ones the load is unknown, and those with collisions are left out.
                Long ones are cut, so that each part can be left out once.
            arm: nominal numbers and drive gains, whose scale holds.

        Raises:
            ValueError: no or too little motion, or other joints.
        """
        recordings = [r for r in map(_recording, traces) if not _has_collisions(r.trace)]
        if traces and not recordings:
            raise ValueError("no trace without collisions: free motion is all that this learns")
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
        fresh = learned(bound, judged)
        return replace(prior, bound=fresh, seconds=seconds, unseen=lacking)


def standing_detector(arm: ArmModel, recordings: Sequence[Recording]) -> FittedFreeMotion:
    """The detector of an arm that no log shows moving: it watches while the arm stands.

    Its bounds rest on the calmest pieces, so contacts in these logs raise alarms.

    Raises:
        ValueError: logs that are too short.
    """
    if (length := sum(float(r.trace.t[-1] - r.trace.t[0]) for r in recordings)) < LEAST_STANDING:
        raise ValueError(
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
        raise ValueError(
            "no log is free of motion for long enough: give one of two seconds or more"
        )
    noise = np.maximum(noise, max(QUIETEST * float(noise.max()), 1e-6))
    bound = replace(bound, noise=noise, static=KEEPS * noise, friction=KEEPS * noise)
    seconds = sum(float(part.t[-1] - part.t[0]) for part in judged)
    lacking = unseen([r.trace for r in recordings])
    return replace(prior, bound=bound, seconds=seconds, unseen=lacking)


def _calmest(judged: Sequence[Judged], joints: int) -> Array:
    """Deviation of the residual in the calmest tenth of pieces of an arm at rest [N m], (n,)."""
    found = [np.full((1, joints), np.inf)]
    for part in judged:
        length = max(4, round(PIECE / float(np.median(np.diff(part.t)))))
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
    """A log with what is known of its load: nothing, if it is labelled."""
    if isinstance(trace, Recording):
        return trace
    return Recording(trace) if trace.truth is None else Recording(trace, None)


def _has_collisions(trace: Trace) -> bool:
    return trace.truth is not None and bool(trace.truth.collisions)


def _calibrations(arm: ArmModel, parts: Sequence[Recording]) -> tuple[list[ArmModel], ArmModel]:
    """For each part the calibration from the parts of other folds, and that from all."""
    calibrated, everything = Subsets(arm, parts), range(len(parts))
    whole = calibrated(everything, 0.0)  # the uncut logs have enough
    models = [whole] * len(parts)
    turns = range(min(FOLDS, len(parts)))
    for fold in tqdm(turns, desc="leave out", unit="part", disable=None, leave=False):
        try:
            model = calibrated([i for i in everything if i % FOLDS != fold])
        except ValueError:  # too little motion is left without the fold
            model = whole
        models[fold::FOLDS] = [model] * len(models[fold::FOLDS])
    return models, whole


def with_load_of(recording: Recording, detector: FittedFreeMotion) -> FittedFreeMotion:
    """The detector of the arm with the load that a recording is known to carry."""
    return detector if recording.load is None else detector.carrying(recording.load)


def learned(prior: Bound, judged: Sequence[Judged]) -> Bound:
    """The prior bounds moved by what left-out logs show."""
    quantile = _quantiles(judged, prior.friction)
    bound = replace(prior, noise=_noise(judged, prior.noise), quantile=quantile)
    fast, hard = (
        np.maximum(exceeded([(p.t, np.abs(getattr(p, name))) for p in judged]), LEAST_SHOWN)
        for name in ("qd", "qdd")
    )
    return replace(bound, scale=_scale(prior, bound, judged), fast=fast, hard=hard)


def _scale(prior: Bound, bound: Bound, judged: Sequence[Judged]) -> Array:
    """Ratio of the logs' largest signals to the bounds, as :attr:`Bound.scale`, shape (3, n).

    It takes the second largest peak of pieces of 2 s, so that a single contact in the logs has no
    effect. The longer the logs, the more the ratio counts against 1, see
    :data:`SCALE_WORTH`.

    Args:
        prior: the bound with which the logs were judged.
        bound: the bound with the logs' own quantiles and noise.
        judged: the left-out logs.
    """
    n = len(prior.friction)
    peaks: list[list[Array]] = [[], [], []]
    seconds = np.zeros((3, n))
    for part in judged:
        dt = float(np.median(np.diff(part.t)))
        settled = (part.t - part.t[0] > 2 * SETTLE)[:, None]
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
    """The bound of joints in motion without starts and biases [N m], shape (T, n)."""
    speed, own = np.abs(part.qd), np.abs(part.qdd)
    hardest = np.broadcast_to(own.max(axis=1, keepdims=True), own.shape)
    terms = np.stack([np.ones_like(speed), speed, own, hardest, np.exp(-speed / CREEP)])
    bounds: Array = np.maximum(np.einsum("ktj,jk->tj", terms, bound.moving), bound.least)
    return bounds


def _quantiles(judged: Sequence[Judged], friction: Array) -> Array:
    """Each joint's quantile of the residual in motion, shape (n, 5)."""
    rows = [np.flatnonzero(p.t - p.t[0] > 2 * SETTLE)[:: _stride(p)] for p in judged]
    pairs = list(zip(judged, rows, strict=True))

    def stacked(name: str) -> Array:
        parts = [np.abs(getattr(p, name)[r]) for p, r in pairs]
        return np.concatenate([np.empty((0, len(friction))), *parts])

    qd, qdd, residual = stacked("qd"), stacked("qdd"), stacked("residual")
    hardest = qdd.max(axis=1, initial=0.0)
    found = np.empty((len(friction), len(PRIOR)))
    for j, level in enumerate(friction):
        on = qd[:, j] >= SLOW
        speed = qd[on, j]
        slowness = np.exp(-speed / CREEP)
        x = np.column_stack([np.ones(on.sum()), speed, qdd[on, j], hardest[on], slowness])
        weight = WORTH / EVERY * USUAL
        y = residual[on, j] / level
        found[j] = level * upper_quantile(x, y, QUANTILE, PRIOR, weight)
    return found


def _stride(part: Judged) -> int:
    return max(1, round(EVERY / float(np.median(np.diff(part.t)))))


def _noise(judged: Sequence[Judged], prior: Array) -> Array:
    """Deviation of a standing joint's residual [N m], shape (n,); ``prior`` where none stands."""
    changes = []
    for part in judged:
        dt = float(np.median(np.diff(part.t)))
        step, settled = max(1, round(0.05 / dt)), max(1, round(1.0 / dt))
        still = sustained(part.rest.all(axis=1).astype(float), settled) > 0
        changes.append((part.residual[step:] - part.residual[:-step])[still[step:]])
    all_of = np.concatenate(changes or [np.empty((0, len(prior)))])
    if len(all_of) < 100:
        return prior
    noise: Array = np.median(np.abs(all_of), axis=0) / 0.6745 / np.sqrt(2)
    return np.fmax(noise, 1e-3 * prior)
