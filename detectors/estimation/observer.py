"""The momentum observer, and its gain [1/s] for each use.

A higher gain detects an impact earlier and passes more noise. A gain far above a fifth of the
sample rate has no further benefit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array
from tauguard.detectors import _observer
from tauguard.detectors.dynamics.robot import RobotNumbers, momentum_terms, rows, same_rows
from tauguard.findings import ArgumentError

#: Default, for reports and recordings.
PLAIN_GAIN = 100.0

#: Detectors at 1 kHz and the diagnosis of their alarms: a lag of 5 ms.
DETECTION_GAIN = 200.0

#: Environments: steps of the control signal must not raise an alarm.
ENVIRONMENT_GAIN = 50.0

#: Logs of real arms at 100 Hz or more without training: errors of friction allow no higher gain.
LOG_GAIN = 20.0


def per_joint(name: str, value: ArrayLike, joints: int) -> Array:
    """``value`` as one positive number per joint, shape (joints,).

    Raises:
        ArgumentError: another shape, or a number that is not finite and above 0.
    """
    array = np.asarray(value, dtype=np.float64)
    if array.ndim == 0:
        array = np.full(joints, float(array))
    if array.shape != (joints,):
        raise ArgumentError(f"{name}: shape {array.shape}, expected one number or ({joints},)")
    if not (np.isfinite(array).all() and (array > 0).all()):
        raise ArgumentError(f"{name}: {array.tolist()}, every entry must be finite and above 0")
    return np.ascontiguousarray(array)


def intervals(t: ArrayLike, samples: int) -> Array:
    """Sample intervals [s], shape (samples - 1,), from times or from one constant interval.

    Args:
        t: times [s], shape (samples,), or the interval itself, a number.
        samples: how many rows the signals have.

    Raises:
        ArgumentError: times that do not fit or do not increase; names the row.
    """
    times = np.asarray(t, dtype=np.float64)
    if times.ndim == 0:
        if not (np.isfinite(times) and times > 0):
            raise ArgumentError(f"t: interval {times}, expected a number above 0")
        return np.full(max(samples - 1, 0), float(times))
    if times.shape != (samples,):
        raise ArgumentError(f"t: shape {times.shape}, expected ({samples},)")
    dt = np.diff(times)
    if not (dt > 0).all():
        raise ArgumentError(f"t: not increasing at row {int(np.flatnonzero(~(dt > 0))[0]) + 1}")
    return dt


def low_pass(gain: ArrayLike, dt: Array, p: Array, beta: Array, tau: Array | None = None) -> Array:
    """The observer's low-pass of ``dp/dt - tau - beta`` for each column, shape (T, c).

    Args:
        gain: rate of each column [1/s], shape (c,).
        dt: intervals [s], shape (T - 1,).
        p: shape (T, c).
        beta: shape (T, c).
        tau: constant between samples, shape (T, c) (default: zero).
    """
    out = np.empty(p.shape)
    driven = np.empty((0, p.shape[1])) if tau is None else tau
    _observer.filter(per_joint("gain", gain, p.shape[1]), dt, p, beta, driven, out)
    return out


def lagged(gain: ArrayLike, dt: Array, signal: Array) -> Array:
    """A signal with the observer's lag, shape (T, c); arguments as for :func:`low_pass`."""
    nothing = np.zeros(signal.shape)
    return -low_pass(gain, dt, nothing, nothing, np.ascontiguousarray(signal))


def observe(
    robot: RobotNumbers,
    t: ArrayLike,
    q: ArrayLike,
    qd: ArrayLike,
    tau: ArrayLike,
    gain: ArrayLike = PLAIN_GAIN,
    *,
    threads: int = 0,
) -> Array:
    """The residual at every sample, equal to that of :class:`MomentumObserver`.

    Args:
        robot: the arm.
        t: times [s], shape (T,), or a constant interval [s].
        q: positions [rad], shape (T, n).
        qd: velocities [rad/s], shape (T, n).
        tau: drive torques at the joints minus known friction [N m], shape (T, n).
        gain: observer gain [1/s], a number or one per joint.
        threads: 0 takes all processors; the result does not depend on it.

    Returns:
        Residual [N m], the estimate of ``tau_ext``, shape (T, n); the first row is zero.

    Raises:
        ArgumentError: shapes that differ, values that are not finite, times that do not increase.
    """
    q, qd, tau = same_rows(robot.joints, q=q, qd=qd, tau=tau)
    dt = intervals(t, len(q))
    p, beta = momentum_terms(robot, q, qd, threads=threads)
    return low_pass(per_joint("gain", gain, robot.joints), dt, p, beta, tau)


class MomentumObserver:
    """The observer, sample by sample; a step takes a few microseconds."""

    def __init__(self, robot: RobotNumbers, gain: ArrayLike = PLAIN_GAIN, dt: float = 1e-3) -> None:
        """A new observer.

        Args:
            robot: the arm.
            gain: observer gain [1/s], a number or one per joint.
            dt: default sample interval of :meth:`step` [s].
        """
        self.robot = robot
        self.gain = per_joint("gain", gain, robot.joints)
        self.dt = float(intervals(dt, 2)[0])
        self.native = _observer.Observer(robot.chain, self.gain)

    def reset(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike | None = None) -> None:
        """Set the residual to zero, and the last sample to ``(q, qd, tau)``.

        Args:
            q: positions [rad], shape (n,).
            qd: velocities [rad/s], shape (n,).
            tau: drive torques until the next sample [N m], shape (n,) (default: torques that keep
                the momentum constant, which at rest is gravity compensation).
        """
        n = self.robot.joints
        at, speed = rows("q", np.atleast_2d(q), n), rows("qd", np.atleast_2d(qd), n)
        if tau is None:
            tau = -momentum_terms(self.robot, at, speed, threads=1)[1]
        self.native.reset(at[0], speed[0], rows("tau", np.atleast_2d(tau), n)[0])

    def get_state(self) -> Array:
        """The observer's state between two steps, shape (1 + 4 n,)."""
        return np.array(self.native.state())

    def set_state(self, state: Array) -> None:
        """Restore a state of :meth:`get_state`.

        Raises:
            ArgumentError: a state of an arm with other joints.
        """
        self.native.restore(state.tolist())

    def step(
        self,
        q: Array,
        qd: Array,
        tau: Array,
        dt: float | None = None,
        out: Array | None = None,
    ) -> Array:
        """The residual at this sample; the first call of a new observer resets it, returning zero.

        Args:
            q: positions [rad], float64, shape (n,).
            qd: velocities [rad/s], shape (n,).
            tau: drive torques [N m], shape (n,); they are used in the next step.
            dt: time since the last sample [s] (default: the constructor's).
            out: where to write the residual, shape (n,) (default: a new array).

        Returns:
            Residual [N m], shape (n,).

        Raises:
            ArgumentError: wrong shapes or numbers that are not finite; the state is as before.
        """
        if out is None:
            out = np.empty_like(self.gain)
        try:
            if self.native.started:
                self.native.step(q, qd, tau, self.dt if dt is None else dt, out)
            else:
                self.native.reset(q, qd, tau)
                out[:] = 0.0
        except TypeError:
            n = self.robot.joints
            raise ArgumentError(f"q, qd, tau: expected float64 arrays of shape ({n},)") from None
        return out
