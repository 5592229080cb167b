"""Collision-free logs of a real arm, and the loads that it carried."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.findings import Finding, Findings, RefusedError, cause, note
from tauguard.traces import motion
from tauguard.traces.loads import Load as Load
from tauguard.traces.logs import Recording as Recording
from tauguard.traces.logs import cut as cut
from tauguard.traces.motion import MOVING as MOVING
from tauguard.traces.motion import moves as moves
from tauguard.traces.motion import moving_span as moving_span

#: Least length of the parts into which a log is cut [s].
SHORTEST = 8.0
#: Least motion for an identification, and least length of logs of an arm that only stands [s].
LEAST, LEAST_STANDING = 10.0, 2.0


@dataclass(frozen=True)
class LoadDeviation:
    """Uncertainty of the load."""

    mass: float = 0.0  #: standard deviation [kg]
    moment: float = 0.0  #: of each axis of the first moment [kg m]


#: The deviation of a load that is not known.
UNKNOWN_LOAD = LoadDeviation(3.0, 0.3)


def moving(logs: Mapping[str, Recording]) -> tuple[dict[str, Recording], Findings]:
    """The logs in which some joint moves, and a note on each log without motion.

    If no joint moves in any log, all logs are returned; calibration then raises an error.
    """
    still = [name for name, log in logs.items() if not moves(log.trace)]
    text = "no joint moves in it; calibration leaves it out"
    notes = Findings(note("still-log", f"{name}: {text}", name) for name in still)
    return {n: log for n, log in logs.items() if n not in still} or dict(logs), notes


def motion_length(recordings: Sequence[Recording]) -> float:
    """Sum over the recordings of the time from the first motion to the last one [s]."""
    return motion.motion_length([recording.trace for recording in recordings])


def length_finding(recordings: Sequence[Recording], least: float = LEAST) -> Finding | None:
    """An error ``"too-short"`` if there is less motion than ``least`` [s]; it says how much."""
    if (seconds := motion_length(recordings)) >= least:
        return None
    still = "" if seconds else "no joint moves: "
    return cause(
        "too-short",
        f"{still}{int(10 * seconds) / 10:g} s of motion in all, in each log from the first to "
        f"the last: {least:g} s are the least, two minutes are good",
    )


def check_length(recordings: Sequence[Recording], least: float = LEAST) -> None:
    """Refuse less motion than ``least`` [s].

    Raises:
        RefusedError: see :func:`length_finding`.
    """
    if finding := length_finding(recordings, least):
        raise RefusedError(finding)


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
