"""Collision-free logs of a real arm, and the loads that it carried."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tauguard.arrays import Array, Bools
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace

#: A joint moves in a log if its speed is above this in some sample [rad/s].
MOVING = 0.01
#: A joint whose position varies by less does not move: the cause is noise or a touch [rad].
SHIFTED = 0.01
#: Least length of the parts into which a log is cut [s].
SHORTEST = 8.0
#: Least motion for an identification, and least length of logs of an arm that only stands [s].
LEAST, LEAST_STANDING = 10.0, 2.0


@dataclass(frozen=True)
class Load:
    """Mass and centre of mass of the load that the arm carried; the centre may be unknown."""

    mass: float = 0.0  #: [kg]
    centre: tuple[float, float, float] | None = None
    """In the last link's frame [m]. None: unknown; it is identified with the arm's parameters."""

    def __post_init__(self) -> None:
        """``ArgumentError`` for a mass below 0 or numbers that are not finite."""
        if not (np.isfinite(self.mass) and self.mass >= 0):
            raise ArgumentError(f"load: {self.mass} kg, expected 0 or more")
        if self.centre is not None and not (
            len(self.centre) == 3 and np.isfinite(self.centre).all()
        ):
            raise ArgumentError(f"load: centre {self.centre}, expected three finite numbers [m]")


@dataclass(frozen=True)
class LoadDeviation:
    """Uncertainty of the load."""

    mass: float = 0.0  #: standard deviation [kg]
    moment: float = 0.0  #: of each axis of the first moment [kg m]


#: The deviation of a load that is not known.
UNKNOWN_LOAD = LoadDeviation(3.0, 0.3)


@dataclass(frozen=True)
class Recording:
    """A collision-free log and the load that the arm carried."""

    trace: Trace
    load: Load | None = Load()  #: None: an unknown load


def moves(trace: Trace) -> bool:
    """Whether a joint exceeds :data:`MOVING` and its position varies by :data:`SHIFTED`."""
    quick = (np.abs(trace.qd) > MOVING).any(axis=0)
    return bool((quick & (np.ptp(trace.q, axis=0) > SHIFTED)).any())


def moving_span(trace: Trace, margin: float = 1.0) -> Bools:
    """Rows from the first to the last motion of any joint, shape (T,).

    Before and after, static friction takes up an unknown fraction of the torque.

    Args:
        trace: the log.
        margin: time at the beginning of the log that is always left out [s].

    Raises:
        ArgumentError: no joint moves, or only within ``margin``.
    """
    moves = np.flatnonzero((np.abs(trace.qd) > MOVING).any(axis=1))
    if not len(moves):
        raise ArgumentError(f"no joint moves faster than {MOVING} rad/s")
    rows = np.zeros(len(trace.t), dtype=np.bool_)
    rows[moves[0] : moves[-1] + 1] = True
    rows &= trace.t >= trace.t[0] + margin
    if not rows.any():
        raise ArgumentError(
            f"no motion is left without the first {margin:g} s of the log: give a longer log"
        )
    return rows


def motion_length(recordings: Sequence[Recording]) -> float:
    """Sum over the recordings of the time from the first motion to the last one [s]."""
    moving = [r.trace for r in recordings if moves(r.trace)]
    return sum(float(moving_span(trace, 0.0).sum()) * trace.dt for trace in moving)


def check_length(recordings: Sequence[Recording], least: float = LEAST) -> None:
    """Refuse less motion than ``least`` [s].

    Raises:
        ArgumentError: there is less motion; the message says how much.
    """
    if (seconds := motion_length(recordings)) < least:
        still = "" if seconds else "no joint moves: "
        raise ArgumentError(
            f"{still}{int(10 * seconds) / 10:g} s of motion in all, in each log from the first to "
            f"the last: {least:g} s are the least, two minutes are good"
        )


def each_can_be_left_out(recordings: Sequence[Recording]) -> bool:
    """Whether :data:`LEAST` of motion remains whichever of several recordings is left out."""
    rests = ([*recordings[:k], *recordings[k + 1 :]] for k in range(len(recordings)))
    return len(recordings) > 1 and all(motion_length(rest) >= LEAST for rest in rests)


def is_known(recording: Recording) -> bool:
    """Whether mass and centre of the load are known."""
    load = recording.load
    return load is not None and (load.mass == 0 or load.centre is not None)


def known_load(load: Load | None) -> Array:
    """Inertial numbers of a point mass at the load's centre, as in ``Identified.loads``, (10,).

    An unknown load counts as none, an unknown centre as the origin.
    """
    load = load or Load()
    x, y, z = load.centre or (0.0, 0.0, 0.0)
    spread = y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y
    return load.mass * np.array([1.0, x, y, z, *spread])


def laden(arm: ArmModel, load: Load | None) -> tuple[ArmModel, LoadDeviation]:
    """The arm with a load in its gripper, and the uncertainty of the load."""
    if load is None:
        return arm, UNKNOWN_LOAD
    inertial = arm.robot.inertial.copy()
    inertial[-1] += known_load(load)
    moment = 0.1 * load.mass if load.mass and load.centre is None else 0.0
    robot = arm.robot.with_inertial(inertial)
    return replace(arm, robot=robot), LoadDeviation(0.02 * load.mass, moment)


def pieces(
    recordings: Sequence[Recording], count: int, shortest: float = SHORTEST
) -> list[Recording]:
    """Halve the longest recording repeatedly until there are at least ``count`` recordings.

    Halving ends earlier if the halves would be shorter than ``shortest`` [s].
    """
    parts = list(recordings)
    while len(parts) < count:
        k = int(np.argmax([r.trace.t[-1] - r.trace.t[0] for r in parts]))
        trace = parts[k].trace
        if trace.t[-1] - trace.t[0] < 2 * shortest:
            break
        middle = len(trace.t) // 2
        halves = [cut(trace, slice(None, middle)), cut(trace, slice(middle, None))]
        parts[k : k + 1] = [Recording(half, parts[k].load) for half in halves]
    return parts


def cut(trace: Trace, rows: slice) -> Trace:
    """The given rows of a log, without its truth."""
    q, qd, current = trace.q[rows], trace.qd[rows], trace.current[rows]
    return Trace(trace.joint_names, trace.t[rows], q, qd, current, meta=trace.meta)
