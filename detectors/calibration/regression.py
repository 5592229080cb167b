"""The regression of the identification: filtered columns of recordings, and normal equations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array, Bools
from tauguard.detectors.calibration.recording import MOVING, Recording, known_load, moving_span
from tauguard.detectors.dynamics.friction import FrictionModel
from tauguard.detectors.dynamics.robot import (
    INERTIAL,
    RobotNumbers,
    momentum_regressor,
    momentum_terms,
)
from tauguard.detectors.estimation.observer import intervals, low_pass
from tauguard.detectors.events import confirmed, free_rows
from tauguard.traces.trace import Trace


@dataclass(frozen=True, eq=False)
class Filtered:
    """The quantities of one recording in the regression, after the observer's filter: R rows.

    The normal equations of each joint are cached. Rounds of least squares and calibrations without
    one of the recordings change only the weights of the joints.
    """

    torque: Array  #: nominal rigid-body torque without payload [N m], (R, n)
    current: Array  #: gain times current [N m], (R, n)
    inertial: Array  #: (R, n, 10 n)
    armature: Array  #: (R, n)
    friction: Array  #: (R, n, columns)
    weight: Array  #: of each row and joint, (R, n)

    def with_gain(self, factor: Array) -> Filtered:
        """The columns with gains times ``factor``, shape (n,); friction is not scaled."""
        return replace(self, current=self.current * factor)

    def design(self, joint: int, known: Array, measured: bool = False) -> Array:
        """Columns of one joint; ``known`` is the known load, shape (10,).

        ``measured``: see :class:`System`.
        """
        load = self.inertial[:, joint, -INERTIAL:]
        return np.column_stack(
            [
                -self.inertial[:, joint],
                -self.armature[:, joint],
                self.friction[:, joint],
                -self.current[:, joint] if measured else self.torque[:, joint] + load @ known,
                load,
            ]
        )

    def target(self, joint: int) -> Array:
        """The drive torque minus the nominal rigid-body torque [N m], shape (R,)."""
        out: Array = self.current[:, joint] - self.torque[:, joint]
        return out

    def normal(self, joint: int, known: Array, measured: bool = False) -> tuple[Array, Array]:
        """Normal equations of one joint with ``weight``, shapes (k, k) and (k,)."""
        kept = self.__dict__.setdefault("_normal", {})
        key = joint, known.tobytes(), measured
        if key not in kept:
            x, weight = self.design(joint, known, measured), self.weight[:, joint]
            weighed = x * (weight**2)[:, None]
            kept[key] = x.T @ weighed, self.target(joint) @ weighed
        found: tuple[Array, Array] = kept[key]
        return found


def filtered(
    recording: Recording,
    robot: RobotNumbers,
    gain: Array,
    model: FrictionModel,
    rate: float,
    rest: float = 0.5,
    load: Array | None = None,
) -> Filtered:
    """The quantities of a recording in the regression, with these gains.

    ``load``: inertial numbers of the load, for load-dependent friction, shape (10,) (default: those
    of ``recording.load``).
    """
    trace = recording.trace
    held = None
    if model.modelled:
        held = _carried(trace, robot, known_load(recording.load) if load is None else load)
    used = moving_span(trace) & free_rows(trace)
    return filtered_columns(trace, robot, gain, model, rate, used, rest, held)


def filtered_columns(
    trace: Trace,
    robot: RobotNumbers,
    gain: Array,
    model: FrictionModel,
    rate: float,
    used: Bools,
    rest: float | None = None,
    held: Array | None = None,
    sampled: bool = False,
) -> Filtered:
    """The quantities of given rows of a trace in the regression, thinned to intervals of 0.02 s.

    Args:
        trace: of the arm.
        robot: its nominal numbers.
        gain: N m per ampere, shape (n,).
        model: the columns of friction.
        rate: rate of the filter [1/s].
        used: which rows to use, shape (T,).
        rest: rows of a joint that has been at rest for longer get weight 0 [s]; ``None``: weight 1.
        held: load of load-dependent friction [N m], shape (T, n).
        sampled: see :class:`~tauguard.detectors.Estimator`.
    """
    stride = max(1, round(4e-3 / trace.dt))
    count = len(trace.t) // stride
    rows = count * stride

    def mean(x: Array) -> Array:
        """Mean over each thinned interval."""
        if sampled:
            x = (x + np.concatenate([x[1:], x[-1:]])) / 2
        out: Array = x[:rows].reshape(count, stride, *x.shape[1:]).mean(axis=1)
        return out

    tau = trace.current * gain
    columns = mean(model.evaluate(trace.q, trace.qd, tau, held))
    drive = mean(tau)
    q, qd, t = (x[:rows:stride] for x in (trace.q, trace.qd, trace.t))
    dt = intervals(t, count)

    def through(p: Array, beta: Array, driven: Array | None = None) -> Array:
        flat, other = p.reshape(count, -1), beta.reshape(count, -1)
        driven = None if driven is None else driven.reshape(count, -1)
        rates = np.full(flat.shape[1], rate)
        return low_pass(rates, dt, flat, other, driven).reshape(p.shape)

    nothing, no_columns = np.zeros_like(q), np.zeros_like(columns)
    keep = np.flatnonzero(used[:rows:stride])[:: max(1, round(0.02 / (stride * trace.dt)))]
    return Filtered(
        through(*momentum_terms(robot, q, qd))[keep],
        -through(nothing, nothing, drive)[keep],
        through(*momentum_regressor(robot, q, qd))[keep],
        through(np.ascontiguousarray(qd), nothing)[keep],
        -through(no_columns, no_columns, columns)[keep],
        _weights(trace, rest)[:rows:stride][keep],
    )


def _weights(trace: Trace, rest: float | None) -> Array:
    """0 where a joint has been at rest for ``rest`` [s], else 1, shape (T, n)."""
    if rest is None:
        return np.ones_like(trace.q)
    needed = max(1, round(rest / trace.dt))
    slow = np.abs(trace.qd) < MOVING
    still = np.column_stack([confirmed(column, needed) for column in slow.T])
    return np.where(still, 0.0, 1.0)


def body_deviations(robot: RobotNumbers, mass: float, centre: float, inertia: float) -> Array:
    """Standard deviations of all inertial numbers, shape (10 n,).

    Args:
        robot: the arm's nominal numbers.
        mass: standard deviation of each link's mass, relative.
        centre: standard deviation of each coordinate of the centre of mass [m].
        inertia: standard deviation of the inertia, relative to the link's largest entry.
    """
    body = []
    for numbers in robot.inertial:
        heavy, wide = max(float(numbers[0]), 1e-3), float(np.abs(numbers[4:]).max()) + 1e-3
        body += [mass * heavy, *[centre * heavy] * 3, *[inertia * wide] * 6]
    return np.array(body)


def _carried(trace: Trace, robot: RobotNumbers, load: Array) -> Array:
    """The load that load-dependent friction is proportional to [N m], shape (T, n)."""
    carrying = robot.inertial.copy()
    carrying[-1] += load
    return momentum_terms(robot.with_inertial(carrying), trace.q, trace.qd)[1]


class System:
    """Normal equations over errors of inertial numbers (dphi), armatures (da) and gains (s,
    relative), friction weights (w) and the torques of payloads (load).

    ``current = torque (1 + s) - inertial dphi - armature da + friction w + load``. The joint's new
    gain is the gain of this round divided by 1 + s. With ``measured``, the equation is
    ``current (1 + s) = torque - ...``, and the new gain is the gain times 1 + s. This needs priors
    of a few percent: with free gains the residual is smallest if all gains are near zero.
    """

    def __init__(
        self, robot: RobotNumbers, columns: int, recordings: int, measured: bool = False
    ) -> None:
        """Set all to zero, for a number of friction columns and of recordings.

        ``measured``: errors of the gains scale the measured torque, see the class.
        """
        self.measured = measured
        self.n, self.c, self.count = robot.joints, columns, recordings
        self.friction = (INERTIAL + 1) * self.n
        self.gain = self.friction + self.n * columns
        self.load = self.gain + self.n
        self.size = self.load + INERTIAL * recordings
        self.matrix = np.zeros((self.size, self.size))
        self.vector = np.zeros(self.size)

    def indices(self, joint: int, recording: int) -> NDArray[np.intp]:
        """Indices of the unknowns in one joint's rows of one recording."""
        own = np.arange(self.friction + joint * self.c, self.friction + (joint + 1) * self.c)
        load = self.load + INERTIAL * recording + np.arange(INERTIAL)
        body = np.arange(INERTIAL * self.n)
        return np.concatenate([body, [INERTIAL * self.n + joint], own, [self.gain + joint], load])

    def add(self, data: Filtered, recording: int, weight: Array, known: Array) -> None:
        """Add a recording; ``weight`` is one over each joint's error [1/(N m)], shape (n,)."""
        for joint in range(self.n):
            at = self.indices(joint, recording)
            matrix, vector = data.normal(joint, known, self.measured)
            self.matrix[np.ix_(at, at)] += weight[joint] ** 2 * matrix
            self.vector[at] += weight[joint] ** 2 * vector

    def solve(self, deviations: Array) -> Array:
        """The unknowns, shape (size,); those with a prior deviation of 0 stay 0."""
        out, free = np.zeros(self.size), np.flatnonzero(deviations > 0)
        matrix = self.matrix[np.ix_(free, free)] + np.diag(deviations[free] ** -2.0)
        out[free] = np.linalg.solve(matrix, self.vector[free])
        return out

    def residual(self, data: Filtered, recording: int, solution: Array, known: Array) -> Array:
        """The residual of the solution [N m], shape (R, n)."""
        out = np.empty_like(data.current)
        for joint in range(self.n):
            x = data.design(joint, known, self.measured)
            out[:, joint] = data.target(joint) - x @ solution[self.indices(joint, recording)]
        return out
