"""The error of a calibration on logs that it was not made from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from tqdm import tqdm

from tauguard.arrays import Array, Bools
from tauguard.detectors.calibration.identification import REAL_FRICTION, Beliefs, identify
from tauguard.detectors.calibration.recording import (
    Load,
    Recording,
    laden,
    moves,
    moving_span,
)
from tauguard.detectors.calibration.regression import filtered
from tauguard.detectors.dynamics.friction import FrictionModel
from tauguard.detectors.dynamics.robot import RobotNumbers, momentum_terms
from tauguard.detectors.estimation.estimator import ArmModel, Estimator, Unknowns
from tauguard.detectors.estimation.observer import intervals, low_pass
from tauguard.detectors.events import find_alarms
from tauguard.traces.trace import Trace

#: Fraction of a joint's torque that may stay unexplained before a log is refused, and before a note
#: says so. Right logs leave 5 % on a UR10e, 17 % on a UR5 and 23 to 31 % of a wrist joint on a UR3
#: whose friction warms up; two joints or two currents exchanged leave 14 to 25 % on the UR10e.
#: Between the two only a note is possible.
UNEXPLAINED, DOUBTFUL = 0.35, 0.1
#: The first of logs with a load, whose centre may not be known. A warm UR5 with a load that is told
#: leaves 36 %; two joints exchanged leave 46 to 130 % on three arms.
UNEXPLAINED_LADEN = 0.5
#: A joint's torque counts as this fraction of the arm's largest at least: a torque sensor's error
#: does not shrink with a joint that hardly needs torque, as one about a vertical axis.
FAINT = 0.05
#: If the residual of a held-out log is the first multiple of the others', the arm may have carried
#: a load. If much torque is unexplained as well, the second multiple is enough. On a UR10e the
#: multiple is 4.3 and 4.6 with a load in one of seven logs, 2.4 with loads in two of eight, 1.2
#: without a load, and 4.5 where the others move single joints only.
OUTLYING, OUTLYING_IN_DOUBT = 2.5, 1.5
#: A given load is refused if it differs from the torques' by more than this [kg] and by more than
#: this fraction. A UR10e's torques show 2.2 kg for 2.6 kg, and 0.05 kg without a load.
WRONG_LOAD = (0.8, 0.3)
#: Fraction of a joint's torque in a log that is not explained, times the largest hundredth of what
#: is left over its median, at most. Up to 1.8 in 20 free logs of five arms, each alone; 4 to 9 in
#: three logs of arms that were pushed.
BURSTS = 2.5
#: Shortest motion of a joint that is judged so [s], and times that a message lists.
ENOUGH, SAID = 3.0, 6
#: Slower joints are not judged [rad/s], because static friction hides their torque.
FAST_ENOUGH = 0.05


def residual_rms(
    arm: ArmModel,
    trace: Trace,
    rate: float = 20.0,
    unknowns: Unknowns | None = None,
    stop: float = 0.0,
) -> Array:
    """Root mean square of the observer's residual from the first motion to the last one.

    Args:
        arm: identified.
        trace: collision-free.
        rate: rate of the observer [1/s].
        unknowns: what is tracked meanwhile (default: nothing, the plain observer).
        stop: seconds before the last motion that do not count, see
            :func:`~tauguard.detectors.calibration.recording.moving_span`.

    Returns:
        [N m], shape (n,).
    """
    estimator = Estimator(arm, rate, trace.dt, unknowns or Unknowns.none())
    left = estimator.run(trace.t, trace.q, trace.qd, trace.current).unexplained
    level: Array = np.sqrt((left[moving_span(trace, stop=stop)] ** 2).mean(axis=0))
    return level


def _in_motion(arm: ArmModel, recording: Recording, rate: float) -> tuple[Array, Array, Bools]:
    """What is left of a log's torque, the torque [N m], and where joints move, (T, n) each.

    A load that is not known is tracked, so only what no load explains is left.
    """
    trace = recording.trace
    arm, load = laden(arm, recording.load)
    unknowns = Unknowns.none()
    if recording.load != Load():
        tracked = Unknowns.for_logs(load.mass, load.moment)
        unknowns = replace(tracked, offset=0.0, viscous=0.0, coulomb=0.0)
    estimator = Estimator(arm, rate, trace.dt, unknowns)
    left = estimator.run(trace.t, trace.q, trace.qd, trace.current).unexplained
    moves = moving_span(trace)[:, None] & (np.abs(trace.qd) > FAST_ENOUGH)
    return left, trace.current * arm.drive_gain, moves


def _size(values: Array, rows: Bools) -> Array:
    """Root of the sum of squares of each column over its rows, shape (n,)."""
    return np.asarray(np.sqrt((np.where(rows, values, 0.0) ** 2).sum(axis=0)))


def check_bursts(
    arm: ArmModel, names: Sequence[str], recordings: Sequence[Recording], rate: float = 20.0
) -> None:
    """Refuse logs whose unexplained torque comes in bursts, as that of contacts does.

    Friction, loads and wrong numbers leave an error all along; contacts leave little between them.

    Args:
        arm: identified from these logs.
        names: of the recordings.
        recordings: said to be collision-free; those in which no joint moves are not judged.
        rate: rate of the observer [1/s].

    Raises:
        ValueError: names each such log and the seconds.
    """
    found = []
    for name, recording in zip(names, recordings, strict=True):
        if not moves(recording.trace):
            continue
        left, torque, rows = _in_motion(arm, recording, rate)
        whole = _size(torque, rows)
        fraction = _size(left, rows) / np.maximum(whole, FAINT * whole.max() + 1e-12)
        judged = rows.sum(axis=0) * recording.trace.dt > ENOUGH
        burst, level = np.zeros(arm.robot.joints), np.full(arm.robot.joints, np.inf)
        for j in np.flatnonzero(judged):
            usual, level[j] = np.quantile(np.abs(left[rows[:, j], j]), (0.5, 0.99))
            burst[j] = fraction[j] * level[j] / max(usual, 1e-12)
        worst = int(np.argmax(burst))
        if burst[worst] > BURSTS:
            t = recording.trace.t
            peaks = rows[:, worst] & (np.abs(left[:, worst]) > 0.5 * level[worst])
            starts = [f"{alarm.start - t[0]:.1f}" for alarm in find_alarms(t, peaks)]
            said = ", ".join(starts[:SAID]) + (", ..." if len(starts) > SAID else "")
            found.append(
                f"{name}: {100 * fraction[worst]:.0f} % of the torque of "
                f"{arm.robot.joint_names[worst]} in motion is not explained, and it comes in "
                f"bursts, as contacts do, at {said} s after the beginning"
            )
    if found:
        raise ValueError(
            f"{'; '.join(found)}: if something touched the arm there, leave the log out or cut "
            "these seconds out"
        )


def explained(
    arm: ArmModel,
    recordings: Sequence[Recording],
    rate: float = 20.0,
    limit: float = UNEXPLAINED,
) -> tuple[str, ...]:
    """Notes on joints of whose torque in motion a calibration leaves much unexplained.

    Args:
        arm: identified.
        recordings: collision-free, some joint moves in each.
        rate: rate of the observer [1/s].
        limit: fraction of a joint's torque that may be left.

    Raises:
        ValueError: more than ``limit`` of a joint's torque is left.
    """
    left, torque = np.zeros(arm.robot.joints), np.full(arm.robot.joints, 1e-12)
    rows = np.zeros(arm.robot.joints)
    for recording in recordings:
        residual, given, on = _in_motion(arm, recording, rate)
        left += _size(residual, on) ** 2
        torque += _size(given, on) ** 2
        rows += on.sum(axis=0)
    fraction = np.sqrt(left / np.maximum(torque, FAINT**2 * torque.max()))
    worst = int(np.argmax(fraction))
    name = arm.robot.joint_names[worst]
    error, whole = (float(np.sqrt(x[worst] / max(rows[worst], 1))) for x in (left, torque))
    said = (
        f"{100 * fraction[worst]:.0f} % of the torque of {name} in motion is not explained "
        f"({error:.2g} N m beside {whole:.2g} N m, root mean square): friction that changes with "
        "temperature, a load that was not named (--payload), contacts (nothing may touch the arm "
        "in these logs), another arm's robot file, or wrong order, signs, units (milliamperes?) or "
        "gains of the currents or torques"
    )
    if fraction[worst] > limit:
        raise ValueError(said)
    return (said,) if fraction[worst] > DOUBTFUL else ()


def outlier(held: Sequence[Array], least: float = OUTLYING) -> tuple[int, float] | None:
    """Find the log that the others predict far worse than each other, and how many times worse.

    Args:
        held: held-out residual of each log [N m], shape (n,) each.
        least: how many times worse.

    Returns:
        Its index, and its residual over the median of the others'; None: fewer than three logs, or
        none is ``least`` times as far off.
    """
    if len(held) < 3:
        return None
    level = np.linalg.norm(np.asarray(held), axis=1)
    k = int(np.argmax(level))
    times = float(level[k] / max(float(np.median(np.delete(level, k))), 1e-12))
    return (k, times) if times > least else None


def check_loads(arm: ArmModel, names: Sequence[str], recordings: Sequence[Recording]) -> None:
    """Refuse a given load that the torques of its log do not show.

    Args:
        arm: nominal numbers, and gains whose scale holds.
        names: names of the logs.
        recordings: with the loads given.

    Raises:
        ValueError: names the log, what was given and what its torques show.
    """
    for k, (name, recording) in enumerate(zip(names, recordings, strict=True)):
        given = recording.load.mass if recording.load is not None else 0.0
        if given == 0:
            continue
        open_ = [replace(r, load=None) if i == k else r for i, r in enumerate(recordings)]
        shown = float(identify(arm, open_).loads[k, 0])
        if abs(shown - given) > max(WRONG_LOAD[0], WRONG_LOAD[1] * given):
            raise ValueError(
                f"{name}: {given:g} kg were given, its torques show {shown:.1f} kg beside the "
                "other logs: give the load that was carried, in kg, or =unknown"
            )


def left_out(
    arm: ArmModel,
    recordings: Sequence[Recording],
    *,
    scale: str = "gains",
    friction: FrictionModel = REAL_FRICTION,
    beliefs: Beliefs | None = None,
    rate: float = 20.0,
    stop: float = 0.0,
) -> list[Array]:
    """Residual RMS of each recording under a calibration from the other recordings [N m].

    Each array has the shape (n,). If gains are identified, they come from all recordings. One set
    of gains makes the figures of the recordings comparable. :func:`residual_rms` describes
    ``stop``.

    Raises:
        ValueError: fewer than two recordings, or what :func:`identify` raises.
    """
    if len(recordings) < 2:
        raise ValueError("one log alone cannot be held out: give two or more")
    if scale != "gains":
        whole = identify(
            arm, recordings, scale=scale, friction=friction, beliefs=beliefs, rate=rate
        )
        arm = ArmModel(arm.robot, whole.arm.drive_gain)
    rest = (beliefs or Beliefs()).rest
    data = [filtered(r, arm.robot, arm.drive_gain, friction, rate, rest) for r in recordings]
    found = []
    turns = tqdm(recordings, desc="leave out", unit="log", disable=None, leave=False)
    for k, recording in enumerate(turns):
        others = [*recordings[:k], *recordings[k + 1 :]]
        own = [*data[:k], *data[k + 1 :]]
        part = identify(arm, others, friction=friction, beliefs=beliefs, rate=rate, data=own)
        found.append(residual_rms(part.arm, recording.trace, rate, stop=stop))
    return found


def start_gains(robot: RobotNumbers, traces: Sequence[Trace]) -> Array:
    """A first guess of torque per ampere from the robot file's inertial numbers, shape (n,).

    Joints whose current does not follow the rigid-body torque get the median of the others.

    Raises:
        ValueError: no joint's current follows the torque: wrong joints, signs or units.
    """
    torque, current = [], []
    for trace in traces:
        dt, count = intervals(trace.t, len(trace.t)), robot.joints
        p, beta = momentum_terms(robot, trace.q, trace.qd)
        rate = np.full(count, 20.0)
        rows = moving_span(trace)
        nothing = np.zeros_like(p)
        torque.append(low_pass(rate, dt, p, beta)[rows])
        current.append(-low_pass(rate, dt, nothing, nothing, trace.current)[rows])
    a, b = np.concatenate(torque), np.concatenate(current)
    both = (a * b).sum(axis=0)
    alike = both / np.sqrt((a**2).sum(axis=0) * (b**2).sum(axis=0) + 1e-12)
    sure = np.abs(alike) > 0.5
    if not sure.any():
        raise ValueError(
            "no joint's current follows the torque that its motion needs: check the order of the "
            "joints, signs and units, or give --gains"
        )
    ratio = both / np.maximum((b**2).sum(axis=0), 1e-12)
    gains: Array = np.where(sure, ratio, np.median(ratio[sure]))
    return gains
