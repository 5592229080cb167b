"""Motion regimes of joints, and regimes that do not occur in logs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tauguard.arrays import Array, Bools
from tauguard.detectors.calibration.recording import Recording
from tauguard.detectors.features.free_bound import SHOWN_SECONDS, SLOW, motion_seconds
from tauguard.findings import Findings, note
from tauguard.traces.trace import Trace

#: Least total time of a regime in the logs [s]; below it the regime counts as unseen.
SEEN = 3.0
#: A speed or acceleration counts as shown if the logs exceed it for this time in total [s].
SHORTLY = 0.5
#: Interval of the rows that are evaluated [s].
EVERY = 0.04

#: Pairs of a regime and the joints that no log shows in it.
Unseen = tuple[tuple[str, tuple[str, ...]], ...]


def motion_regimes(trace: Trace) -> dict[str, Bools]:
    """Whether each joint is in each regime, shape (T, n) each."""
    speed, dt = np.abs(trace.qd), trace.dt
    moves = speed > SLOW
    stood, went = _lasting(~moves, dt), _lasting(moves, dt)
    others = moves.sum(axis=1, keepdims=True) - moves
    return {
        "standing for 2 s": stood > 2,
        "just stopped": (stood > 0) & (stood < 1),
        "starting": (went > 0) & (went < 0.3),
        "slow (below 0.1 rad/s)": moves & (speed < 0.1),
        "fast (above 1 rad/s)": speed > 1,
        "moving alone": moves & (others == 0),
        "at rest while others move": ~moves & (others > 0),
    }


def unseen(traces: Sequence[Trace]) -> Unseen:
    """Regimes that all traces together show for less than :data:`SEEN`, with their joints."""
    shown: dict[str, Array] = {}
    for trace in traces:
        for name, rows in motion_regimes(trace).items():
            shown[name] = shown.get(name, np.zeros(rows.shape[1])) + rows.sum(axis=0) * trace.dt
    lacking = (
        (name, tuple(j for j, s in zip(traces[0].joint_names, seconds, strict=True) if s < SEEN))
        for name, seconds in shown.items()
    )
    return tuple((name, joints) for name, joints in lacking if joints)


def unseen_motion(traces: Sequence[Trace]) -> Findings:
    """Notes on joints that hardly move in any log, and on regimes that no log shows."""
    seconds = motion_seconds([Recording(trace) for trace in traces])
    names = traces[0].joint_names
    still = [name for name, s in zip(names, seconds, strict=True) if s < SHOWN_SECONDS]
    notes = []
    if still:
        text = (
            f"{', '.join(still)}: moves in none of the logs, so its friction is not known. No "
            "collision is detected while it moves, and none of moving joints while it stands "
            "elsewhere; its bound at rest is assumed; add a log in which it moves"
        )
        notes.append(note("still-joint", text, *still))
    if lacking := unseen(traces):
        text = f"the logs show less than {SEEN:g} s of {unseen_text(lacking, len(names))}"
        notes.append(note("unseen-motion", text))
    return Findings(notes)


def exceeded(parts: Sequence[tuple[Array, Array]]) -> Array:
    """The value that each column exceeds for :data:`SHORTLY` in total, shape (n,).

    Args:
        parts: times [s], shape (T,), and values, shape (T, n), of each log.
    """
    steps = [float(np.median(np.diff(t))) for t, _ in parts]
    strides = [max(1, round(EVERY / dt)) for dt in steps]
    rows = [sizes[::k] for (_, sizes), k in zip(parts, strides, strict=True)]
    each = [k * dt for k, dt in zip(strides, steps, strict=True)]
    sizes, seconds = np.concatenate(rows), np.repeat(each, [len(r) for r in rows])
    order = np.argsort(-sizes, axis=0, kind="stable")
    passed = np.cumsum(seconds[order], axis=0)  # time with this value or a larger one, per column
    count = (passed <= SHORTLY * (1 + 1e-6)).sum(axis=0)
    ranked = np.take_along_axis(sizes, order, axis=0)
    return np.asarray(np.take_along_axis(ranked, np.maximum(count - 1, 0)[None], axis=0)[0])


def unseen_text(lacking: Unseen, joints: int) -> str:
    """One line of text: each unseen regime with its joints, out of ``joints``."""
    return "; ".join(
        f"{name}: {'all joints' if len(own) == joints else ', '.join(own)}" for name, own in lacking
    )


def _lasting(on: Bools, dt: float) -> Array:
    """Time since each column became True [s], 0 where it is False; same shape as ``on``."""
    rows = np.arange(1, len(on) + 1)[:, None]
    off = np.maximum.accumulate(np.where(on, 0, rows), axis=0)
    return np.asarray(np.where(on, (rows - off) * dt, 0.0))
