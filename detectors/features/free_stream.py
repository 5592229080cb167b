"""From an arm's samples to each joint's ratio of signal to bound, one sample at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.dynamics.robot import momentum_regressor, momentum_terms
from tauguard.detectors.estimation.estimator import ArmModel, Estimator, Unknowns
from tauguard.detectors.estimation.slow_errors import LOAD, LoadDeviation, SlowErrors
from tauguard.detectors.features.free_bound import Bound, JointRegimes

Array = NDArray[np.float64]

#: Rate of the observer [1/s]: what 100 Hz and a real arm's friction allow.
GAIN = 30.0
#: Rate at which momentum is differentiated [1/s].
INERTIAL_GAIN = 40.0
#: Samples that come faster are averaged to this interval [s]: a bound is about tens of ms.
INTERVAL = 4e-3


class Differentiator:
    """The observer's filter on ``dp/dt - beta`` of any columns, one sample at a time."""

    def __init__(self, gain: float) -> None:
        """Begin with nothing seen."""
        self._gain = gain
        self._p: Array | None = None
        self._beta = self.value = np.zeros(0)

    def step(self, p: Array, beta: Array, dt: float) -> Array:
        """The filtered ``dp/dt - beta``, shape of ``p``; zero at first."""
        if self._p is None:
            self.value = np.zeros_like(p)
        else:
            drive = (p - self._p) / dt - 0.5 * (beta + self._beta)
            self.value = self.value + (1 - np.exp(-self._gain * dt)) * (drive - self.value)
        self._p, self._beta = p, beta
        return self.value


class FreeStream:
    """The free-motion detector on one recording.

    Attributes:
        ratio: of each joint's signal to its bound at the last sample, shape (n,).
        residual: without slow errors [N m], shape (n,).
        regimes: what each joint does, and its bound.
    """

    def __init__(self, arm: ArmModel, bound: Bound, load: LoadDeviation, dt: float) -> None:
        """Begin anew.

        Args:
            arm: calibrated.
            bound: of its joints.
            load: how uncertain the carried load is.
            dt: sample interval for steps that do not say theirs [s].
        """
        n = arm.robot.joints
        self._robot, self._dt = arm.robot, dt
        self._observers = [
            Estimator(own, GAIN, dt, Unknowns.none()) for own in (arm, replace(arm, friction=None))
        ]
        self._residuals = np.zeros((2, 3, n))
        self._load, self._momentum = Differentiator(GAIN), Differentiator(INERTIAL_GAIN)
        self._slow = SlowErrors(bound.friction, load)
        self._sums, self._count, self._time = np.zeros((3, n)), 0, 0.0
        self._last: list[tuple[Array, Array, Array, float]] = []
        self.regimes = JointRegimes(bound)
        self.ratio, self.residual = np.zeros(n), np.zeros(n)

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> float:
        """The score of this sample: the largest ratio.

        Args:
            q: [rad], float64, shape (n,).
            qd: [rad/s], shape (n,).
            current: [A], shape (n,).
            dt: time since the last sample [s] (default: the constructor's).

        Raises:
            ValueError: wrong shapes or numbers that are not finite.
        """
        try:
            sample = np.stack([q, qd, current])
        except ValueError:
            sample = np.empty(0)
        if sample.shape != self._sums.shape or not np.isfinite(sample).all():
            raise ValueError(
                f"q, qd, current: expected finite float64 arrays of shape ({len(self.ratio)},)"
            )
        interval = self._dt if dt is None else dt
        self._sums += sample
        self._count += 1
        self._time += interval
        if self._time > INTERVAL - 0.5 * interval:
            mean = self._sums / self._count
            self._take(mean[0], mean[1], mean[2], self._time)
            self._sums, self._count, self._time = np.zeros_like(self._sums), 0, 0.0
        return float(self.ratio.max())

    def _take(self, q: Array, qd: Array, current: Array, dt: float) -> None:
        """One sample; what is judged is the one before, with the median of three currents."""
        self._last = [*(self._last or [(q, qd, current, dt)] * 2)[-2:], (q, qd, current, dt)]
        middle = np.median([one[2] for one in self._last], axis=0)
        at, speed, _, _ = self._last[1]
        interval = self._last[1][3]
        for observer, out in zip(self._observers, self._residuals, strict=True):
            observer.step(at, speed, middle, out, interval)
        left, bare = self._residuals[0, 0], self._residuals[1, 0]
        row, v = at[None], speed[None]
        last = self._robot.joints - 1
        p, beta = momentum_regressor(self._robot, row, v, link=last, count=LOAD, threads=1)
        load = -self._load.step(p[0], beta[0], interval)
        momentum = momentum_terms(self._robot, row, v, threads=1)[0][0]
        inertial = self._momentum.step(momentum, np.zeros_like(momentum), interval)
        regimes = self.regimes
        regimes.motion(qd, inertial, dt)
        self.residual, spread = self._slow.step(left, load, bare - left, regimes.moved, dt)
        self.ratio = regimes.judge(self.residual, spread, dt)
