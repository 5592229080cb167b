"""What a log says before any model of a drive: smooth motion, and the bodies' torque along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from tauguard.arrays import Array, Bools
from tauguard.detectors import ArmModel, inverse_dynamics
from tauguard.traces import Trace

#: A joint that is slower stands [rad/s].
SLOW = 0.02
#: Standard deviation of the filter before velocities are differentiated [s].
SMOOTHING = 0.02


@dataclass(frozen=True, eq=False)
class Motion:
    """A log's motion, smoothed without delay, and what bodies and rotors ask of the drives."""

    t: Array  #: [s], shape (T,)
    q: Array  #: [rad], shape (T, n)
    qd: Array  #: [rad/s], shape (T, n)
    bodies: Array  #: torque of gravity and inertia [N m], shape (T, n)

    @property
    def moving(self) -> Bools:
        """Whether each joint moves, shape (T, n)."""
        return np.asarray(np.abs(self.qd) > SLOW)


def motion_of(arm: ArmModel, trace: Trace) -> Motion:
    """The motion of a log, and its torque by the calibrated bodies.

    Args:
        arm: calibrated.
        trace: of the same joints.
    """
    width = SMOOTHING / float(np.median(np.diff(trace.t)))
    qd = gaussian_filter1d(trace.qd, width, axis=0)
    qdd = np.gradient(qd, trace.t, axis=0)
    bodies = inverse_dynamics(arm.robot, trace.q, qd, qdd)
    return Motion(trace.t, trace.q, qd, bodies)


def quantum(signal: Array) -> float:
    """The step of a quantised signal, 0 where none is seen; shape (T,).

    The step is the smallest distance between values that occur, if nearly all distances are
    multiples of it.
    """
    gaps = np.diff(np.unique(np.round(signal, 9)))
    gaps = gaps[gaps > 1e-8]
    if len(gaps) < 20:
        return 0.0
    step = float(np.median(gaps[gaps < 1.5 * np.quantile(gaps, 0.05)]))
    turns = gaps / step
    off = np.abs(turns - np.rint(turns)) * step
    return step if np.mean(off < 0.1 * step) > 0.8 else 0.0


def white_noise(signal: Array, step: float) -> float:
    """Standard deviation of what changes from sample to sample, without rounding; shape (T,).

    Third differences cancel motion: their variance is 20 times that of white noise. The median
    keeps jumps out.
    """
    if len(signal) < 4:
        return 0.0
    third = np.diff(signal, 3)
    variance = (float(np.median(np.abs(third))) / 0.6745) ** 2 / 20
    return float(np.sqrt(max(variance - step**2 / 12, 0.0)))
