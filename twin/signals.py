"""Motion of a log, and the rigid-body torque along it."""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from tauguard.arrays import Array, Bools
from tauguard.detectors import ArmModel, inverse_dynamics
from tauguard.detectors.calibration.recording import cut
from tauguard.detectors.dynamics.robot import momentum_terms
from tauguard.traces import Trace

#: A joint slower than this is at rest [rad/s].
SLOW = 0.02
#: Standard deviation of the velocity filter for the friction [s].
SMOOTHING = 0.02
#: Least length of a gap at which a log is split, in sample intervals.
GAP = 4.0
#: Time before and after a log's last stop that is left out [s].
STOP = 0.05


@dataclass(frozen=True, eq=False)
class Motion:
    """A log's motion, and the torques of bodies and rotors."""

    t: Array  #: [s], shape (T,)
    qd: Array  #: smoothed without delay [rad/s], shape (T, n)
    load: Array  #: torque of gravity and inertia along the smoothed motion [N m], shape (T, n)
    bodies: Array  #: torque without smoothing, see :func:`motion_of` [N m], (T, n)

    @property
    def moving(self) -> Bools:
        """Whether each joint moves, shape (T, n)."""
        return np.asarray(np.abs(self.qd) > SLOW)


def motion_of(arm: ArmModel, trace: Trace) -> Motion:
    """The motion of a log, and the torque of the calibrated bodies along it.

    ``bodies`` is the torque with which the residual of a momentum observer is 0. It contains the
    change of the measured momentum over each interval, with vibrations, as the currents do.

    Args:
        arm: calibrated.
        trace: a log of this arm.
    """
    width = SMOOTHING / float(np.median(np.diff(trace.t)))
    qd = gaussian_filter1d(trace.qd, width, axis=0)
    load = inverse_dynamics(arm.robot, trace.q, qd, np.gradient(qd, trace.t, axis=0))
    momentum, beta = momentum_terms(arm.robot, trace.q, trace.qd, threads=1)
    held = 0.5 * (beta[:-1] + beta[1:])
    bodies = np.diff(momentum, axis=0) / np.diff(trace.t)[:, None] - held
    return Motion(trace.t, qd, load, np.concatenate([bodies, bodies[-1:]]))


def without_gaps(trace: Trace, shortest: float = 1.0) -> list[Trace]:
    """The parts of a log between gaps in its samples that are longer than ``shortest`` [s]."""
    steps = np.diff(trace.t)
    ends = [0, *(np.flatnonzero(steps > GAP * np.median(steps)) + 1), len(trace.t)]
    parts = [slice(a, b) for a, b in itertools.pairwise(ends)]
    return [cut(trace, p) for p in parts if trace.t[p.stop - 1] - trace.t[p.start] > shortest]


def bridged_stop(trace: Trace, error: Array) -> Array:
    """The error along a log, interpolated over its last stop, shape (T, n).

    When a program is interrupted, all joints brake within one or two samples. The log does not
    resolve this, so the model's torque is wrong by hundreds of N m.
    """
    moves = np.flatnonzero((np.abs(trace.qd) > SLOW).any(axis=1))
    if not len(moves):
        return error
    used = np.abs(trace.t - trace.t[moves[-1]]) > STOP
    rows = [np.interp(trace.t, trace.t[used], column[used]) for column in error.T]
    return np.stack(rows, axis=1)


def quantum(signal: Array) -> float:
    """The quantum of a signal of shape (T,), or 0 if the signal is not quantised.

    It is the smallest distance between values that occur, if nearly all distances are multiples of
    it.
    """
    gaps = np.diff(np.unique(np.round(signal, 9)))
    gaps = gaps[gaps > 1e-8]
    if len(gaps) < 20:
        return 0.0
    step = float(np.median(gaps[gaps < 1.5 * np.quantile(gaps, 0.05)]))
    turns = gaps / step
    off = np.abs(turns - np.rint(turns)) * step
    return step if np.mean(off < 0.1 * step) > 0.8 else 0.0
