"""Faults of a log as a whole: gaps, units, order of columns, saturation.

A fault that a detector tolerates gives a note. A fault that would change the meaning of its results
is an error that names the row.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array, runs
from tauguard.datasets.columns import ColumnMap
from tauguard.detectors.faults.inputs import FASTEST
from tauguard.findings import Finding, Findings, LogError, cause, note, raise_errors
from tauguard.traces.trace import Trace

#: A pause is a gap if it is longer than GAP_SAMPLES sample intervals and than GAP_SECONDS seconds.
GAP_SAMPLES, GAP_SECONDS = 5.0, 0.05
#: Largest joint position, two turns [rad]; larger numbers are probably degrees.
FURTHEST = 4 * np.pi
#: Velocities are integrated over this time and compared with the change of position [s].
SPAN = 0.1
#: Largest motor current [A]; larger numbers are probably milliamperes or torques.
AMPERES = 100.0
#: A current is saturated if its magnitude stays at the maximum for PLATEAU samples in a row, and
#: the maximum is at least ABOVE times the magnitude's median.
PLATEAU, ABOVE = 5, 3.0
#: Largest motion between two samples at a jump of one turn [rad].
WRAPPED = 0.5
#: The clock was set back if time steps back fewer than FEW times, and more than FEW rows follow.
FEW = 5
#: If more than this fraction of the rows repeat a time, the time has too few digits.
COARSE = 0.95
#: Rows that repeat the previous state are left out if they are at least this fraction of all rows:
#: the recorder is then faster than its robot. A standing arm repeats some values by chance.
REPEATED = 0.2
#: Names, in lower case, of columns that label contact if all their cells are in LABEL.
LABELS = ("label", "contact", "collision", "touch", "in_contact", "in_collision")
LABEL = {"0": False, "false": False, "1": True, "true": True}

Where = Callable[[int], str]


def checked(trace: Trace, where: Where, earlier: Sequence[Finding] = ()) -> Findings:
    """Check a log and return notes on faults that a detector tolerates.

    Args:
        trace: the log.
        where: text for a row's number, such as "line 12".
        earlier: findings of its reading, which come first.

    Raises:
        LogError: gaps, angles in degrees, or velocities that do not fit the positions; each is a
            finding.
    """
    degrees = _in_degrees(trace, where)
    doubts = [*degrees, *_timing(trace, where)]
    doubts += [] if degrees else _strange_velocities(trace)
    most = float(np.abs(trace.current).max(initial=0.0))
    if most > AMPERES and trace.meta.get("effort") != "torque":
        text = (
            f'currents up to {most:.0f} A: if these are milliamperes, say `mend="mA"`; if they are '
            "torques, `torque=True`"
        )
        doubts.append(note("large-currents", text))
    for name, row, count, peak in saturated(trace):
        text = (
            f"{where(row)}: the current of {name} stays at {peak:g} A for {count} samples: "
            "saturated; neither an alarm nor its absence there means anything"
        )
        doubts.append(note("saturated", text, name))
    return raise_errors(LogError, [*earlier, *doubts])


def unwrapped(q: Array, names: Sequence[str], where: Where) -> tuple[Array, list[Finding]]:
    """Positions without jumps of one turn [rad], shape (T, n), and a note on each joint with any.

    A column is wrapped if its values stay within -pi to pi or 0 to 2 pi, and it jumps by a turn
    from one sample to the next.
    """
    jumps = np.round(np.diff(q, axis=0) / (2 * np.pi))
    left = np.abs(np.diff(q, axis=0) - 2 * np.pi * jumps)
    turn = np.pi + 0.01
    inside = (np.abs(q) <= turn).all(axis=0) | (np.abs(q - np.pi) <= turn).all(axis=0)
    wrapped = inside & (jumps != 0).any(axis=0) & ~((jumps != 0) & (left > WRAPPED)).any(axis=0)
    notes = []
    for j in np.flatnonzero(wrapped).tolist():
        rows = np.flatnonzero(jumps[:, j])
        text = (
            f"{where(int(rows[0]) + 1)}: the position of {names[j]} jumps by a turn"
            f"{f', {len(rows)} times in all' if len(rows) > 1 else ''}: it was wrapped, and is "
            "continued here"
        )
        notes.append(note("wrapped", text, names[j]))
    turns = np.concatenate([np.zeros_like(jumps[:1]), np.cumsum(jumps, axis=0)])
    return np.where(wrapped, q - 2 * np.pi * turns, q), notes


def _timing(trace: Trace, where: Where) -> list[Finding]:
    steps = np.diff(trace.t)
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > max(GAP_SAMPLES * usual, GAP_SECONDS))
    if len(steps) >= 20 and len(gaps):
        row = int(gaps[0])
        text = (
            f"{where(row + 1)}: no sample in the {steps[row]:.3g} s before it, but samples come "
            f"every {1e3 * usual:.3g} ms ({len(gaps)} such gaps): cut the log there; the "
            f"rows up to {where(row)} and those from {where(row + 1)} on are separate logs"
        )
        return [cause("gap", text)]
    late = np.flatnonzero(steps > 2 * usual)
    if len(steps) < 20 or not len(late):
        return []
    text = (
        f"samples come every {1e3 * usual:.3g} ms, {len(late)} later than twice that, by up to "
        f"{1e3 * steps.max():.3g} ms; first: {where(int(late[0]) + 1)}"
    )
    return [note("late-samples", text)]


def _in_degrees(trace: Trace, where: Where) -> list[Finding]:
    for what, x, most, unit, needed in (
        ("velocity", trace.qd, FASTEST, "rad/s", 1),
        ("position", trace.q, FURTHEST, "rad", min(2, trace.q.shape[1])),
    ):
        beyond = np.abs(x) > most
        if beyond.any(axis=0).sum() >= needed:
            row, joint = (int(v) for v in np.argwhere(beyond)[0])
            text = (
                f"{where(row)}: the {what} of {trace.joint_names[joint]} is {x[row, joint]:g} "
                f'{unit}: if these are degrees, say `mend="deg"` ("degrees" in a column map)'
            )
            joints = [trace.joint_names[k] for k in np.flatnonzero(beyond.any(axis=0))]
            return [cause("units", text, *joints)]
    return []


def travelled(trace: Trace) -> tuple[Array, Array]:
    """Change of position, and integrated velocity, in each interval of ``SPAN``, shape (K, n).

    Intervals with a gap are left out.
    """
    count = max(1, round(SPAN / trace.dt))
    steps = np.diff(trace.t)[:, None] * (trace.qd[1:] + trace.qd[:-1]) / 2
    whole = np.concatenate([np.zeros_like(steps[:1]), np.cumsum(steps, axis=0)])
    usual = np.diff(trace.t[::count]) < 1.25 * count * trace.dt
    return np.diff(trace.q[::count], axis=0)[usual], np.diff(whole[::count], axis=0)[usual]


def _strange_velocities(trace: Trace) -> list[Finding]:
    """Velocities that do not follow the positions; joints with the same likely cause together."""
    if len(trace.t) < 100:
        return []
    change, summed = travelled(trace)
    moves = (np.sqrt((change**2).mean(axis=0)) > 1e-3) & (np.sqrt((summed**2).mean(axis=0)) > 1e-5)
    findings: list[Finding] = []
    ratios: dict[tuple[str, str], dict[str, float]] = {}
    for j in np.flatnonzero(moves):
        name = trace.joint_names[j]
        alike = [_alike(change[:, k], summed[:, j]) for k in range(change.shape[1])]
        if abs(alike[j]) < 0.7:  # a wrong sign is reported below
            best = int(np.argmax(alike))
            other = trace.joint_names[best]
            text = f"the velocity of {name} does not follow its position" + (
                f" but that of {other}: columns in another order?" if alike[best] > 0.9 else ""
            )
            findings.append(cause("velocities", text, name))
            continue
        ratio = float(change[:, j] @ summed[:, j] / (summed[:, j] @ summed[:, j]))
        if not 0.7 < ratio < 1.4:
            ratios.setdefault(_meaning(ratio), {})[name] = ratio
    for (code, meaning), of in ratios.items():
        low, high = f"{min(of.values()):.3g}", f"{max(of.values()):.3g}"
        span = low if low == high else f"{low} to {high}"
        text = f"{', '.join(of)}: {meaning}: change of position is {span} times the velocity"
        findings.append(cause(code, text, *of))
    return findings


def _meaning(ratio: float) -> tuple[str, str]:
    """Code and likely cause of a wrong ratio of change of position to velocity."""
    if 40 < ratio < 80:
        return "units", "positions in degrees, velocities in rad/s"
    if 1 / 80 < ratio < 1 / 40:
        return "units", "velocities in degrees/s, positions in rad"
    if -1.4 < ratio < -0.7:
        return "velocity-sign", "the velocity has the other sign"
    for word, scale in (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
        if 0.7 < ratio / scale < 1.4:
            return "units", f'time in {word}? Then say `mend="{word}"`'
    return "units", "the units of velocity, position and time do not fit"


def _alike(a: Array, b: Array) -> float:
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0 else 0.0


def saturated(trace: Trace) -> list[tuple[str, int, int, float]]:
    """Joints whose current stays at its largest value: name, first row, longest run, value [A]."""
    found = []
    for name, current in zip(trace.joint_names, trace.current.T, strict=True):
        size = np.abs(current)
        peak = float(size.max(initial=0.0))
        if peak == 0 or peak < ABOVE * float(np.median(size)):
            continue
        starts, ends = runs(size == peak).T
        lengths = ends - starts
        long = np.flatnonzero(lengths >= PLATEAU)
        if len(long):
            found.append((name, int(starts[long[0]]), int(lengths[long].max()), peak))
    return found


def refuse_set_back(t: Array, where: Where) -> None:
    """Refuse to sort rows if the clock was set back: rows of two periods would be mixed."""
    back = [int(row) + 1 for row in np.flatnonzero(np.diff(t) < 0)]
    for begin, row, end in zip([0, *back[:-1]], back, [*back[1:], len(t)], strict=True):
        over = float(min(t[row - 1], t[end - 1]) - max(t[row], t[begin]))
        if len(back) < FEW and end - row > FEW and over > max(5 * np.median(np.diff(t)), 0.05):
            text = f"{where(row)}: the clock was set back by {over:.3g} s: cut the log there "
            raise LogError(cause("time", f"{text}into two"))


def increasing(
    t: Array, where: Where, columns: ColumnMap, notes: list[Finding]
) -> NDArray[np.bool_]:
    """Rows to keep so that time increases strictly; times may repeat only if the map allows it."""
    step = np.diff(t)
    back = np.flatnonzero(step < 0)
    if back.size:
        row = int(back[0]) + 1
        text = (
            f"{where(row)}: time goes back from {t[row - 1]} to {t[row]} s; to sort the rows, "
            'say `mend="order"`'
        )
        raise LogError(cause("time", text))
    same = [int(row) for row in np.flatnonzero(step == 0)]
    if same and "repeat" not in columns.repair:
        text = (
            f"{where(same[0] + 1)}: time {t[same[0]]} s repeats; to leave such rows out, say "
            '`mend="repeat"`'
        )
        raise LogError(cause("time", text))
    if len(same) > COARSE * len(t):
        text = (
            f"{len(same)} of {len(t)} rows repeat the time before: the time has too few digits; "
            'write more of them, or say `mend="clock=HZ"` (rows per second) instead'
        )
        raise LogError(cause("time", text))
    if same:
        text = f"{len(same)} rows with a repeated time left out, first: {where(same[0] + 1)}"
        notes.append(note("rows-left-out", text))
    return np.concatenate([[True], step > 0])


def fresh(
    t: Array, state: Array, keep: NDArray[np.bool_], notes: list[Finding]
) -> NDArray[np.bool_]:
    """Rows to keep: all but copies of the previous state that a fast recorder wrote.

    A difference quotient would be 0 at a copy, and twice the speed after it. While the state does
    not change, rows are kept at the usual interval of new states.

    Args:
        t: times [s], shape (T,).
        state: all signals, shape (T, columns).
        keep: rows to consider, shape (T,).
        notes: a line on the rows left out is appended.
    """
    rows = np.flatnonzero(keep)
    new = np.concatenate([[True], (np.diff(state[rows], axis=0) != 0).any(axis=1)])
    share = 1 - new.mean()
    if share < REPEATED or new.sum() < 3:
        return keep
    usual = float(np.median(np.diff(t[rows][new])))
    kept, last = np.zeros_like(keep), -np.inf
    for row, is_new in zip(rows, new, strict=True):
        if is_new or t[row] - last > 1.4 * usual:
            kept[row], last = True, t[row]
    text = (
        f"{100 * share:.0f} % of the rows repeat the previous state and are left out; new states "
        f"come every {1e3 * usual:.3g} ms"
    )
    notes.append(note("rows-left-out", text))
    return kept


def labelled(
    header: Sequence[str],
    rows: Sequence[tuple[int, Sequence[Any]]],
    lines: NDArray[np.int64],
    t: Array,
) -> tuple[tuple[float, float], ...] | None:
    """Times of the contacts that a label column of a log states.

    Args:
        header: names of the columns.
        rows: lines of the file, each with its cells.
        lines: line of each sample, shape (T,).
        t: time of each sample [s], shape (T,).

    Returns:
        Times of the first and last sample of each contact; None without a column in LABELS whose
        values are all 0 and 1, or false and true.
    """
    columns = [k for k, name in enumerate(header) if name.lower() in LABELS]
    cells = dict(rows) if columns else {}
    for column in columns:
        marks = [LABEL.get(str(cells[n][column]).strip().lower().removesuffix(".0")) for n in lines]
        if None in marks:
            continue
        return tuple((float(t[a]), float(t[b - 1])) for a, b in runs(np.array(marks)))
    return None
