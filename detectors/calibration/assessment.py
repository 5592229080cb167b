"""The error of a calibration on logs that it was not made from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from tqdm import tqdm

from tauguard.arrays import Array, Bools
from tauguard.detectors.calibration.identification import RATE, Subsets, filtered_logs, identify
from tauguard.detectors.calibration.recording import (
    Load,
    Recording,
    laden,
    moves,
    moving_span,
)
from tauguard.detectors.calibration.regression import Filtered
from tauguard.detectors.dynamics.robot import RobotNumbers, momentum_terms
from tauguard.detectors.estimation.estimator import ArmModel, Estimator, Unknowns
from tauguard.detectors.estimation.observer import intervals, lagged, low_pass
from tauguard.detectors.events import find_alarms
from tauguard.findings import Finding, Findings, RefusedError, cause, note
from tauguard.traces.trace import Trace


@dataclass(frozen=True)
class UnexplainedCheck:
    """Options of :func:`unexplained_findings`.

    Of a joint's torque, 5 % are not explained in correct logs of a UR10e, 17 % on a UR5, and 23 to
    31 % at a wrist joint of a UR3 whose friction warms up. Two exchanged joints or currents give 14
    to 25 % on the UR10e, so no single limit separates the two cases.
    """

    doubtful_fraction: float = 0.1  #: of a joint's torque, above which there is a note
    maximum_fraction: float = 0.35  #: above which logs without a load are refused
    maximum_fraction_laden: float = 0.5
    """For logs with a load, whose centre may be unknown. A warm UR5 with a known load has 36 %;
    exchanged joints give 46 to 130 % on three arms."""
    minimum_torque: float = 0.05
    """Least denominator of these fractions, relative to the largest torque of the arm. A joint with
    a vertical axis needs little torque, but the error of its torque sensor is not smaller."""
    outlying: float = 2.5
    """The arm may have carried a load if the residual of a held-out log is this times the median of
    all others. On a UR10e the ratio is 4.3 and 4.6 with a load in one of seven logs, 2.4 with loads
    in two of eight, 1.2 without a load, and 4.5 if only single joints move in all other logs."""
    outlying_if_unexplained: float = 1.5  #: the same ratio if much torque is unexplained as well


@dataclass(frozen=True)
class LoadCheck:
    """Options of :func:`load_findings`.

    A given load is refused if the load that the torques show differs by more than both limits. A
    UR10e's torques show 2.2 kg for 2.6 kg, and 0.05 kg without a load.
    """

    minimum_difference: float = 0.8  #: [kg]
    minimum_relative_difference: float = 0.3  #: of the given load


@dataclass(frozen=True)
class BurstCheck:
    """Options of :func:`burst_findings`."""

    maximum_measure: float = 2.5
    """The measure of a joint is the unexplained fraction of its torque, times the ratio of the 99 %
    quantile of the unexplained torque to the median. It is at most 1.8 in 20 free logs of five
    arms, and 4 to 9 in three logs of arms that were pushed."""
    swing_weight: float = 0.5
    """A residual above its median is reduced by this times the largest torque of accelerations
    nearby. For a KUKA with jerky commands the measure falls from 4.2 to 0.9."""
    swing_span: float = 0.1  #: accelerations at most so far away reduce a residual [s]
    minimum_motion: float = 3.0  #: of a joint that is checked [s]
    minimum_speed: float = 0.05
    """Of a checked sample [rad/s]; below it static friction hides the torque."""
    listed: int = 6  #: largest number of times that a message lists


def residual_rms(arm: ArmModel, trace: Trace) -> Array:
    """Root mean square of the observer's residual from the first motion to the last one.

    Args:
        arm: identified.
        trace: collision-free.

    Returns:
        [N m], shape (n,).
    """
    estimator = Estimator(arm, RATE, trace.dt, Unknowns.none())
    left = estimator.run(trace.t, trace.q, trace.qd, trace.current).unexplained
    level: Array = np.sqrt((left[moving_span(trace)] ** 2).mean(axis=0))
    return level


@dataclass(frozen=True, eq=False)
class Unexplained:
    """The torque of a log that a calibration does not explain, one row per sample."""

    trace: Trace
    left: Array  #: unexplained torque [N m], shape (T, n)
    torque: Array  #: drive torque [N m], shape (T, n)
    moves: Bools  #: where a joint is fast enough to be judged, shape (T, n)
    swing: Array
    """Largest torque of accelerations within ``BurstCheck.swing_span`` [N m], shape (T, n)."""

    def without_accelerations(self, weight: float = BurstCheck.swing_weight) -> Array:
        """``|left|``, reduced where accelerations can explain it [N m], shape (T, n)."""
        size = np.abs(self.left)
        least = np.zeros(size.shape[1])
        for j in np.flatnonzero(self.moves.any(axis=0)):
            least[j] = np.median(size[self.moves[:, j], j])
        less: Array = np.minimum(size, np.maximum(least, size - weight * self.swing))
        return less


def unexplained(arm: ArmModel, recordings: Mapping[str, Recording]) -> dict[str, Unexplained]:
    """The unexplained torque of each log in which some joint moves.

    An unknown load is estimated, so the torque that a load can explain does not count.

    Args:
        arm: identified.
        recordings: collision-free, by name.
    """
    return {n: _unexplained(arm, r) for n, r in recordings.items() if moves(r.trace)}


def _unexplained(arm: ArmModel, recording: Recording) -> Unexplained:
    trace = recording.trace
    arm, load = laden(arm, recording.load)
    unknowns = Unknowns.none()
    if recording.load != Load():
        tracked = Unknowns.for_logs(load.mass, load.moment)
        unknowns = replace(tracked, offset=0.0, viscous=0.0, coulomb=0.0)
    estimator = Estimator(arm, RATE, trace.dt, unknowns)
    left = estimator.run(trace.t, trace.q, trace.qd, trace.current).unexplained
    fast = moving_span(trace)[:, None] & (np.abs(trace.qd) > BurstCheck.minimum_speed)
    return Unexplained(trace, left, trace.current * arm.drive_gain, fast, _swing(arm, trace))


def _swing(arm: ArmModel, trace: Trace) -> Array:
    """The largest torque of accelerations within ``BurstCheck.swing_span`` [N m], (T, n)."""
    from scipy.ndimage import maximum_filter1d

    p = momentum_terms(arm.robot, trace.q, trace.qd)[0]
    rates, rows = np.full(arm.robot.joints, RATE), round(BurstCheck.swing_span / trace.dt)
    change = np.abs(low_pass(rates, intervals(trace.t, len(p)), p, np.zeros_like(p)))
    largest: Array = maximum_filter1d(change, 2 * rows + 1, axis=0, mode="constant")
    return largest


def _norms(values: Array, rows: Bools) -> Array:
    """Root of the sum of squares of each column over the rows where ``rows`` is True, (n,)."""
    return np.asarray(np.sqrt((np.where(rows, values, 0.0) ** 2).sum(axis=0)))


def burst_findings(
    joints: Sequence[str], logs: Mapping[str, Unexplained], options: BurstCheck = BurstCheck()
) -> Findings:
    """Errors ``"bursts"``: logs whose unexplained torque comes in bursts, as that of contacts does.

    Errors of friction, loads and inertia are there all the time; torques of contacts are not.

    Args:
        joints: names.
        logs: by name, from :func:`unexplained` with a calibration from these logs.
        options: limits.
    """
    findings = []
    for name, log in logs.items():
        t, left, rows = log.trace.t, log.without_accelerations(options.swing_weight), log.moves
        whole = _norms(log.torque, rows)
        whole = np.maximum(whole, UnexplainedCheck.minimum_torque * whole.max() + 1e-12)
        fraction = _norms(left, rows) / whole
        judged = rows.sum(axis=0) * log.trace.dt > options.minimum_motion
        burst, level = np.zeros(len(joints)), np.full(len(joints), np.inf)
        for j in np.flatnonzero(judged):
            usual, level[j] = np.quantile(left[rows[:, j], j], (0.5, 0.99))
            burst[j] = fraction[j] * level[j] / max(usual, 1e-12)
        worst = int(np.argmax(burst))
        if burst[worst] <= options.maximum_measure:
            continue
        peaks = rows[:, worst] & (left[:, worst] > 0.5 * level[worst])
        starts = [f"{alarm.start - t[0]:.1f}" for alarm in find_alarms(t, peaks)]
        more = ", ..." if len(starts) > options.listed else ""
        text = (
            f"{name}: {100 * (_norms(log.left, rows) / whole)[worst]:.0f} % of the torque of "
            f"{joints[worst]} in motion is not explained, and it comes in bursts, as contacts "
            f"do, at {', '.join(starts[: options.listed])}{more} s after the beginning: if "
            "something touched the arm there, leave the log out or cut these seconds out"
        )
        findings.append(cause("bursts", text, name, joints[worst], accept="alarms"))
    return Findings(findings)


def unexplained_finding(
    joints: Sequence[str],
    logs: Sequence[Unexplained],
    maximum_fraction: float,
    options: UnexplainedCheck = UnexplainedCheck(),
) -> Finding | None:
    """A note or an error ``"unexplained"`` on the joint with the largest unexplained fraction.

    Args:
        joints: names.
        logs: from :func:`unexplained`.
        maximum_fraction: of a joint's torque, above which there is an error.
        options: limits.
    """
    left, torque, rows = np.zeros(len(joints)), np.full(len(joints), 1e-12), np.zeros(len(joints))
    for log in logs:
        left += _norms(log.left, log.moves) ** 2
        torque += _norms(log.torque, log.moves) ** 2
        rows += log.moves.sum(axis=0)
    fraction = np.sqrt(left / np.maximum(torque, options.minimum_torque**2 * torque.max()))
    worst = int(np.argmax(fraction))
    if not fraction[worst] > options.doubtful_fraction:
        return None
    size, whole = (float(np.sqrt(x[worst] / max(rows[worst], 1))) for x in (left, torque))
    text = (
        f"{100 * fraction[worst]:.0f} % of the torque of {joints[worst]} in motion is not "
        f"explained ({size:.2g} N m of {whole:.2g} N m, root mean square); possible causes: "
        "friction that changes with temperature, a load that was not named (`payload=`), contacts "
        "(nothing may touch the arm in these logs), another arm's robot file, or wrong order, "
        "signs, units (milliamperes?) or gains of the currents or torques"
    )
    kind = cause if fraction[worst] > maximum_fraction else note
    return kind("unexplained", text, joints[worst])


def unexplained_findings(
    joints: Sequence[str],
    left: Mapping[str, Unexplained],
    logs: Mapping[str, Recording],
    held: Sequence[Array],
    options: UnexplainedCheck = UnexplainedCheck(),
) -> Findings:
    """Torque that a calibration does not explain, and a log that may have had a load.

    Args:
        joints: names.
        left: unexplained torque of each log in which some joint moves, by name.
        logs: recordings with their loads, by name.
        held: held-out residual of each log in ``logs`` [N m], (n,) each; empty: not known.
        options: limits.

    Returns:
        ``"unexplained"`` (note or error), ``"load?"`` (note).
    """
    names = list(logs)
    bare = [k for k, name in enumerate(names) if name in left and logs[name].load == Load()]
    laden = [one for name, one in left.items() if logs[name].load != Load()]
    doubts = (
        unexplained_finding(joints, [left[names[k]] for k in bare], options.maximum_fraction),
        unexplained_finding(joints, laden, options.maximum_fraction_laden),
    )
    findings = [doubt for doubt in doubts if doubt is not None]
    least = options.outlying_if_unexplained if findings else options.outlying
    if held and (odd := outlier([held[k] for k in bare], least)):
        log = names[bare[odd[0]]]
        text = (
            f"the torques of {log} are {odd[1]:.1f} times as far from their prediction as those "
            f'of the other logs: did {log} carry something (then give `payload={{"{log}": KG}}` or '
            f'`payload={{"{log}": None}}`), or did something touch the arm (then leave the log '
            "out)?"
        )
        findings.append(note("load?", text, log))
    loads = [
        f"{r.load.mass:g} kg in {name}"
        for name, r in logs.items()
        if r.load is not None and r.load.mass > 0
    ]
    if loads and findings:
        text = f"loads given: {', '.join(loads)}; are these right, and in kg?"
        findings.append(note("load?", text))
    return Findings(findings)


def outlier(
    held: Sequence[Array], least: float = UnexplainedCheck.outlying
) -> tuple[int, float] | None:
    """Find a log whose held-out residual is much larger than that of all other logs.

    Args:
        held: held-out residual of each log [N m], shape (n,) each.
        least: least ratio of the largest residual's norm to the median of all other norms.

    Returns:
        Index of the log, and this ratio. None: fewer than three logs, or a smaller ratio.
    """
    if len(held) < 3:
        return None
    level = np.linalg.norm(np.asarray(held), axis=1)
    k = int(np.argmax(level))
    times = float(level[k] / max(float(np.median(np.delete(level, k))), 1e-12))
    return (k, times) if times > least else None


def load_findings(
    arm: ArmModel,
    recordings: Mapping[str, Recording],
    data: Sequence[Filtered],
    options: LoadCheck = LoadCheck(),
) -> Findings:
    """Errors ``"load"``: given loads that the torques of their logs do not show.

    Args:
        arm: nominal numbers, and drive gains of correct scale.
        recordings: by name, with the loads given.
        data: from :func:`filtered_logs`.
        options: limits.
    """
    logs, findings = list(recordings.values()), []
    for k, (name, recording) in enumerate(recordings.items()):
        given = recording.load.mass if recording.load is not None else 0.0
        if given == 0:
            continue
        open_ = replace(recording, load=None)
        asked = [*logs[:k], open_, *logs[k + 1 :]]
        own = [*data[:k], *filtered_logs(arm, [open_]), *data[k + 1 :]]
        shown = float(identify(arm, asked, data=own).loads[k, 0])
        limit = max(options.minimum_difference, options.minimum_relative_difference * given)
        if abs(shown - given) > limit:
            text = (
                f"{name}: {given:g} kg were given, its torques show {shown:.1f} kg compared with "
                "the other logs: give the load that was carried, in kg, or "
                f'`payload={{"{name}": None}}`'
            )
            findings.append(cause("load", text, name))
    return Findings(findings)


def left_out(
    arm: ArmModel,
    recordings: Sequence[Recording],
    *,
    scale: str = "gains",
    data: Sequence[Filtered] | None = None,
) -> list[Array]:
    """Residual RMS of each recording under a calibration from the other recordings [N m].

    Each array has the shape (n,). If gains are identified, they come from all recordings, so that
    the residuals of the recordings are comparable. ``data``: as in :func:`identify`.

    Raises:
        RefusedError: fewer than two recordings, or as :func:`identify`.
    """
    if len(recordings) < 2:
        raise RefusedError("one log alone cannot be held out: give two or more")
    if scale != "gains":
        arm = ArmModel(arm.robot, identify(arm, recordings, scale=scale).arm.drive_gain)
    calibrated, found = Subsets(replace(arm, friction=None), recordings, data), []
    turns = tqdm(recordings, desc="leave out", unit="log", disable=None, leave=False)
    for k, recording in enumerate(turns):
        others = [i for i in range(len(recordings)) if i != k]
        found.append(residual_rms(calibrated(others), recording.trace))
    return found


def start_gains(robot: RobotNumbers, traces: Sequence[Trace]) -> Array:
    """Initial torque per ampere from the robot file's inertial numbers [N m/A], shape (n,).

    If the current of a joint does not follow the rigid-body torque, the joint gets the median of
    the joints whose current does.

    Raises:
        RefusedError: no joint's current follows the torque: wrong joints, signs or units.
    """
    torque, current = [], []
    for trace in traces:
        dt = intervals(trace.t, len(trace.t))
        p, beta = momentum_terms(robot, trace.q, trace.qd)
        rows = moving_span(trace)
        torque.append(low_pass(RATE, dt, p, beta)[rows])
        current.append(lagged(RATE, dt, trace.current)[rows])
    a, b = np.concatenate(torque), np.concatenate(current)
    both = (a * b).sum(axis=0)
    alike = both / np.sqrt((a**2).sum(axis=0) * (b**2).sum(axis=0) + 1e-12)
    sure = np.abs(alike) > 0.5
    if not sure.any():
        raise RefusedError(
            "no joint's current follows the torque that its motion needs: check the order of the "
            "joints, signs and units, or give `gains=`"
        )
    ratio = both / np.maximum((b**2).sum(axis=0), 1e-12)
    gains: Array = np.where(sure, ratio, np.median(ratio[sure]))
    return gains
