"""Per-joint thresholds on the residual, learned from seconds that the user vouches for.

Two regimes a joint, because static friction is indeterminate: still (|qd| < 0.01 rad/s for 150 ms)
and moving. A threshold is a factor times the largest residual that the quiet seconds showed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.estimation.estimator import ArmModel, Estimator, Unknowns
from tauguard.detectors.evaluation.events import find_alarms
from tauguard.detectors.thresholds.confirmation import confirmation_samples, confirmed
from tauguard.traces.trace import Bools, Detection, Trace

Array = NDArray[np.float64]

#: A joint slower than this [rad/s] for this long [s] stands still.
STILL_SPEED, STILL_TIME = 0.01, 0.15


def still(qd: Array, dt: float) -> Bools:
    """Which joints stand still at each sample, shape (T, n)."""
    samples = max(1, round(STILL_TIME / dt))
    return np.column_stack([confirmed(np.abs(v) < STILL_SPEED, samples) for v in qd.T])


@dataclass(frozen=True, eq=False)
class QuietThresholds:
    """Thresholds of each joint, still and moving."""

    still: Array  #: [N m], shape (n,)
    moving: Array  #: [N m], shape (n,)

    @classmethod
    def learn(cls, left: Array, qd: Array, dt: float, factor: float = 1.5) -> QuietThresholds:
        """``factor`` times the largest residual in each regime.

        A regime that the quiet seconds do not show borrows the larger of the joint's other one.

        Args:
            left: residual without collision [N m], shape (T, n).
            qd: [rad/s], shape (T, n).
            dt: sample interval [s].
            factor: head-room above what was seen.

        Raises:
            ValueError: fewer than two samples, or a factor that is not above 0.
        """
        if len(left) < 2 or not factor > 0:
            raise ValueError(f"{len(left)} quiet samples, factor {factor}: expected 2 and above 0")
        rests = still(qd, dt)
        size = np.abs(left)
        peaks = [np.where(mask, size, 0).max(axis=0) for mask in (rests, ~rests)]
        seen = [mask.any(axis=0) for mask in (rests, ~rests)]
        low, high = (np.where(seen[k], peaks[k], np.maximum(peaks[0], peaks[1])) for k in (0, 1))
        floor = 1e-9
        return cls(np.maximum(factor * low, floor), np.maximum(factor * high, floor))

    def score(self, left: Array, qd: Array, dt: float) -> Array:
        """The largest ratio of residual to threshold over joints, shape (T,)."""
        limit = np.where(still(qd, dt), self.still, self.moving)
        ratio: Array = (np.abs(left) / limit).max(axis=1)
        return ratio


class QuietDetector:
    """A detector without a model file: estimator and thresholds from the first quiet seconds."""

    def __init__(
        self,
        arm: ArmModel,
        *,
        quiet: float = 10.0,
        observer_gain: float = 20.0,
        factor: float = 1.5,
        confirmation: float = 0.05,
        settle: float = 1.0,
        unknowns: Unknowns | None = None,
    ) -> None:
        """Keep the settings.

        Args:
            arm: the model.
            quiet: seconds from the trace's beginning without a collision.
            observer_gain: [1/s].
            factor: head-room of the thresholds.
            confirmation: how long a threshold must be exceeded [s].
            settle: seconds at the beginning that the observer needs; never an alarm.
            unknowns: what the estimator tracks (default: payload, offsets, friction).
        """
        if not quiet > settle >= 0:
            raise ValueError(f"quiet {quiet} s: must be longer than the {settle} s to settle")
        self.arm, self.quiet, self.factor = arm, quiet, factor
        self.observer_gain, self.confirmation, self.settle = observer_gain, confirmation, settle
        self.unknowns = unknowns

    def detect(self, trace: Trace) -> Detection:
        """Learn from the quiet seconds and judge the rest.

        Raises:
            ValueError: the trace is not longer than the quiet seconds.
        """
        since = trace.t - trace.t[0]
        if since[-1] <= self.quiet:
            raise ValueError(
                f"the trace lasts {since[-1]:g} s, all of it within the {self.quiet:g} quiet "
                "seconds: give a longer one or fewer quiet seconds"
            )
        estimator = Estimator(self.arm, self.observer_gain, trace.dt, self.unknowns)
        left = estimator.run(trace.t, trace.q, trace.qd, trace.current).left
        vouched = (since >= self.settle) & (since <= self.quiet)
        thresholds = QuietThresholds.learn(left[vouched], trace.qd[vouched], trace.dt, self.factor)
        score = thresholds.score(left, trace.qd, trace.dt)
        score[since < self.settle] = 0.0
        alarm = confirmed(score > 1, confirmation_samples(self.confirmation, trace.dt))
        alarm &= since > self.quiet
        return Detection(
            "quiet-thresholds", trace.t, left, score, 1.0, alarm, find_alarms(trace.t, alarm)
        )
