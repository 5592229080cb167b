"""Calibration of an arm model from collision-free motion, by one regularised least squares.

The residual of the nominal observer is linear in the errors of the inertial numbers, in the weights
of the friction columns, in the relative errors of the drive gains and in the payloads carried
(four numbers a trace, not told). All pass through the same causal filter as in detection, so no
acceleration is needed. Priors fix what motion does not excite, and the scale: without them a free
fit of the gains collapses to zero, so the priors count as strong as thousands of samples.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array, Bools
from tauguard.detectors.dynamics.friction import FrictionModel
from tauguard.detectors.dynamics.robot import (
    INERTIAL,
    RobotNumbers,
    momentum_regressor,
    momentum_terms,
)
from tauguard.detectors.estimation.estimator import PAYLOAD, ArmModel
from tauguard.detectors.estimation.observer import intervals, low_pass
from tauguard.detectors.estimation.velocity import SLOWEST, SensorNoise
from tauguard.detectors.evaluation.events import occupied
from tauguard.traces.trace import Trace


@dataclass(frozen=True)
class Priors:
    """Standard deviations of what is identified around what is believed."""

    mass: float = 0.04  #: relative
    centre: float = 4e-3  #: of the centre of mass, each axis [m]
    inertia: float = 0.08  #: relative to the link's largest entry
    drive_gain: float = 0.03  #: relative; 0 keeps the gains
    friction: float = 20.0  #: of every friction weight [N m per unit]
    payload: float = 3.0  #: [kg]
    moment: float = 0.3  #: of the payload [kg m]
    softness: float = 30.0  #: a sample counts 1/softness^2: model errors are not white


@dataclass(frozen=True)
class Calibration:
    """A calibrated arm and how it was found."""

    arm: ArmModel
    payloads: Array  #: mass and first moment of each trace's payload [kg, kg m], (traces, 4)
    rms: Array  #: of the residual that is left on the traces used [N m], shape (n,)


def free_rows(trace: Trace, settle: float = 1.0, recover: float = 0.5) -> Bools:
    """Rows outside all known collisions.

    Args:
        trace: without truth all of it counts as free.
        settle: seconds to leave out at the beginning.
        recover: seconds to leave out after each collision.
    """
    free = trace.t >= trace.t[0] + settle
    for collision in trace.truth.collisions if trace.truth else ():
        low, high = occupied(collision)
        free &= ~((trace.t >= low - 0.05) & (trace.t <= high + recover))
    return np.asarray(free)


@dataclass
class _Columns:
    """Filtered residual and columns of one trace, thinned out."""

    residual: Array  # (R, n)
    inertial: Array  # (R, n, 10 n)
    friction: Array  # (R, n, c)
    torque: Array  # (R, n)


def _columns(
    trace: Trace, robot: RobotNumbers, gain: Array, model: FrictionModel, rate: float, period: float
) -> _Columns:
    """Filter everything at about ``period`` seconds a sample, then keep rows 0.02 s apart."""
    stride = max(1, round(period / trace.dt))
    rows = (len(trace.t) // stride) * stride

    def mean(x: Array) -> Array:
        """Over the samples that a thinned interval holds: the drive torque acts throughout."""
        shaped: Array = x[:rows].reshape(-1, stride, *x.shape[1:]).mean(axis=1)
        return shaped

    tau = trace.current * gain
    columns = mean(model.evaluate(trace.q, trace.qd, tau))
    drive = mean(tau)
    q, qd, t = (x[:rows:stride] for x in (trace.q, trace.qd, trace.t))
    dt = intervals(t, len(t))
    n, count = robot.joints, len(q)

    def filtered(p: Array, beta: Array, held: Array | None = None) -> Array:
        flat, other = p.reshape(count, -1), beta.reshape(count, -1)
        held = None if held is None else held.reshape(count, -1)
        return low_pass(np.full(flat.shape[1], rate), dt, flat, other, held).reshape(p.shape)

    p, beta = momentum_terms(robot, q, qd)
    big_p, big_b = momentum_regressor(robot, q, qd)
    free = free_rows(trace)[:rows:stride]
    keep = np.flatnonzero(free)[:: max(1, round(0.02 / (stride * trace.dt)))]
    nothing = np.zeros_like(columns)
    return _Columns(
        filtered(p, beta, drive)[keep],
        filtered(big_p, big_b)[keep].reshape(-1, n, INERTIAL * n),
        filtered(nothing, nothing, columns)[keep],
        filtered(np.zeros_like(p), np.zeros_like(p), drive)[keep],
    )


def _prior_deviations(robot: RobotNumbers, priors: Priors, columns: int, traces: int) -> Array:
    body = []
    for numbers in robot.inertial:
        mass, inertia = max(float(numbers[0]), 1e-3), float(np.abs(numbers[4:]).max()) + 1e-3
        body += [priors.mass * mass, *[priors.centre * mass] * 3, *[priors.inertia * inertia] * 6]
    n = robot.joints
    return np.concatenate(
        [
            body,
            np.full(n * columns, priors.friction),
            np.full(n, max(priors.drive_gain, 1e-9)),
            np.tile([priors.payload, *[priors.moment] * 3], traces),
        ]
    )


class _Normal:
    """Normal equations over [inertial errors, friction weights, gain errors, payloads]."""

    def __init__(self, robot: RobotNumbers, columns: int, traces: int) -> None:
        self.n, self.c = robot.joints, columns
        self.friction = INERTIAL * self.n
        self.gain = self.friction + self.n * columns
        self.load = self.gain + self.n
        self.matrix = np.zeros((self.load + PAYLOAD * traces,) * 2)
        self.vector = np.zeros(len(self.matrix))

    def places(self, joint: int, trace: int) -> NDArray[np.intp]:
        """Unknowns that a row of ``joint`` in ``trace`` sees, in the order of :meth:`design`."""
        own = np.arange(self.friction + joint * self.c, self.friction + (joint + 1) * self.c)
        load = self.load + PAYLOAD * trace + np.arange(PAYLOAD)
        return np.concatenate([np.arange(self.friction), own, [self.gain + joint], load])

    def design(self, data: _Columns, joint: int) -> Array:
        """Columns of one joint: shape (R, len(places))."""
        last = INERTIAL * (self.n - 1)
        return np.column_stack(
            [
                data.inertial[:, joint],
                data.friction[:, joint],
                -data.torque[:, joint],
                data.inertial[:, joint, last : last + PAYLOAD],
            ]
        )

    def add(self, data: _Columns, trace: int, weight: Array) -> None:
        for joint in range(self.n):
            at, x = self.places(joint, trace), self.design(data, joint)
            self.matrix[np.ix_(at, at)] += weight[joint] ** 2 * (x.T @ x)
            self.vector[at] += weight[joint] ** 2 * (x.T @ data.residual[:, joint])

    def rms(self, all_data: Sequence[_Columns], solution: Array) -> Array:
        squares, count = np.zeros(self.n), 0
        for trace, data in enumerate(all_data):
            count += len(data.residual)
            for joint in range(self.n):
                fit = self.design(data, joint) @ solution[self.places(joint, trace)]
                squares[joint] += float(((data.residual[:, joint] - fit) ** 2).sum())
        level: Array = np.sqrt(squares / max(count, 1))
        return level


def calibrate(
    arm: ArmModel,
    traces: Iterable[Trace],
    *,
    friction: FrictionModel | None = None,
    priors: Priors | None = None,
    rate: float = 30.0,
    rounds: int = 2,
) -> Calibration:
    """Identify inertial numbers, friction, drive gains and the traces' payloads together.

    Args:
        arm: what is believed; its friction model, if any, gives only the columns.
        traces: motion of at least 20 s in all; rows of known collisions are left out.
        friction: columns to use (default: those of ``arm.friction``, or the default model).
        priors: how far to trust what is believed.
        rate: of the filter that residual and columns pass through [1/s].
        rounds: the second round weighs each joint by the residual that the first left.

    Returns:
        The calibrated arm with its friction model and noise levels.

    Raises:
        ValueError: no collision-free rows, or a trace of another arm.
    """
    priors = priors or Priors()
    model = friction or arm.friction or FrictionModel()
    robot = arm.robot
    data, kept = [], list(traces)
    for trace in kept:
        if len(trace.joint_names) != robot.joints:
            raise ValueError(f"a trace of {len(trace.joint_names)} joints, arm of {robot.joints}")
        data.append(_columns(trace, robot, arm.drive_gain, model, rate, 4e-3))
    if sum(len(d.residual) for d in data) < 200:
        raise ValueError("calibrate: fewer than 200 collision-free rows; give 20 s of motion")
    deviations = _prior_deviations(robot, priors, model.columns, len(data))
    level: NDArray[Any] = np.maximum(
        np.sqrt(np.mean([(d.residual**2).mean(axis=0) for d in data], axis=0)), 1e-6
    )
    level = level / level.max()
    for _ in range(rounds):
        normal = _Normal(robot, model.columns, len(data))
        for k, columns in enumerate(data):
            normal.add(columns, k, 1 / (priors.softness * level))
        solution: NDArray[Any] = np.linalg.solve(
            normal.matrix + np.diag(deviations**-2.0), normal.vector
        )
        level = np.maximum(normal.rms(data, solution), 1e-6)
    inertial = solution[: normal.friction].reshape(-1, INERTIAL)
    weights: Array = solution[normal.friction : normal.gain].reshape(robot.joints, -1)
    fast = bool(data) and max(trace.dt for trace in kept) <= SLOWEST
    found = ArmModel(
        robot.with_inertial(robot.inertial - inertial),
        arm.drive_gain * (1 + solution[normal.gain : normal.load]),
        replace(model, weights=weights),
        level,
        SensorNoise.measured(kept) if fast else None,
    )
    payloads: Array = -solution[normal.load :].reshape(-1, PAYLOAD)
    return Calibration(found, payloads, level)
