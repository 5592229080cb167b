"""Semi-real collisions: torques of known shape added to collision-free logs of a real arm.

The motion stays as it was recorded; the drive is taken to have supplied what the contact took, so
that the current changes by ``-tau_ext / gain`` at once. A real controller also yields a little and
its current follows the contact some milliseconds later: figures from such collisions compare
detectors, they do not replace real pushes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array, Bools
from tauguard.detectors.diagnosis.contact_force import link_poses, point_jacobians
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.traces.trace import Trace

#: Time course of a contact over its duration, 0 to 1, by name.
SHAPES: dict[str, Callable[[Array], Array]] = {
    # A blow: half a sine.
    "blow": lambda x: np.asarray(np.sin(np.pi * x)),
    # A hand's push: rises in a fifth of its time, holds, lets go in a fifth.
    "push": lambda x: np.asarray(np.clip(np.minimum(x, 1 - x) / 0.2, 0.0, 1.0)),
}


@dataclass(frozen=True)
class Added:
    """A contact to add."""

    start: float  #: [s]
    seconds: float  #: how long
    torque: tuple[float, ...]  #: at its peak, one a joint [N m]
    shape: str = "blow"


def add_contact(trace: Trace, drive_gain: Array, contact: Added) -> Trace:
    """The trace with a contact in its currents, labelled semi-real in ``meta``.

    Args:
        trace: collision-free.
        drive_gain: N m per ampere, shape (n,).
        contact: what to add; outside of the trace it adds nothing.

    Raises:
        ValueError: an unknown shape, no duration, or not one torque a joint.
    """
    if contact.shape not in SHAPES:
        raise ValueError(f"shape {contact.shape!r}: expected {' or '.join(SHAPES)}")
    if not contact.seconds > 0 or len(contact.torque) != trace.q.shape[1]:
        raise ValueError(
            f"contact of {contact.seconds} s and {len(contact.torque)} torques: expected more than "
            f"0 s and {trace.q.shape[1]} torques"
        )
    phase = (trace.t - contact.start) / contact.seconds
    inside = (phase >= 0) & (phase <= 1)
    course = np.where(inside, SHAPES[contact.shape](np.clip(phase, 0, 1)), 0.0)
    return add_torque(trace, drive_gain, np.outer(course, contact.torque))


def add_torque(trace: Trace, drive_gain: Array, torque: Array) -> Trace:
    """The trace with external torques [N m], shape (T, n), in its currents; labelled semi-real."""
    current = trace.current - torque / drive_gain
    return replace(trace, current=current, meta={**trace.meta, "collisions": "semi-real"})


@dataclass(frozen=True)
class Push:
    """A hand's push on the last link: half a sine in a direction that the room holds fixed."""

    start: float  #: [s]
    seconds: float  #: how long
    force: tuple[float, float, float]  #: at its peak, world frame [N]
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: in the last link's frame [m]


def push_torque(robot: RobotNumbers, trace: Trace, push: Push) -> Array:
    """What a push does to the joints along the recorded motion [N m], shape (T, n).

    Args:
        robot: the arm.
        trace: whose positions say where the force acts.
        push: what acts; outside of the trace it adds nothing.

    Raises:
        ValueError: a push that does not last.
    """
    if not push.seconds > 0:
        raise ValueError(f"push of {push.seconds} s: expected more than 0 s")
    phase = (trace.t - push.start) / push.seconds
    out: Array = np.zeros_like(trace.q)
    for k in np.flatnonzero((phase >= 0) & (phase <= 1)):
        poses = link_poses(robot, trace.q[k])
        point = poses.origin[-1] + poses.rotation[-1] @ np.asarray(push.point)
        jacobian = point_jacobians(robot, poses, np.array([robot.joints - 1]), point[None])[0]
        out[k] = np.sin(np.pi * phase[k]) * np.asarray(push.force) @ jacobian
    return out


def smallest_found(
    alarms: Callable[[Trace], Bools],
    trace: Trace,
    drive_gain: Array,
    joint: int,
    starts: Sequence[float],
    *,
    seconds: float = 0.1,
    shape: str = "blow",
    window: float = 0.5,
    span: tuple[float, float] = (0.3, 300.0),
) -> Array:
    """The smallest peak torque on one joint that is found, for each start, to within 5 %.

    Args:
        alarms: from a trace to the alarm at each sample.
        trace: collision-free, without an alarm.
        drive_gain: N m per ampere, shape (n,).
        joint: 0-based.
        starts: of the contacts [s].
        seconds: how long each lasts.
        shape: see ``SHAPES``.
        window: an alarm this long after the start still finds it [s].
        span: torques to search between [N m].

    Returns:
        [N m], shape (len(starts),), inf where the largest is not found; signs alternate.
    """
    found = []
    for k, start in enumerate(starts):
        low, high = span
        rows = (trace.t >= start) & (trace.t <= start + window)

        def hit(peak: float, start: float = start, k: int = k, rows: Bools = rows) -> bool:
            torque = np.zeros(trace.q.shape[1])
            torque[joint] = peak if k % 2 == 0 else -peak
            contact = Added(start, seconds, tuple(torque), shape)
            return bool(alarms(add_contact(trace, drive_gain, contact))[rows].any())

        if not hit(high):
            found.append(np.inf)
            continue
        while high / low > 1.05:
            middle = float(np.sqrt(low * high))
            low, high = (low, middle) if hit(middle) else (middle, high)
        found.append(high)
    return np.array(found)


def moments(moving: NDArray[np.bool_], t: Array, count: int, seed: int) -> list[float]:
    """``count`` times [s] at which ``moving``, shape (T,), holds; fewer if there are not so many.

    None lies within 5 s of the beginning, where detectors settle, or 1 s of the end.
    """
    rows = np.flatnonzero(moving & (t > t[0] + 5) & (t < t[-1] - 1))
    if not len(rows):
        return []
    picked = np.random.default_rng(seed).choice(rows, min(count, len(rows)), replace=False)
    return [float(v) for v in np.sort(t[picked])]
