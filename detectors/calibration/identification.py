"""Identification of a real arm, with the scale of its torques, from collision-free logs.

The residual of the nominal observer is linear in the errors of the inertial numbers and of the
reflected rotor inertias, in the weights of the friction columns, in the drives' torque per ampere
and in the payloads. All columns of this regression pass through the detector's own causal filter,
so no acceleration is needed. The solution is restricted to bodies that can exist
(:mod:`~tauguard.detectors.dynamics.physical_consistency`).

Currents determine torques only up to a factor: if all gains, masses and friction are scaled by the
same factor, the currents do not change. So other information has to determine the scale. The
regression predicts currents from torques, because the reverse would favour a small scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.detectors.calibration.recording import (
    LEAST,
    MOVING,
    Recording,
    check_length,
    is_known,
    known_load,
    moving_span,
)
from tauguard.detectors.calibration.regression import Filtered, System, body_deviations, filtered
from tauguard.detectors.dynamics.friction import FrictionModel
from tauguard.detectors.dynamics.physical_consistency import solve_physically_consistent
from tauguard.detectors.dynamics.robot import INERTIAL, RobotNumbers, mass_matrix
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.one_thread import one_thread
from tauguard.findings import ArgumentError, Findings, note

#: Friction columns of a real geared joint: presliding of several lengths, Stribeck friction,
#: viscous friction that saturates at high speed, and load-dependent friction. A torque per ampere
#: that depends on the current is not included, because on a UR5 and a UR3 it would explain half of
#: the torque or more by itself.
REAL_FRICTION = FrictionModel(
    bristles=(),
    stops=(1e-3, 3e-3, 1e-2, 3e-2),
    stribeck=(0.02, 0.05),
    slopes=(0.01, 0.05, 0.1, 0.3, 1.0),
    loaded=(0.02, 0.1, 0.3),
    modelled=True,
)


@dataclass(frozen=True)
class Beliefs:
    """Standard deviations of the identified numbers around the assumed ones."""

    mass: float = 0.1  #: relative
    centre: float = 0.02  #: of the centre of mass, each axis [m]
    inertia: float = 0.1  #: relative to the link's largest entry
    armature: float = 1.0
    """Relative to the largest value of the joint's diagonal entry of the mass matrix, or to a
    twentieth of the arm's largest such value if that is more. The reflected rotor inertia of a
    wrist joint exceeds the inertia of the links that it moves."""
    gain: float = 0.5  #: relative, if gains are identified
    friction: float = 0.3
    """Of most friction weights, relative to the joint's usual torque: its largest median torque of
    any log, of the whole motion or of the joint's own. With this prior, columns that are similar at
    the logged speeds get similar weights. Without it, weights could be large with opposite signs,
    and wrong at other speeds."""
    loaded: float = 0.3  #: of load-dependent friction per load [1]
    saturation: float = 0.2  #: change of the torque per ampere at the largest torque, relative
    payload: float = 5.0  #: mass of an unknown load [kg]
    moment: float = 0.5  #: first moment of an unknown load [kg m]
    spread: float = 0.2  #: inertia of a load about the last link's origin [kg m^2]
    softness: float = 5.0  #: a sample has the weight 1/softness^2, as model errors are not white
    evenness: float = 0.15  #: least error level of a joint, as a fraction of the largest joint's
    rest: float = 0.5  #: samples of a joint that has been at rest for longer are not used [s]


BELIEFS = Beliefs()

#: Motion of a joint in a log from which the joint's median torque in motion counts [s].
TURNS = 1.0

#: Rate of the filter of residual and columns [1/s].
RATE = 20.0


@dataclass(frozen=True)
class Identified:
    """An identified arm and how it was found."""

    arm: ArmModel
    loads: Array
    """Inertial numbers of the load of each recording, in the last link's frame: mass [kg], first
    moment [kg m], inertia [kg m^2], shape (recordings, 10)."""
    rms: Array  #: root mean square of the residual on the recordings [N m], shape (n,)
    scale: str  #: "gains", "payload" or "masses", see :func:`identify`
    gain_error: Array  #: relative standard deviation of each gain, 0 if it was given, (n,)
    findings: Findings  #: ``"scale-open"``: gains that the logs do not determine
    inertial_error: Array
    """Standard deviations of the inertial numbers, shape (n, 10). NaN if the recordings do not
    reduce the variance of the prior to half, so that the prior dominates the number."""


def _deviations(
    system: System,
    robot: RobotNumbers,
    recordings: Sequence[Recording],
    gain: Array,
    free_masses: bool,
    friction: Array,
) -> tuple[Array, Array]:
    """Standard deviations and means of all unknowns."""
    beliefs, spread = BELIEFS, 4.0 if free_masses else 1.0
    body = spread * body_deviations(robot, beliefs.mass, beliefs.centre, beliefs.inertia)
    poses = np.concatenate([r.trace.q[:: max(1, len(r.trace.q) // 20)] for r in recordings])
    heaviest = np.diagonal(mass_matrix(robot, poses), axis1=1, axis2=2).max(axis=0)
    loads, means = [], []
    for recording in recordings:
        load, given = recording.load, is_known(recording)
        loads += [1e-6 if load is not None else beliefs.payload]
        loads += [1e-6 if given else beliefs.moment] * 3
        nothing = load is not None and load.mass == 0
        loads += [1e-6 if nothing else beliefs.spread] * 6
        means.append(known_load(load))
    deviations = np.concatenate(
        [
            body,
            beliefs.armature * np.maximum(heaviest, 0.05 * heaviest.max()),
            friction.ravel(),
            np.maximum(gain, 1e-9),
            loads,
        ]
    )
    return deviations, np.concatenate([np.zeros(system.load), *means])


def _friction_beliefs(
    friction: FrictionModel, gain: Array, recordings: Sequence[Recording]
) -> Array:
    """Standard deviations of the friction weights, shape (n, columns)."""
    sizes = [np.abs(r.trace.current * gain) for r in recordings]
    usual = np.zeros(len(gain))
    for size, r in zip(sizes, recordings, strict=True):
        span, turns = moving_span(r.trace), np.abs(r.trace.qd) > MOVING
        usual = np.maximum(usual, np.median(size[span], axis=0))
        for j, own in enumerate((turns & span[:, None]).T):  # torque may be 0 while it stands
            if own.sum() * r.trace.dt >= TURNS:
                usual[j] = max(usual[j], float(np.median(size[own, j])))
    out = np.repeat(np.maximum(BELIEFS.friction * usual, 1e-6)[:, None], friction.columns, axis=1)
    out[:, friction.load_columns] = BELIEFS.loaded
    if friction.saturation:
        peaks = np.max([size.max(axis=0) for size in sizes], axis=0)
        out[:, -1] = BELIEFS.saturation / np.maximum(peaks, 1e-9)
    return out


def identify(
    arm: ArmModel,
    recordings: Sequence[Recording],
    *,
    scale: str = "gains",
    friction: FrictionModel = REAL_FRICTION,
    data: Sequence[Filtered] | None = None,
    least: float = LEAST,
) -> Identified:
    """Identify inertia, friction and, unless they are given, the drive gains.

    Args:
        arm: nominal arm. Its gains are kept with ``scale="gains"``, else they are initial values.
        recordings: collision-free logs of this arm, at least 10 s of motion in all.
        scale: what determines the scale of the torques: "gains" (of ``arm``), "payload" (a
            recording with a known load above 0) or "masses" (of ``arm``).
        friction: the friction columns.
        data: from :func:`filtered_logs` (default: computed); only for "gains".
        least: least total motion of the recordings [s]; smaller for parts of longer logs.

    Raises:
        ArgumentError: unknown ``scale``, "payload" without a known load, too little motion, or a
            log of another arm.
    """
    _check(recordings, arm.robot, scale)
    check_length(recordings, least)
    with one_thread():
        if scale == "gains":
            return _fit(arm, recordings, scale, friction, data, 2)[0]
        return _identify_scale(arm, recordings, scale, friction)


def filtered_logs(
    arm: ArmModel, recordings: Sequence[Recording], friction: FrictionModel = REAL_FRICTION
) -> list[Filtered]:
    """``data`` of :func:`identify`, for several calls with the same gains."""
    return [
        filtered(r, arm.robot, arm.drive_gain, friction, RATE, BELIEFS.rest) for r in recordings
    ]


class Subsets:
    """Calibrations from subsets of recordings whose columns are filtered once, with given gains."""

    def __init__(
        self,
        arm: ArmModel,
        recordings: Sequence[Recording],
        data: Sequence[Filtered] | None = None,
    ) -> None:
        """Filter all recordings, with the friction columns of ``arm`` if it has any.

        ``data``: as in :func:`identify`.
        """
        self._arm, self._recordings = arm, recordings
        self._friction = replace(arm.friction or REAL_FRICTION, weights=np.empty((0, 0)))
        self._data = data or filtered_logs(arm, recordings, self._friction)

    def __call__(self, use: Sequence[int], least: float = LEAST) -> ArmModel:
        """The arm identified from the recordings with these indices.

        Raises:
            ArgumentError: as :func:`identify`.
        """
        own, data = [self._recordings[k] for k in use], [self._data[k] for k in use]
        return identify(self._arm, own, friction=self._friction, data=data, least=least).arm


def _identify_scale(
    arm: ArmModel, recordings: Sequence[Recording], scale: str, friction: FrictionModel
) -> Identified:
    """Identify the drive gains as well, see :func:`identify`."""
    # A torque per ampere that depends on the current could explain the torque of a load, so it is
    # left out while the scale is identified.
    constant = replace(friction, saturation=False, weights=np.empty((0, 0)))
    sought, error = _fit(arm, recordings, scale, constant, None, 6)
    unsure = error > 0.5 * BELIEFS.gain
    start = ArmModel(arm.robot, np.where(unsure, arm.drive_gain, sought.arm.drive_gain))
    found, _ = _fit(start, recordings, "gains", friction, None, 2)
    findings = []
    for j in np.flatnonzero(unsure):
        name = arm.robot.joint_names[j]
        text = (
            f"{name}: the logs do not determine the scale of its torques (gain uncertain by "
            f"{100 * error[j]:.0f} %); {arm.drive_gain[j]:.2f} N m/A is kept; give `gains=`"
        )
        findings.append(note("scale-open", text, name))
    return replace(found, scale=scale, gain_error=error, findings=Findings(findings))


def _fit(
    arm: ArmModel,
    recordings: Sequence[Recording],
    scale: str,
    friction: FrictionModel,
    data: Sequence[Filtered] | None,
    rounds: int,
) -> tuple[Identified, Array]:
    """Iterate least squares, with each joint weighted by its last residual.

    Returns:
        The identified arm, and the standard deviations of its gains.
    """
    robot, held = arm.robot, scale == "gains"
    gain, error = arm.drive_gain.copy(), np.zeros(robot.joints)
    level: Array = np.ones(robot.joints)
    known = [known_load(recording.load) for recording in recordings]
    loads = np.array(known)
    # If friction depends on the model's load, a gain scales only the current.
    rescaled = friction.modelled and not friction.saturation
    first: Sequence[Filtered] = ()
    for turn in range(rounds):
        if data is None or not (held or rescaled):
            data = [filtered(r, robot, gain, friction, RATE, BELIEFS.rest) for r in recordings]
        elif not held:
            data = [d.with_gain(gain / arm.drive_gain) for d in first]
        first = first or data
        if turn and friction.modelled:  # loads that were not given have an estimate now
            data = [
                d if is_known(r) else filtered(r, robot, gain, friction, RATE, BELIEFS.rest, load)
                for d, r, load in zip(data, recordings, loads, strict=True)
            ]
        if turn == 0:
            level = np.array([np.abs(d.current).mean(axis=0) for d in data]).mean(axis=0) / 5
        system = System(robot, friction.columns, len(recordings))
        loose = np.full(robot.joints, 0.0 if held else BELIEFS.gain)
        weights = _friction_beliefs(friction, gain, recordings)
        deviations, means = _deviations(
            system, robot, recordings, loose, scale != "masses", weights
        )
        means[system.gain : system.load] = gain / arm.drive_gain - 1
        for k, one in enumerate(data):
            system.add(one, k, 1 / (BELIEFS.softness * np.maximum(level, 1e-6)), known[k])
        precision = deviations**-2.0
        matrix = system.matrix + np.diag(precision)
        solution = solve_physically_consistent(
            matrix, system.vector + precision * means, robot.inertial, robot.armature
        )
        unexplained = np.concatenate(
            [system.residual(d, k, solution, known[k]) for k, d in enumerate(data)]
        )
        loads = solution[system.load :].reshape(-1, INERTIAL)
        seen = np.concatenate([d.weight for d in data])
        rms = np.sqrt((seen * unexplained**2).sum(axis=0) / np.maximum(seen.sum(axis=0), 1.0))
        level = np.maximum(rms, BELIEFS.evenness * rms.max())
        if not held:
            error = np.sqrt(np.diag(np.linalg.inv(matrix))[system.gain : system.load])
            gain = gain / np.clip(1 + solution[system.gain : system.load], 0.5, 2.0)
    found = _result(arm, system, solution, gain, rms, friction)
    return replace(found, inertial_error=_spread(matrix, deviations, robot.joints)), error


def _spread(matrix: Array, deviations: Array, joints: int) -> Array:
    """Standard deviations as ``Identified.inertial_error``, shape (n, 10)."""
    bodies = slice(INERTIAL * joints)
    found: Array = np.sqrt(np.diag(np.linalg.inv(matrix))[bodies])
    found[found**2 > 0.5 * deviations[bodies] ** 2] = np.nan
    return found.reshape(-1, INERTIAL)


def _check(recordings: Sequence[Recording], robot: RobotNumbers, scale: str) -> None:
    if scale not in ("gains", "payload", "masses"):
        raise ArgumentError(f"scale {scale!r}: expected gains, payload or masses")
    if not recordings:
        raise ArgumentError("no recordings to identify from")
    if scale == "payload" and not any(r.load and r.load.mass > 0 for r in recordings):
        raise ArgumentError("scale payload: no recording has a known load above 0 kg")
    for recording in recordings:
        joints = len(recording.trace.joint_names)
        if joints != robot.joints:
            raise ArgumentError(f"a log of {joints} joints, the robot has {robot.joints}")


def _result(
    arm: ArmModel,
    system: System,
    solution: Array,
    gain: Array,
    rms: Array,
    friction: FrictionModel,
) -> Identified:
    robot, n = arm.robot, system.n
    found = replace(
        robot,
        inertial=robot.inertial - solution[: INERTIAL * n].reshape(n, INERTIAL),
        armature=robot.armature - solution[INERTIAL * n : system.friction],
    )
    weights: Array = solution[system.friction : system.gain].reshape(n, -1)
    loads: NDArray[Any] = solution[system.load :].reshape(-1, INERTIAL)
    # A joint that never moves has no residual in motion: the largest of the others stands for it.
    noise = np.maximum(np.where(rms > 0, rms, rms.max()), 1e-6)
    identified = ArmModel(found, gain, replace(friction, weights=weights), noise)
    unknown = np.full((n, INERTIAL), np.nan)
    return Identified(identified, loads, rms, "gains", np.zeros(n), Findings(), unknown)
