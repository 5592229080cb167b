"""Columns of a log that seem exchanged between two joints, or negated."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.calibration.recording import Recording, cut, moves, moving_span
from tauguard.detectors.dynamics.robot import momentum_terms
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.estimation.observer import LOG_GAIN, intervals, lagged, low_pass
from tauguard.findings import Finding, Findings, cause
from tauguard.traces.trace import Trace

#: Least motion of each joint [s], and least decrease of the logarithm of the unexplained variance.
Limits = tuple[float, float]


@dataclass(frozen=True)
class OrderCheck:
    """Options of :func:`order_findings`.

    In correct logs of 13 arms, exchanging two joints lowers the logarithm of the unexplained
    variance by at most 0.05 (currents) and 0.83 (all columns). With exchanged currents it is mostly
    2.9 or more. With exchanged columns of wrist joints it is less than the limit, so they are not
    found. Negating lowers it by 0.3 (currents) and 0.94 (columns) at most in correct logs. Negated
    currents give 0.7 to 8, negated columns of joints that carry the arm mostly 3 or more.
    """

    exchanged_currents: Limits = (6.0, 1.0)
    exchanged_columns: Limits = (20.0, 1.25)
    exchanged_columns_calibrated: Limits = (6.0, 1.25)
    """If the arm is calibrated. The logarithm is then lowered by at most 0.11 in correct logs, and
    by 2.4 or more in nearly all logs with exchanged columns."""
    negated_currents: Limits = (6.0, 1.0)
    negated_columns: Limits = (6.0, 2.0)
    minimum_motion: float = 3.0  #: of a joint whose unexplained variance counts [s]
    minimum_speed: float = 0.05  #: of a sample in motion [rad/s]
    reversal_speed: float = 0.05  #: over which the sign of friction changes [rad/s]
    sample_interval: float = 0.02  #: to which logs are thinned [s]


class Misreading(NamedTuple):
    """A change of columns with which the logs fit the arm better."""

    gain: float  #: change of the logarithm of the unexplained variance over its limit, below 0
    first: int
    second: int  #: equal to ``first``: the joint's columns are negated
    what: str  #: "currents" or "columns" (positions, velocities and currents)


def order_findings(
    arm: ArmModel, logs: Mapping[str, Recording], options: OrderCheck = OrderCheck()
) -> Findings:
    """Errors ``"order"``: two joints whose columns are exchanged, or one whose columns are negated.

    Each joint's current is fitted by an offset and, with weights of at least 0, by the joint's
    rigid-body torque, the direction of motion and the speed. Then the currents, or all columns, of
    two joints are exchanged, or those of one joint negated, and the unexplained variances compared.
    The change that explains most is reported and made, and the rest is checked again. Only joints
    that move for long enough are checked.

    Args:
        arm: arm of the robot file, or calibrated; of the gains, only the signs are used.
        logs: by name, mostly free of collisions.
        options: limits.
    """
    traces = [one.trace for one in logs.values() if moves(one.trace)]
    names, findings = arm.robot.joint_names, []
    for _ in names:
        worst = min(misreadings(arm, traces, options), default=None)
        if worst is None or worst.gain > -1:
            break
        findings.append(_finding(worst, names))
        traces = [_corrected(trace, worst) for trace in traces]
    return Findings(findings)


def _finding(wrong: Misreading, names: Sequence[str]) -> Finding:
    first, second = names[wrong.first], names[wrong.second]
    if wrong.first == wrong.second:
        text = (
            f"the {wrong.what} of {first} seem to have the opposite sign: if negated, they fit the "
            "arm of the robot file better; use the signs of the robot file's axes"
        )
        return cause("order", text, first, accept="order")
    text = (
        f"the {wrong.what} of {first} and {second} seem exchanged: if swapped, they fit the arm of "
        "the robot file better; give the columns in the order of the robot file's joints"
    )
    return cause("order", text, first, second, accept="order")


def _corrected(trace: Trace, wrong: Misreading) -> Trace:
    """The trace with these columns exchanged or negated."""
    order = list(range(len(trace.joint_names)))
    order[wrong.first], order[wrong.second] = wrong.second, wrong.first
    signs = np.ones(len(order))
    if wrong.first == wrong.second:
        signs[wrong.first] = -1.0
    fields = ("current",) if wrong.what == "currents" else ("q", "qd", "current")
    changed: dict[str, Any] = {
        key: np.ascontiguousarray(getattr(trace, key)[:, order] * signs) for key in fields
    }
    return replace(trace, **changed)


def misreadings(
    arm: ArmModel, traces: Sequence[Trace], options: OrderCheck = OrderCheck()
) -> Iterator[Misreading]:
    """The changes of columns that are checked, whether they improve the fit or not."""
    if not traces:
        return
    n, sign = arm.robot.joints, np.sign(arm.drive_gain)
    steps = [
        slice(None, None, max(1, round(options.sample_interval / trace.dt))) for trace in traces
    ]
    span = np.concatenate([moving_span(trace)[s] for trace, s in zip(traces, steps, strict=True)])
    traces = [cut(trace, s) for trace, s in zip(traces, steps, strict=True)]
    every = [intervals(trace.t, len(trace.t)) for trace in traces]

    def late(quantity: Callable[[Trace], Array]) -> Array:
        pairs = zip(traces, every, strict=True)
        return np.concatenate([lagged(LOG_GAIN, dt, quantity(trace)) for trace, dt in pairs])

    direction = late(lambda trace: np.tanh(trace.qd / options.reversal_speed))
    speed, current = late(lambda trace: trace.qd), late(lambda trace: trace.current)
    fast = span[:, None] & (
        np.abs(np.concatenate([trace.qd for trace in traces])) > options.minimum_speed
    )

    def torque(order: Sequence[int], signs: Array) -> Array:
        found = []
        for trace, dt in zip(traces, every, strict=True):
            q, qd = (np.ascontiguousarray(x[:, order] * signs) for x in (trace.q, trace.qd))
            found.append(low_pass(LOG_GAIN, dt, *momentum_terms(arm.robot, q, qd)))
        return np.concatenate(found) * signs

    def left(torques: Array, joint: int, motion: int, column: int, given: float = 1.0) -> float:
        on = fast[:, motion]
        x = (torques[on, joint], direction[on, motion], speed[on, motion])
        if on.sum() * options.sample_interval < options.minimum_motion:
            return math.nan
        return _unexplained(np.column_stack(x), current[on, column] * sign[joint] * given)

    each = np.repeat([trace.dt for trace in traces], [len(trace.t) for trace in traces])
    same, seconds = range(n), each @ fast
    exchanged_columns = (
        options.exchanged_columns if arm.friction is None else options.exchanged_columns_calibrated
    )
    as_given = torque(same, np.ones(n))
    own = [left(as_given, j, j, j) for j in same]
    for a, b in itertools.combinations_with_replacement(same, 2):
        least = float(min(seconds[a], seconds[b]))
        currents, columns = (
            (options.negated_currents, options.negated_columns)
            if a == b
            else (options.exchanged_currents, exchanged_columns)
        )
        if not (least >= currents[0] and math.isfinite(own[a] + own[b])):
            continue
        change = (
            left(as_given, a, a, a, -1.0) - own[a]
            if a == b
            else left(as_given, a, a, b) + left(as_given, b, b, a) - own[a] - own[b]
        )
        yield Misreading(change / currents[1], a, b, "currents")
        if least < columns[0]:
            continue
        order = [b if j == a else a if j == b else j for j in same]
        other = torque(order, np.where((a == b) & (np.arange(n) == a), -1.0, 1.0))
        changes = [left(other, j, order[j], order[j]) - own[order[j]] for j in same]
        yield Misreading(float(np.nansum(changes)) / columns[1], a, b, "columns")


def _unexplained(x: Array, current: Array) -> float:
    """Logarithm of the fraction of a current's variance that x and an offset do not explain.

    The weights of the columns of x are at least 0.
    """
    from scipy.optimize import nnls

    one = np.ones((len(x), 1))
    columns = np.hstack([x, one, -one])
    columns /= np.maximum(np.linalg.norm(columns, axis=0), 1e-6)
    left = nnls(columns, current)[1] ** 2 / len(x)
    return math.log(max(left, 1e-12) / max(float(current.var()), 1e-12))
