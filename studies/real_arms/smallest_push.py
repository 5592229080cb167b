"""The smallest push at the tool that a detector finds: semi-real pushes on collision-free logs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.calibration.recording import cut
from tauguard.detectors.diagnosis.contact_force import link_poses, point_jacobians
from tauguard.detectors.evaluation.semi_real import Added, add_contact
from tauguard.detectors.features.free_stream import SLOW
from tauguard.detectors.methods.free_motion import CONFIRMATION, FittedFreeMotion
from tauguard.detectors.thresholds.alarm import CollisionAlarm
from tauguard.traces import Trace

Array = NDArray[np.float64]

#: A push lasts so long [s]; the detector sees the log from so long before it [s].
LASTS, BEFORE = 0.4, 4.0
#: A standing arm has stood for so long [s]; a moving one has a joint above this speed [rad/s].
STOOD, MOVING = 1.0, 0.1
#: Forces that are tried [N]; found to this factor.
WEAKEST, STRONGEST, STEPS = 2.0, 500.0, 6


def smallest_pushes(
    fitted: FittedFreeMotion, trace: Trace, moving: bool, count: int, rng: np.random.Generator
) -> list[float]:
    """Forces [N] that are just found, at moments and in directions drawn at random.

    ``inf``: even the strongest is missed. Moments at which the detector alarms by itself, and
    directions that hardly turn any joint, are passed over.

    Args:
        fitted: told of the load.
        trace: collision-free, not trained on.
        moving: while the arm moves, or stands.
        count: of moments.
        rng: draws moments and directions.
    """
    alarm = CollisionAlarm(fitted, 1.0, CONFIRMATION)
    found = []
    for at in _moments(trace, moving, count, rng):
        torque = _per_newton(fitted, trace.q[at], rng)
        start, dt = trace.t[at], trace.dt
        part = cut(trace, slice(at - round(BEFORE / dt), at + round(1.2 * LASTS / dt)))

        def alarms(
            force: float, part: Trace = part, start: float = start, torque: Array = torque
        ) -> bool:
            push = Added(start, LASTS, tuple(force * torque), "push")
            up = alarm.detect(add_contact(part, fitted.arm.drive_gain, push)).alarm
            return bool(up[part.t >= start].any())

        if alarms(0.0) or np.abs(torque).max() < 0.05:
            continue
        low, high = WEAKEST, STRONGEST
        if not alarms(high):
            found.append(np.inf)
            continue
        for _ in range(STEPS):
            middle = float(np.sqrt(low * high))
            low, high = (low, middle) if alarms(middle) else (middle, high)
        found.append(high)
    return found


def _moments(trace: Trace, moving: bool, count: int, rng: np.random.Generator) -> list[int]:
    """Rows at which a push may begin."""
    speed, dt = np.abs(trace.qd).max(axis=1), trace.dt
    fits = speed > MOVING if moving else speed < SLOW
    before = 0 if moving else round(STOOD / dt)
    lasting = round(LASTS / dt)
    first, last = round((BEFORE + 0.5) / dt), len(speed) - round(1.5 * LASTS / dt)
    sums = np.concatenate([[0], np.cumsum(fits)])
    rows = np.arange(max(first, before), max(last, 0))
    through = sums[rows + lasting] - sums[rows - before] == lasting + before
    allowed = rows[through]
    return [int(row) for row in rng.permutation(allowed)[:count]]


def _per_newton(fitted: FittedFreeMotion, q: Array, rng: np.random.Generator) -> Array:
    """Joint torques of 1 N at the last link's origin in a random direction, shape (n,)."""
    robot = fitted.arm.robot
    direction = rng.standard_normal(3)
    placed = link_poses(robot, q)
    last = np.array([robot.joints - 1])
    jacobian = point_jacobians(robot, placed, last, placed.origin[-1:])[0]
    torque: Array = (direction / np.linalg.norm(direction)) @ jacobian
    return torque
