"""Least torques and forces that a free-motion detector finds, and its false alarms."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from tauguard.arrays import Array
from tauguard.detectors import _observer
from tauguard.detectors.diagnosis.contact_force import link_poses, point_jacobians
from tauguard.detectors.estimation.estimator import Estimator, Unknowns
from tauguard.detectors.estimation.observer import LOG_GAIN
from tauguard.detectors.evaluation.card_page import UPPER, ThresholdCard
from tauguard.detectors.evaluation.cross_validation import CrossValidation
from tauguard.detectors.events import find_alarms
from tauguard.detectors.features.free_bound import FREE_GAIN
from tauguard.detectors.features.motion_regimes import motion_regimes
from tauguard.detectors.scores.free_motion import SETTLE, FittedFreeMotion, Judged
from tauguard.report import poisson_rate
from tauguard.traces.trace import Trace

#: Largest fraction of an applied torque that exceeds the baseline for long enough on a joint at
#: rest: COUNTS if the torque rises within 0.1 s, COUNTS_SLOWLY if within 1 s. The observer (30/s)
#: follows the torque, and the baseline of the residual (0.15 s) follows the observer.
COUNTS, COUNTS_SLOWLY = 0.6, 0.15
# Constants of :func:`found_in_motion`.
PULSE = 0.3  # length of the pulses [s]
PLACES = 40  # least number of pulses
SHARE = 0.9  # fraction of the pulses that exceed the bound at the resulting torque
LASTS = 0.04  # time above the bound until an alarm [s]
#: Factor on the torque in motion, because the estimator explains part of a pulse by load and
#: friction. With it 97 % of the pulses added to held-out logs were found on a UR10e, 90 % on a UR5
#: and 92 % on a UR3. Without it 75 % were found, and 40 % of pulses as large as the median bound.
TRACKED = 1.25
#: Ratio of the torque in motion to the least bound, for logs with too few pulses.
LITTLE = 1.5
#: Numbers of poses and directions of the force at the tool.
POSES, DIRECTIONS = 24, 100


def threshold_card(
    detector: FittedFreeMotion, traces: Sequence[Trace], validation: CrossValidation
) -> ThresholdCard:
    """The card of a fitted detector.

    Args:
        detector: fitted.
        traces: training logs of the detector, for poses, regimes and bounds in motion.
        validation: the cross-validation of these logs.
    """
    bound, robot = detector.bound, detector.arm.robot
    judged = [detector.judge(trace) for trace in traces]
    sliding = np.maximum(bound.moving[:, 0], bound.least)
    usual = found_in_motion(judged)
    usual = np.where(np.isfinite(usual), usual, LITTLE * sliding)
    usual = np.where(bound.shown, usual, np.nan)
    poses = np.concatenate([t.q[:: max(1, len(t.q) // POSES)] for t in traces])
    poses = poses[:: max(1, len(poses) // POSES)]
    starting = np.maximum(usual, sliding) + bound.start
    own, slopes = np.stack([bound.fast, bound.hard]), bound.moving[:, 1:4].T
    faster = (1 + _observer.REGIME_HARDER) * bound.friction + (own * slopes[:2]).sum(axis=0)
    faster += bound.hard.max() * slopes[2]
    levels = {
        "standing": bound.rest / COUNTS,
        "slowly": bound.rest / COUNTS_SLOWLY,
        "stopped": (bound.rest + bound.stop) / COUNTS,
        "moving": usual,
    }
    alarms = sum(len(log.alarms) for log in validation.kept)
    return ThresholdCard(
        robot.joint_names,
        levels["standing"],
        levels["stopped"],
        usual,
        starting,
        {name: _tool(detector, poses, level) for name, level in levels.items()},
        _tool(detector, poses, usual, moment=True)[0],
        detector.seconds,
        alarms,
        poisson_rate(alarms, detector.seconds / 3600),
        validation.kept,
        validation.left_out,
        dict(detector.unseen),
        replayed(detector, traces, usual, starting),
        np.where(bound.shown, bound.fast, np.nan),
        usual + TRACKED * faster,
        tuple(itertools.compress(robot.joint_names, robot.prismatic)),
    )


def found_in_motion(judged: Sequence[Judged]) -> Array:
    """Torque of a pulse on a moving joint that is found [N m], (n,); NaN: too little motion.

    Pulses of 0.3 s and either sign are added to the residual at many times of the logs. For each,
    the least torque is computed that exceeds the bound for the confirmation time. The result is
    :data:`TRACKED` times the 90 % quantile of these torques.
    """
    found = np.full(judged[0].residual.shape[1], np.nan)
    needed: list[list[Array]] = [[] for _ in found]
    for part in judged:
        dt = float(np.median(np.diff(part.t)))
        length, lasts = round(PULSE / dt), max(3, round(LASTS / dt))
        if len(part.t) <= length or length < lasts:
            continue
        follows = 1 - np.exp(-FREE_GAIN * dt * (np.arange(length) + 0.5))
        places = np.arange(0, len(part.t) - length, max(1, length // 3))
        moves = ~part.rest & (part.t - part.t[0] > 2 * SETTLE)[:, None]
        for j, own in enumerate(needed):
            rows = places[sliding_window_view(moves[:, j], length)[places].all(axis=1)]
            left, bound = (
                sliding_window_view(x[:, j], length)[rows] for x in (part.residual, part.bound)
            )
            for sign in (-1, 1):
                enough = sliding_window_view((bound - sign * left) / follows, lasts, axis=1)
                own.append(enough.max(axis=2).min(axis=1))
    for j, own in enumerate(needed):
        levels = np.concatenate([np.empty(0), *own])
        if len(levels) >= PLACES:
            found[j] = TRACKED * float(np.quantile(levels, SHARE))
    return found


def replayed(
    detector: FittedFreeMotion, traces: Sequence[Trace], moving: Array, starting: Array
) -> tuple[int, int]:
    """Numbers of events in logs above constant thresholds, and of those above UPPER times these.

    The thresholds apply to an observer's external torque, as those in the settings of a robot do,
    with higher thresholds while a joint accelerates.

    Args:
        detector: its arm model is used.
        traces: logs.
        moving: thresholds [N m], shape (n,); NaN: none.
        starting: thresholds of a joint that starts [N m], shape (n,); NaN: none.
    """
    lower = upper = 0
    for trace in traces:
        estimator = Estimator(detector.arm, LOG_GAIN, trace.dt, Unknowns.none())
        residual = estimator.run(trace.t, trace.q, trace.qd, trace.current).residual
        limit = np.where(motion_regimes(trace)["starting"], starting, moving)
        ratio = (np.abs(residual) / np.where(np.isfinite(limit), limit, np.inf)).max(axis=1)
        ratio[trace.t - trace.t[0] < detector.settle] = 0.0
        contacts = find_alarms(trace.t, ratio > 1)
        harder = trace.t[ratio > UPPER]
        lower += len(contacts)
        upper += sum(((harder >= c.start) & (harder <= c.end)).any() for c in contacts)
    return lower, upper


def _tool(
    detector: FittedFreeMotion, poses: Array, level: Array, moment: bool = False
) -> tuple[float, float]:
    """Forces [N] or moments [N m] on the last link that reach the level of some joint.

    The values suffice in half and in 95 % of all poses and directions; infinite: none does.
    """
    robot = detector.arm.robot
    directions = np.random.default_rng(0).standard_normal((DIRECTIONS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    least: list[Array] = []
    last = np.array([robot.joints - 1])
    for q in poses:
        placed = link_poses(robot, q)
        turns = placed.axis * (placed.moved_by[-1] & ~robot.prismatic)[:, None]
        slides = point_jacobians(robot, placed, last, placed.origin[-1:])[0]
        torque = np.abs(directions @ (turns.T if moment else slides))
        with np.errstate(divide="ignore"):
            least.append(1 / np.nan_to_num(torque / level).max(axis=1))
    forces = np.concatenate(least)
    half, most = np.quantile(forces, (0.5, 0.95), method="higher")  # no means with infinity
    return float(half), float(most)
