"""The regression of identification: filtered columns of each recording, and normal equations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.detectors.calibration.calibrate import free_rows
from tauguard.detectors.calibration.recording import MOVING, Recording, known_load, moving_span
from tauguard.detectors.dynamics.friction import FrictionModel
from tauguard.detectors.dynamics.robot import (
    INERTIAL,
    RobotNumbers,
    momentum_regressor,
    momentum_terms,
)
from tauguard.detectors.estimation.observer import intervals, low_pass
from tauguard.detectors.thresholds.confirmation import confirmed
from tauguard.traces.trace import Trace


@dataclass(frozen=True)
class Filtered:
    """Everything that the regression needs of one recording, behind the observer's filter."""

    torque: Array  #: nominal rigid-body torque less payload [N m], (R, n)
    current: Array  #: gain times current [N m], (R, n)
    inertial: Array  #: (R, n, 10 n)
    armature: Array  #: (R, n)
    friction: Array  #: (R, n, columns)
    weight: Array  #: of each row and joint, (R, n)


def filtered(
    recording: Recording,
    robot: RobotNumbers,
    gain: Array,
    model: FrictionModel,
    rate: float,
    rest: float = 0.5,
    load: Array | None = None,
) -> Filtered:
    """Everything that the regression needs of a recording at these gains.

    ``load`` is what it carries, shape (10,), for friction that depends on it (default: as told).
    """
    trace = recording.trace
    stride = max(1, round(4e-3 / trace.dt))
    count = len(trace.t) // stride
    rows = count * stride

    def mean(x: Array) -> Array:
        out: Array = x[:rows].reshape(count, stride, *x.shape[1:]).mean(axis=1)
        return out

    tau = trace.current * gain
    if model.modelled:
        held = _carried(trace, robot, known_load(recording) if load is None else load)
        columns = mean(model.evaluate(trace.q, trace.qd, tau, held))
    else:
        columns = mean(model.evaluate(trace.q, trace.qd, tau))
    drive = mean(tau)
    q, qd, t = (x[:rows:stride] for x in (trace.q, trace.qd, trace.t))
    dt = intervals(t, count)

    def through(p: Array, beta: Array, held: Array | None = None) -> Array:
        flat, other = p.reshape(count, -1), beta.reshape(count, -1)
        driven = None if held is None else held.reshape(count, -1)
        rates = np.full(flat.shape[1], rate)
        return low_pass(rates, dt, flat, other, driven).reshape(p.shape)

    nothing, no_columns = np.zeros_like(q), np.zeros_like(columns)
    used = moving_span(trace) & free_rows(trace)
    keep = np.flatnonzero(used[:rows:stride])[:: max(1, round(0.02 / (stride * trace.dt)))]
    slow = np.abs(trace.qd) < MOVING
    needed = max(1, round(rest / trace.dt))
    still = np.column_stack([confirmed(column, needed) for column in slow.T])[:rows:stride]
    return Filtered(
        through(*momentum_terms(robot, q, qd))[keep],
        -through(nothing, nothing, drive)[keep],
        through(*momentum_regressor(robot, q, qd))[keep],
        through(np.ascontiguousarray(qd), nothing)[keep],
        -through(no_columns, no_columns, columns)[keep],
        np.where(still, 0.0, 1.0)[keep],
    )


def _carried(trace: Trace, robot: RobotNumbers, load: Array) -> Array:
    """What load-dependent friction grows with [N m], shape (T, n)."""
    carrying = robot.inertial.copy()
    carrying[-1] += load
    return momentum_terms(robot.with_inertial(carrying), trace.q, trace.qd)[1]


class System:
    """Normal equations over errors of inertia and armature, friction, gains and payloads.

    ``current = torque (1 + s) - inertial dphi - armature da + friction w + load``, and the gain of
    a joint is that of the round divided by 1 + s.
    """

    def __init__(self, robot: RobotNumbers, columns: int, recordings: int) -> None:
        """All zero, for a number of friction columns and of recordings."""
        self.n, self.c, self.count = robot.joints, columns, recordings
        self.friction = (INERTIAL + 1) * self.n
        self.gain = self.friction + self.n * columns
        self.load = self.gain + self.n
        self.size = self.load + INERTIAL * recordings
        self.matrix = np.zeros((self.size, self.size))
        self.vector = np.zeros(self.size)

    def places(self, joint: int, recording: int) -> NDArray[np.intp]:
        """Which unknowns one joint's rows of one recording have."""
        own = np.arange(self.friction + joint * self.c, self.friction + (joint + 1) * self.c)
        load = self.load + INERTIAL * recording + np.arange(INERTIAL)
        body = np.arange(INERTIAL * self.n)
        return np.concatenate([body, [INERTIAL * self.n + joint], own, [self.gain + joint], load])

    def design(self, data: Filtered, joint: int, known: Array) -> Array:
        """Columns of one joint; ``known`` is the load that the torque scales with."""
        last = slice(INERTIAL * (self.n - 1), INERTIAL * self.n)
        load = data.inertial[:, joint, last]
        return np.column_stack(
            [
                -data.inertial[:, joint],
                -data.armature[:, joint],
                data.friction[:, joint],
                data.torque[:, joint] + load @ known,
                load,
            ]
        )

    def target(self, data: Filtered, joint: int) -> Array:
        """What the unknowns are to explain [N m], shape (R,)."""
        out: Array = data.current[:, joint] - data.torque[:, joint]
        return out

    def add(self, data: Filtered, recording: int, weight: Array, known: Array) -> None:
        """Take up a recording; ``weight`` is one over each joint's error [1/(N m)], shape (n,)."""
        for joint in range(self.n):
            at, x = self.places(joint, recording), self.design(data, joint, known)
            w = (weight[joint] * data.weight[:, joint])[:, None] ** 2
            self.matrix[np.ix_(at, at)] += x.T @ (w * x)
            self.vector[at] += x.T @ (w[:, 0] * self.target(data, joint))

    def residual(self, data: Filtered, recording: int, solution: Array, known: Array) -> Array:
        """What the solution does not explain [N m], shape (R, n)."""
        out = np.empty_like(data.current)
        for joint in range(self.n):
            fit = self.design(data, joint, known) @ solution[self.places(joint, recording)]
            out[:, joint] = self.target(data, joint) - fit
        return out
