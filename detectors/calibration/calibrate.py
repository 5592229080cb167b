"""Calibration of an arm model from traces of collision-free motion, by regularised least squares.

The residual of the nominal observer is linear in the errors of the inertial numbers, in the weights
of the friction columns, in the relative errors of the drive gains and in the unknown payloads (four
numbers per trace). The columns of this regression pass through the causal filter of the observer,
so no acceleration is needed. Priors determine the numbers that the motion does not excite. They
also determine the scale of the torques: without priors, the gains converge to zero. The priors
weigh as much as thousands of samples.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.calibration.regression import (
    Filtered,
    System,
    body_deviations,
    filtered_columns,
)
from tauguard.detectors.dynamics.friction import FrictionModel
from tauguard.detectors.dynamics.robot import INERTIAL, RobotNumbers
from tauguard.detectors.estimation.estimator import PAYLOAD, ArmModel
from tauguard.detectors.estimation.velocity import SLOWEST, SensorNoise
from tauguard.detectors.events import free_rows
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace

#: Default friction columns.
DEFAULT = FrictionModel()
#: Rate of the filter of residual and columns [1/s].
RATE = 30.0
#: Number of rounds; each weights the joints by the residuals of the round before.
ROUNDS = 2


@dataclass(frozen=True)
class Priors:
    """Standard deviations of the identified numbers around their nominal values."""

    mass: float = 0.04  #: relative
    centre: float = 4e-3  #: of the centre of mass, each axis [m]
    inertia: float = 0.08  #: relative to the link's largest entry
    drive_gain: float = 0.03  #: relative; 0 keeps the gains
    friction: float = 20.0  #: of every friction weight [N m per unit]
    payload: float = 3.0  #: [kg]
    moment: float = 0.3  #: of the payload [kg m]
    softness: float = 30.0  #: a sample has the weight 1/softness^2, as model errors are not white


@dataclass(frozen=True)
class TraceCalibration:
    """A calibrated arm, with the payloads of its traces and the residual that remains."""

    arm: ArmModel
    payloads: Array  #: mass and first moment of each trace's payload [kg, kg m], (traces, 4)
    rms: Array  #: root mean square of the remaining residual [N m], shape (n,)


def _deviations(robot: RobotNumbers, priors: Priors, columns: int, traces: int) -> Array:
    """Standard deviations of all unknowns; 0 for unknowns fixed at their nominal value."""
    n = robot.joints
    return np.concatenate(
        [
            body_deviations(robot, priors.mass, priors.centre, priors.inertia),
            np.zeros(n),  # rotor inertias
            np.full(n * columns, priors.friction),
            np.full(n, priors.drive_gain),
            np.tile([priors.payload, *[priors.moment] * 3, *[0.0] * 6], traces),
        ]
    )


def calibrate(
    arm: ArmModel,
    traces: Iterable[Trace],
    *,
    friction: FrictionModel | None = None,
    priors: Priors | None = None,
) -> TraceCalibration:
    """Identify inertial numbers, friction, drive gains and the traces' payloads together.

    Args:
        arm: nominal arm; of its friction model, if any, only the columns are used.
        traces: motion of at least 4 s in all (200 rows of 0.02 s), better minutes; rows of known
            collisions are left out.
        friction: friction columns (default: those of ``arm.friction``, or the default model).
        priors: standard deviations of the unknowns around the nominal arm.

    Returns:
        The calibrated arm with its friction model and noise levels.

    Raises:
        ArgumentError: no collision-free rows, or a trace of another arm.
    """
    priors = priors or Priors()
    model = friction or arm.friction or DEFAULT
    robot = arm.robot
    kept = list(traces)
    for trace in kept:
        if len(trace.joint_names) != robot.joints:
            raise ArgumentError(
                f"a trace of {len(trace.joint_names)} joints, arm of {robot.joints}"
            )
    data = [_columns(trace, arm, model) for trace in kept]
    if sum(len(one.current) for one in data) < 200:
        raise ArgumentError(
            "calibrate: fewer than 200 collision-free rows; give 4 s of motion or more"
        )
    system, solution, level = _solved(data, robot, model, priors)
    inertial = solution[: INERTIAL * robot.joints].reshape(-1, INERTIAL)
    weights: Array = solution[system.friction : system.gain].reshape(robot.joints, -1)
    fast = bool(data) and max(trace.dt for trace in kept) <= SLOWEST
    found = ArmModel(
        robot.with_inertial(robot.inertial - inertial),
        arm.drive_gain * (1 + solution[system.gain : system.load]),
        replace(model, weights=weights),
        level,
        SensorNoise.measured(kept) if fast else None,
    )
    payloads: Array = solution[system.load :].reshape(-1, INERTIAL)[:, :PAYLOAD]
    return TraceCalibration(found, payloads, level)


_COLUMNS: dict[int, tuple[tuple[ArmModel, FrictionModel], Filtered]] = {}


def _columns(trace: Trace, arm: ArmModel, model: FrictionModel) -> Filtered:
    """The columns of the collision-free rows of a trace.

    They are cached for the last settings as long as the trace exists, because all folds of a
    cross-validation need them.
    """
    key, found = _COLUMNS.get(id(trace), (None, None))
    if found is None or key is None or key[0] is not arm or key[1:] != (model,):
        known = trace, arm.robot, arm.drive_gain, model, RATE, free_rows(trace)
        found = filtered_columns(*known, sampled=trace.dt > SLOWEST)
        if id(trace) not in _COLUMNS:
            weakref.finalize(trace, _COLUMNS.pop, id(trace), None)
        _COLUMNS[id(trace)] = (arm, model), found
    return found


def _solved(
    data: Sequence[Filtered], robot: RobotNumbers, model: FrictionModel, priors: Priors
) -> tuple[System, Array, Array]:
    """The last round's equations, their solution, and each joint's RMS residual [N m]."""
    deviations = _deviations(robot, priors, model.columns, len(data))
    squares = [((one.torque - one.current) ** 2).mean(axis=0) for one in data]
    level: Array = np.maximum(np.sqrt(np.mean(squares, axis=0)), 1e-6)
    level = level / level.max()
    nothing = np.zeros(INERTIAL)
    for _ in range(ROUNDS):
        system = System(robot, model.columns, len(data), measured=True)
        for k, one in enumerate(data):
            system.add(one, k, 1 / (priors.softness * level), nothing)
        solution = system.solve(deviations)
        parts = [system.residual(one, k, solution, nothing) for k, one in enumerate(data)]
        level = np.maximum(np.sqrt((np.concatenate(parts) ** 2).mean(axis=0)), 1e-6)
    return system, solution, level
