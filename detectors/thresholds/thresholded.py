"""A detector with a threshold: from scores to alarms, the same way for every detector."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.detector import Detector
from tauguard.detectors.estimation.estimator import ArmModel, Estimator, Unknowns
from tauguard.detectors.evaluation.events import find_alarms
from tauguard.detectors.thresholds.confirmation import CONFIRMATION, confirmation_samples, confirmed
from tauguard.detectors.thresholds.rates import sustained
from tauguard.traces.trace import Detection, Trace

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Thresholded:
    """A fitted detector, the threshold on its score and the confirmation filter."""

    detector: Detector
    threshold: float  #: of the score; an alarm needs scores above it
    confirmation: float = CONFIRMATION  #: t_c [s]

    def levels(self, trace: Trace) -> Array:
        """The level that scores keep for t_c, shape (T,): above the threshold is an alarm.

        Before the detector has settled the level is -inf: never an alarm.
        """
        level = sustained(self.detector.scores(trace), self._samples(trace)).copy()
        level[trace.t - trace.t[0] < self._first(trace)] = -np.inf
        return level

    def detect(self, trace: Trace) -> Detection:
        """Judge a trace; no alarm before the detector has settled."""
        score = self.detector.scores(trace)
        raw = (score > self.threshold) & (trace.t - trace.t[0] >= self.detector.settle)
        alarm = confirmed(raw, self._samples(trace))
        return Detection(
            detector=self.detector.name,
            t=trace.t,
            residual=plain_residual(self.detector.arm, trace),
            score=score,
            threshold=self.threshold,
            alarm=alarm,
            alarms=find_alarms(trace.t, alarm),
        )

    def _samples(self, trace: Trace) -> int:
        return confirmation_samples(self.confirmation, trace.dt)

    def _first(self, trace: Trace) -> float:
        """Time since the trace's beginning from which an alarm can be up [s]."""
        return self.detector.settle + (self._samples(trace) - 1.5) * trace.dt


#: Rate of the observer without unknowns [1/s].
PLAIN_GAIN = 100.0


def plain_residual(arm: ArmModel, trace: Trace) -> Array:
    """The momentum observer's estimate of tau_ext at 100/s with no unknowns [N m], shape (T, n)."""
    estimator = Estimator(arm, PLAIN_GAIN, trace.dt, Unknowns.none())
    return estimator.run(trace.t, trace.q, trace.qd, trace.current).residual
