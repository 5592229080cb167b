"""Windows of the scaled residual, the input of the learned methods.

The dissertation's window contains the residuals of joints 1 to 4 during t_W = 80 ms, sampled every
t_I = 8 ms. These are 11 samples per joint, 44 numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.arrays import Array, Bools
from tauguard.detectors import _kernel
from tauguard.detectors.estimation.observer import intervals, lagged
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace

#: Length and sample interval of the dissertation's window [s].
WINDOW, INTERVAL = 80e-3, 8e-3


@dataclass(frozen=True)
class WindowShape:
    """The samples of a window."""

    lag: int  #: number of rows between successive samples of a window
    count: int  #: number of samples per joint

    @classmethod
    def at(cls, dt: float) -> WindowShape:
        """The dissertation's window, in whole samples of ``dt`` seconds."""
        if not dt > 0:
            raise ArgumentError(f"dt {dt} s: expected above 0")
        lag = max(1, round(INTERVAL / dt))
        return cls(lag, max(1, round(WINDOW / (lag * dt))) + 1)

    def of(self, signal: Array, ends: ArrayLike) -> Array:
        """The windows that end at rows ``ends``, shape (N, m count).

        They are ordered by joint, then oldest sample first. The first row replaces rows before it.

        Args:
            signal: shape (T, m).
            ends: rows of the signal, shape (N,).
        """
        at = np.ascontiguousarray(ends, dtype=np.int64)
        out = np.empty((len(at), signal.shape[1] * self.count))
        _kernel.windows(signal, at, self.lag, self.count, out)
        return out


def median_distance(a: Array, b: Array, rng: np.random.Generator, pairs: int = 4000) -> float:
    """Median Euclidean distance between random rows of ``a`` and of ``b``."""
    one, two = rng.integers(len(a), size=pairs), rng.integers(len(b), size=pairs)
    return float(np.median(np.linalg.norm(a[one] - b[two], axis=1)))


@dataclass(frozen=True, eq=False)
class Prepared:
    """Signals of one training trace."""

    signal: Array  #: scaled residual, shape (T, number of used joints)
    target: Array  #: target of the regressor, shape (T,)
    free: Bools  #: rows that are certainly collision-free, shape (T,)
    collision: Bools  #: rows with a collision whose target is above FELT, shape (T,)


#: Largest torques of joints 1, 2, ... that have equal weight in the training target. The last value
#: is used for all further joints. Only ratios of these numbers have an effect.
ALIKE = (20.0, 20.0, 15.0, 6.0)

#: The scaled sum of torques of the median training collision.
MEDIAN_SEVERITY = 2.5

#: Least target of a collision in training.
FELT = 0.05
#: Larger targets x / (1 + x) are set to this, which is x = 49.
HIGHEST = 0.98


def severity_targets(traces: Sequence[Trace], joints: Sequence[int], gain: float) -> list[Array]:
    """The training target x / (1 + x), where x is the scaled sum over ``joints`` of |tau_ext|.

    The torques pass the observer's filter and are weighted by :data:`ALIKE`. The scale is chosen so
    that the peaks of x in collisions have the median :data:`MEDIAN_SEVERITY`, whatever the size of
    the arm. Labels 0 and 1 would not rank collisions. As x / (1 + x) is below 1, hard impacts do
    not use up the regressor's bounded weights.

    Args:
        traces: the target of a trace without truth is 0.
        joints: 0-based.
        gain: gain of the observer [1/s].

    Returns:
        The target of each trace, shape (T,).
    """
    alike = np.array([ALIKE[min(k, len(ALIKE) - 1)] for k in range(len(joints))])
    totals = [_total(trace, list(joints), alike, gain) for trace in traces]
    highest = [
        float(total[(trace.t >= c.onset) & (trace.t <= c.end)].max(initial=0.0))
        for trace, total in zip(traces, totals, strict=True)
        for c in (trace.truth.collisions if trace.truth else ())
    ]
    felt = [value for value in highest if value > 0]
    unit = float(np.median(felt)) / MEDIAN_SEVERITY if felt else 1.0
    return [total / (unit + total) for total in totals]


def severity(target: Array) -> Array:
    """x of a target x / (1 + x), at most the x of :data:`HIGHEST`.

    The output of a regressor hardly exceeds 1, however hard the impact is. x has no such limit, so
    the tail of its peaks can be extrapolated, and impacts can exceed free motion at any speed.
    """
    bounded = np.minimum(target, HIGHEST)
    found: Array = bounded / (1 - bounded)
    return found


def _total(trace: Trace, joints: list[int], alike: Array, gain: float) -> Array:
    """Lagged external torques, weighted and summed, shape (T,)."""
    if trace.truth is None:
        return np.zeros(len(trace.t))
    external = trace.truth.tau_ext[:, joints] / alike
    late = lagged(gain, intervals(trace.t, len(trace.t)), external)
    total: Array = np.abs(late).sum(axis=1)
    return total


def binary_target(trace: Trace) -> Array:
    """The dissertation's plain labels: 1 while a collision lasts, else 0."""
    label = np.zeros(len(trace.t))
    for collision in trace.truth.collisions if trace.truth else ():
        label[(trace.t >= collision.onset) & (trace.t <= collision.end)] = 1.0
    return label


def peaks(score: Array, count: int, gap: int) -> NDArray[np.int64]:
    """Indices of the ``count`` highest scores that are at least ``gap`` apart, in order."""
    chosen: list[int] = []
    blocked = np.zeros(len(score), dtype=np.bool_)
    for index in np.argsort(-score, kind="stable"):
        if len(chosen) == count:
            break
        if not blocked[index]:
            chosen.append(int(index))
            blocked[max(0, index - gap) : index + gap + 1] = True
    return np.array(sorted(chosen), dtype=np.int64)


#: Fraction of the windows that are from collisions.
STRUCK = 0.2


def draw_windows(
    rng: np.random.Generator,
    prepared: Sequence[Prepared],
    shape: WindowShape,
    count: int,
) -> tuple[Array, Array]:
    """Random windows and targets, a fraction :data:`STRUCK` of them from collisions.

    Raises:
        ArgumentError: no collision or no free motion in the traces.
    """
    x, y = [], []
    for name, fraction in (("collision", STRUCK), ("free", 1 - STRUCK)):
        masks = [getattr(p, name) for p in prepared]
        total = sum(int(m.sum()) for m in masks)
        if total == 0:
            what = "collision" if name == "collision" else "collision-free row"
            raise ArgumentError(f"the training traces contain no {what}: both kinds are needed")
        picks = np.sort(rng.choice(total, min(total, round(count * fraction)), replace=False))
        start = 0
        for p, mask in zip(prepared, masks, strict=True):
            rows = np.flatnonzero(mask)
            own = rows[picks[(picks >= start) & (picks < start + len(rows))] - start]
            x.append(shape.of(p.signal, own))
            y.append(p.target[own] if name == "collision" else np.zeros(len(own)))
            start += len(rows)
    return np.concatenate(x), np.concatenate(y)
