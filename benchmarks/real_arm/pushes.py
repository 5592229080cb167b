"""Semi-real pushes of a hand at a real arm's last link: what share is found, and how late.

A push is half a sine of 0.3 to 1 s and 20 to 80 N at its peak, in any direction, at the origin of
the last link; its torques follow from the Jacobian along the recorded motion and are added to the
currents of logs that the detector has not seen. It is found by an alarm between its start and 0.2 s
after its end that the log alone does not raise. The delay counts from the start, where the force is
still 0: a push of 50 N passes 20 N after an eighth of its time. Pushes of all deals are counted
together: they differ, the minutes of the logs that they are added to do not, so that the intervals
say how well the share of such pushes in these logs is known, not in others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors import RobotNumbers
from tauguard.detectors.evaluation.semi_real import Push, add_torque, moments, push_torque
from tauguard.detectors.methods.free_motion import FreeMotionDetector
from tauguard.report import Row, rate
from tauguard.traces import Trace

Alarms = Callable[[Trace], NDArray[np.bool_]]

SECONDS, NEWTONS = (0.3, 1.0), (20.0, 80.0)
BANDS = (20.0, 40.0, 60.0, 80.0)
AFTER = 0.2  #: an alarm this long after the end still counts [s]


@dataclass(frozen=True)
class Tried:
    """One push and who found it; delays from its start [s], inf where it was missed."""

    moving: bool
    newtons: float
    torque: float  #: largest at any joint [N m]
    delay: float
    peer: float  #: nan where the peer had not learned yet


def pushed(
    detector: FreeMotionDetector,
    peer: Alarms,
    robot: RobotNumbers,
    traces: Sequence[Trace],
    count: int,
    learned: float,
    seed: int,
) -> list[Tried]:
    """``count`` pushes a trace, in motion and standing as it comes; ``learned`` [s] is the peer's.

    Traces in which the detector alarms by itself are left out.
    """
    out = []
    gain = detector.arm.drive_gain
    for k, trace in enumerate(traces):
        if detector.detect(trace).alarms:
            continue
        rng = np.random.default_rng([seed, k])
        false = peer(trace) if trace.t[-1] > trace.t[0] + learned + 1 else np.zeros(0, np.bool_)
        still = np.asarray(detector.rests(trace).all(axis=1))
        for start in moments(np.ones(len(trace.t), np.bool_), trace.t, count, seed + k):
            direction = rng.normal(size=3)
            size, seconds = rng.uniform(*NEWTONS), rng.uniform(*SECONDS)
            x, y, z = size * direction / np.linalg.norm(direction)
            torque = push_torque(robot, trace, Push(start, seconds, (x, y, z)))
            struck = add_torque(trace, gain, torque)
            own = _delay(detector.detect(struck).alarm, trace.t, start, seconds)
            other = np.nan
            if start > trace.t[0] + learned + 1:
                other = _delay(peer(struck) & ~false, trace.t, start, seconds)
            moves = not still[int(np.searchsorted(trace.t, start))]
            out.append(Tried(moves, size, float(np.abs(torque).max()), own, other))
    return out


def _delay(alarm: NDArray[np.bool_], t: NDArray[np.float64], start: float, last: float) -> float:
    rows = np.flatnonzero(alarm & (t >= start) & (t <= start + last + AFTER))
    return float(t[rows[0]] - start) if len(rows) else np.inf


def push_rows(tried: Sequence[Tried]) -> list[Row]:
    """A row a band of force, in motion and standing."""
    rows: list[Row] = []
    for moving in (True, False):
        for low, high in [*pairwise(BANDS), (BANDS[0], BANDS[-1])]:
            own = [t for t in tried if t.moving == moving and low <= t.newtons < high]
            if not own:
                continue
            delays = np.array([t.delay for t in own])
            peer = np.array([t.peer for t in own if not np.isnan(t.peer)])
            found = np.isfinite(delays)
            share = rate(int(found.sum()), len(own))
            rows.append(
                {
                    "study": "pushes",
                    "arm": "in motion" if moving else "standing",
                    "N at the flange": f"{low:g}-{high:g}",
                    "N m (median)": float(np.median([t.torque for t in own])),
                    "pushes": len(own),
                    "found": share,
                    "delay ms (median)": _ms(delays[found], 0.5),
                    "delay ms (p95)": _ms(delays[found], 0.95),
                    "peer pushes": len(peer),
                    "peer found": rate(int(np.isfinite(peer).sum()), len(peer)),
                    "peer delay ms (median)": _ms(peer[np.isfinite(peer)], 0.5),
                }
            )
    return rows


def _ms(delays: NDArray[np.float64], quantile: float) -> float | None:
    return 1e3 * float(np.quantile(delays, quantile)) if len(delays) else None
