"""The residual around an alarm, with payload, offsets and friction errors fixed before the alarm.

The estimator continues to adapt during a contact, and would soon explain a long contact by a
payload. A diagnosis therefore uses payload, offsets and friction errors from shortly before the
alarm, so that the contact's torque stays in the residual until the contact ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.detectors.dynamics.robot import momentum_regressor
from tauguard.detectors.estimation.estimator import PAYLOAD, ArmModel, Estimate, Estimator
from tauguard.detectors.estimation.noise_model import NoiseModel
from tauguard.detectors.estimation.observer import DETECTION_GAIN, intervals, low_pass
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Alarm, Trace

#: Largest observer gain, as a fraction of the sample rate.
PER_SAMPLE = 0.2

#: Time before the alarm at which the estimates are fixed [s].
BEFORE = 0.02

#: Length of the window after the alarm [s], and its least length in time constants of the observer.
AFTER, LAGS = 0.3, 10.0

#: Number of time constants of the observer after which its initial state has no effect.
SETTLED = 10.0

#: A contact begins where the residual was last below ``RISE`` times its level at the alarm, but at
#: most ``BEGUN`` before the alarm [s].
BEGUN, RISE = 0.6, 0.2

#: A contact is followed while its alarm lasts, at most this long [s].
LONGEST = 2.0


@dataclass(frozen=True, eq=False)
class PostAlarmWindow:
    """Samples from shortly before an alarm to some time after it, one row each."""

    rows: NDArray[np.int64]  #: rows of the trace, shape (M,)
    t: Array  #: time since the alarm [s], shape (M,)
    q: Array  #: [rad], shape (M, n)
    qd: Array  #: [rad/s], shape (M, n)
    residual: Array  #: minus payload, offsets and friction errors before the alarm [N m], (M, n)
    deviation: Array  #: standard deviation of the residual in free motion [N m], shape (M, n)
    payload: Array  #: residual per unit of payload mass [kg] and moment [kg m], shape (M, n, 4)
    lag: float = 1 / DETECTION_GAIN  #: time constant of the observer [s]

    @property
    def level(self) -> Array:
        """Norm of the residual in units of the noise, shape (M,)."""
        return np.asarray(np.linalg.norm(self.residual / self.deviation, axis=1))


class PostAlarmWindows:
    """Windows around the alarms of one trace."""

    def __init__(self, arm: ArmModel, noise_model: NoiseModel | None, trace: Trace) -> None:
        """Run the estimator over the trace.

        Args:
            arm: the arm model.
            noise_model: of the residual in free motion (default: ``arm.noise`` at every speed).
            trace: trace of this arm.
        """
        assert arm.noise is not None
        self.arm, self.trace = arm, trace
        self._noise_model = noise_model or NoiseModel.constant(arm.noise)
        self._gain = min(DETECTION_GAIN, PER_SAMPLE / trace.dt)
        self._estimate: Estimate = Estimator(arm, self._gain, trace.dt).run(
            trace.t, trace.q, trace.qd, trace.current, keep=True
        )

    def whole(self, alarm: Alarm, since: float = -np.inf) -> PostAlarmWindow:
        """The samples of a contact from its beginning until its alarm ends.

        Args:
            alarm: an alarm of the trace.
            since: earliest beginning of the contact [s].
        """
        before = alarm.start - max(self._onset(alarm.start), since) + BEFORE
        lasts = min(alarm.end - alarm.start, LONGEST)
        return self.at(alarm.start, max(AFTER, lasts), max(before, BEFORE))

    def _onset(self, start: float) -> float:
        """Time at which the rise of the residual that caused the alarm began [s]."""
        t = self.trace.t
        assert self.arm.noise is not None
        rows = slice(*np.searchsorted(t, (start - BEGUN, start + 0.5 * self.trace.dt)))
        seen, at = self._estimate.residual[rows], t[rows]
        if len(at) < 4:
            return start
        seen = (seen - np.median(seen[: len(at) // 3], axis=0)) / self.arm.noise
        level = seen @ seen[-1] / max(float(seen[-1] @ seen[-1]), 1e-12)
        return float(at[np.flatnonzero(level < RISE)[-1:]].max(initial=at[0]))

    def at(self, start: float, after: float = AFTER, before: float = BEFORE) -> PostAlarmWindow:
        """The samples around an alarm that starts at ``start`` [s].

        Args:
            start: start of the alarm [s].
            after: length of the window after ``start`` [s].
            before: time before ``start`` at which payload, offsets and friction errors are fixed
                [s].

        Raises:
            ArgumentError: ``start`` is not within the trace.
        """
        trace, known, lag = self.trace, self._estimate, 1 / self._gain
        after = max(after, LAGS * lag)
        if not trace.t[0] <= start <= trace.t[-1]:
            raise ArgumentError(
                f"start {start} s: the trace goes from {trace.t[0]} to {trace.t[-1]}"
            )
        assert known.unknowns is not None
        begin, first, at, last = np.searchsorted(
            trace.t, (start - before - SETTLED * lag, start - before, start, start + after)
        )
        # At low sample rates: begin at least one sample before the alarm, if there is one.
        first, begin = min(first, max(at - 1, 0)), min(begin, max(at - 1, 0))
        columns = self._payload_columns(slice(begin, last + 1))[first - begin :]
        rows = np.arange(first, first + len(columns))
        taken = known.residual[first] - known.unexplained[first]
        carried = (columns - columns[0]) @ known.unknowns[first, :PAYLOAD]
        return PostAlarmWindow(
            rows,
            trace.t[rows] - start,
            trace.q[rows],
            trace.qd[rows],
            known.residual[rows] - taken - carried,
            self._noise_model.scale(trace.qd[rows], known.motion[rows]),
            columns,
            lag,
        )

    def _payload_columns(self, rows: slice) -> Array:
        """Change of the residual by a payload at the last link, per unit, shape (M, n, 4)."""
        trace, n = self.trace, self.arm.robot.joints
        p, beta = momentum_regressor(
            self.arm.robot, trace.q[rows], trace.qd[rows], link=n - 1, count=PAYLOAD, threads=1
        )
        dt = intervals(trace.t[rows], len(p))
        flat = (len(p), n * PAYLOAD)
        gains = np.full(n * PAYLOAD, self._gain)
        passed = low_pass(gains, dt, p.reshape(flat), beta.reshape(flat))
        return -passed.reshape(len(p), n, PAYLOAD)
