"""Replay of the current errors of a drive model, matched to similar recorded motions.

The error of a model of a real drive mostly repeats with the motion, has heavy tails and depends on
speed, acceleration and the time since a stop. A random process does not have this structure, so
stretches (intervals) of a recorded error are replayed. A stretch goes on while the present motion
resembles the motion of its log. Otherwise the stretch with the most similar motion is faded in, as
in motion matching for animated characters (Clavet 2016, "Motion matching and the road to next-gen
animation"). Each joint is matched separately.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array, Bools
from tauguard.atomic_write import write_atomic
from tauguard.findings import ArgumentError
from tauguard.untrusted_input import read_text, reading

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

#: A joint below this speed counts as standing [rad/s].
SLOW = 0.02
#: Time constants of the filters of velocity and acceleration [s].
FAST, SLOWER = 0.02, 0.06
#: Time between two comparisons of the motions, and duration of a fade [s].
EVERY = 0.05
#: A stretch is left if its feature distance from the present motion exceeds that of the nearest
#: stretch by more than this.
MARGIN = 1.0
#: Least remaining length of the log at the beginning of a stretch [s].
LEAST = 0.2
#: A joint that stops takes one of the STOPS nearest stretches at random, because stops differ. A
#: standing joint takes, of the STANDS nearest stretches, the one with the most similar torque.
STOPS, STANDS = 8, 64
#: A joint that has stood for HELD [s] keeps its error at a change of stretch, by an offset. The
#: offset decays with the time constant FORGET [s] at rest and RELEASE [s] in motion.
HELD, FORGET, RELEASE = 0.3, 1.6, 0.2
#: Scales of speed [rad/s] and acceleration [rad/s^2]; weights of the features.
SPEED, ACCELERATION = 0.05, 0.5
WEIGHTS = np.array([1.0, 0.5, 0.5, 0.5, 1.0, 1.0])
#: Index of the feature of the time since the joint moved; its values in motion, and after HELD.
MOVED = 3
_UNMOVED, _LONG = (float(WEIGHTS[MOVED] * np.log10(0.02 + s)) for s in (1e-3, HELD))


#: A search tree, and the row of each of its points.
_Tree: TypeAlias = "tuple[cKDTree, NDArray[np.intp]]"


@dataclass(frozen=True, eq=False)
class LeftOver:
    """Errors of reported currents along recorded motions, evenly sampled."""

    rate: float  #: samples per second
    log: NDArray[np.int64]  #: number of each sample's log, increasing, shape (N,)
    qd: Array  #: [rad/s], shape (N, n)
    current: Array  #: reported less modelled current [A], shape (N, n)

    def __post_init__(self) -> None:
        """Check shapes and values: ``ArgumentError`` names the field."""
        rows, joints = self.current.shape
        if self.qd.shape != (rows, joints) or self.log.shape != (rows,):
            raise ArgumentError(
                f"left_over: log, qd: expected shapes ({rows},), ({rows}, {joints})"
            )
        if not (np.isfinite(self.qd).all() and np.isfinite(self.current).all()):
            raise ArgumentError("left_over: not finite")
        if not self.rate > 0 or (np.diff(self.log) < 0).any():
            raise ArgumentError("left_over: expected a rate above 0 and logs in rising order")
        if not len(self._starts):
            raise ArgumentError(f"left_over: no log is longer than {LEAST} s")

    @classmethod
    def read(cls, path: str | Path) -> LeftOver:
        """Read a CSV file that :meth:`write` made.

        Raises:
            ArgumentError: the file has another form.
            FileNotFoundError: no such file.
        """
        with reading(path, "expected columns log, t, qd1, ..., error1, ..."):
            lines = read_text(path).splitlines()
            table = np.loadtxt(lines[1:], delimiter=",", ndmin=2)
            joints = lines[0].count("error")
            if joints == 0 or table.shape[1] != 2 + 2 * joints or len(table) < 2:
                raise ArgumentError(f"{table.shape[1]} columns for {joints} joints")
            rate = 1 / float(np.median(np.diff(table[:, 1])))
            log = table[:, 0].astype(np.int64)
            return cls(rate, log, table[:, 2 : 2 + joints], table[:, 2 + joints :])

    def write(self, path: Path) -> None:
        """Write CSV with the columns log, time in the log [s], velocities [rad/s], errors [A]."""
        joints = range(1, self.qd.shape[1] + 1)
        head = ["log", "t", *(f"qd{j}" for j in joints), *(f"error{j}" for j in joints)]
        first = np.searchsorted(self.log, self.log)
        times = (np.arange(len(self.log)) - first) / self.rate
        rows = [
            f"{k},{t:.4f},{','.join(f'{v:.5g}' for v in values)}"
            for k, t, values in zip(
                self.log, times, np.hstack([self.qd, self.current]), strict=True
            )
        ]
        write_atomic(path, "\n".join([",".join(head), *rows]) + "\n")

    @cached_property
    def features(self) -> Array:
        """Features of the motion at every sample, shape (N, n, features)."""
        parts = [
            _Motion(1 / self.rate).features(self.qd[self.log == k]) for k in np.unique(self.log)
        ]
        return np.concatenate(parts)

    @cached_property
    def remaining(self) -> NDArray[np.int64]:
        """Number of samples of the log after each sample, shape (N,)."""
        last = np.searchsorted(self.log, self.log, side="right") - 1
        return last - np.arange(len(self.log))

    @cached_property
    def _starts(self) -> NDArray[np.intp]:
        first = np.searchsorted(self.log, self.log)
        settled = np.arange(len(self.log)) - first > 2 * SLOWER * self.rate
        return np.flatnonzero(settled & (self.remaining > LEAST * self.rate))[::2]

    @cached_property
    def _trees(self) -> list[tuple[_Tree, _Tree]]:
        """Per joint, search trees of all stretches, and of those at whose start it stands."""
        later = self._starts + round(HELD * self.rate)
        later = np.minimum(later, self._starts + self.remaining[self._starts])
        found = []
        for j in range(self.qd.shape[1]):
            stands = self.features[:, j, MOVED] > _UNMOVED
            rest = self._starts[stands[self._starts] & stands[later]]
            every = self._tree(j, self._starts)
            found.append((every, self._tree(j, rest) if len(rest) else every))
        return found

    def _tree(self, joint: int, rows: NDArray[np.intp]) -> _Tree:
        from scipy.spatial import cKDTree  # heavy: only where errors are played

        return cKDTree(self.features[rows, joint]), rows

    @cached_property
    def smooth(self) -> Array:
        """Mean of the errors over the last 0.1 s [A], shape (N, n)."""
        count = max(1, round(0.1 * self.rate))
        total: Array = np.cumsum(np.vstack([self.current[:1].repeat(count, 0), self.current]), 0)
        mean: Array = (total[count:] - total[:-count]) / count
        return mean

    def nearest(
        self, joint: int, motion: Array, stands: bool, count: int
    ) -> tuple[float, NDArray[np.intp]]:
        """Distance of the nearest stretch to a motion, and first rows of the ``count`` nearest."""
        tree, rows = self._trees[joint][int(stands)]
        distance, found = tree.query(motion, k=min(count, len(rows)))
        places: NDArray[np.intp] = rows[np.atleast_1d(found)]
        return float(np.min(distance)), places


class _Motion:
    """Features of a motion up to each sample, computed block by block."""

    def __init__(self, dt: float) -> None:
        self._dt = dt
        self._filtered: list[Array] = []
        self._since: list[Array] = []
        self._direction = np.zeros(0)

    def features(self, qd: Array) -> Array:
        """Features of the next samples' motion, shape (T, n, features)."""
        from scipy.signal import lfilter

        if not self._filtered:
            self._filtered = [qd[0], qd[0]]
            self._since = [np.full(qd.shape[1], 5.0)] * 2
            self._direction = np.zeros(qd.shape[1])
        kept = [np.exp(-self._dt / constant) for constant in (FAST, SLOWER)]
        fast, slower = (
            lfilter([1 - k], [1, -k], qd, axis=0, zi=k * before[None])[0]
            for k, before in zip(kept, self._filtered, strict=True)
        )
        self._filtered = [fast[-1], slower[-1]]
        slow = np.abs(fast) < SLOW
        stood, moved = (
            self._passed(mask, k) for k, mask in enumerate((np.asarray(slow), np.asarray(~slow)))
        )
        speed = np.arcsinh(fast / SPEED)
        acceleration = np.arcsinh((fast - slower) / (SLOWER - FAST) / ACCELERATION)
        size = np.abs(speed)
        others = np.stack(
            [np.delete(size, j, 1).max(axis=1, initial=0.0) for j in range(size.shape[1])], axis=1
        )
        times = np.log10(0.02 + np.minimum(stood, 1.0)), np.log10(0.02 + np.minimum(moved, 1.0))
        parts = [speed, acceleration, *times, others, self._last_direction(fast, slow)]
        return np.asarray(WEIGHTS * np.stack(parts, axis=2))

    def _last_direction(self, fast: Array, slow: Bools) -> Array:
        """The sign of each joint's last motion, which sets its friction at rest, shape (T, n)."""
        row = np.arange(1, len(fast) + 1)[:, None]
        last = np.maximum.accumulate(np.where(slow, 0, row), axis=0)
        signs = np.take_along_axis(np.sign(fast), np.maximum(last - 1, 0), axis=0)
        found: Array = np.where(last > 0, signs, self._direction)
        self._direction = found[-1]
        return found

    def _passed(self, mask: Bools, k: int) -> Array:
        """Time since each joint's mask was last true [s], shape (T, n)."""
        row = np.arange(1.0, len(mask) + 1)[:, None]
        last = np.maximum.accumulate(np.where(mask, row, 0.0), axis=0)
        before = self._since[k] + row * self._dt
        passed = np.where(last > 0, (row - last) * self._dt, before)
        self._since[k] = np.minimum(passed[-1], 5.0)
        return passed


class Player:
    """Generates the errors along a running motion, block by block."""

    def __init__(self, source: LeftOver, dt: float, rng: np.random.Generator) -> None:
        """Start with no matched stretch.

        Args:
            source: the errors to replay.
            dt: sample interval of the motion [s].
            rng: generator of the random choices between stretches.
        """
        n = source.qd.shape[1]
        self._source, self._rng, self._step = source, rng, dt * source.rate
        self._motion, self._dt = _Motion(dt), dt
        self._rows = max(1, round(EVERY / dt))  # rows between two comparisons
        self._due = 0
        self._at = np.full(n, -1.0)  # row of the source, per joint
        self._before = np.full(n, -1.0)  # row that is faded out
        self._held = np.zeros(n)  # offset by which a joint at rest keeps its error [A]
        self._held_before = np.zeros(n)
        self._keep = np.exp(-dt / np.array([FORGET, RELEASE]))

    def next(self, qd: Array) -> Array:
        """Errors [A] along the next samples' velocities [rad/s], both of shape (T, n)."""
        motion, out = self._motion.features(qd), np.empty_like(qd, dtype=np.float64)
        row = 0
        while row < len(qd):
            if self._due == 0:
                self._compare(motion[row])
                self._due = self._rows
            count = min(self._due, len(qd) - row)
            out[row : row + count] = self._played(qd[row : row + count])
            self._due -= count
            row += count
        return out

    def _compare(self, motion: Array) -> None:
        """Stay in each joint's stretch, or go to the nearest one."""
        source, ahead = self._source, math.ceil(2 * self._rows * self._step)
        for j, now in enumerate(motion):
            at, stands = int(self._at[j]), bool(now[MOVED] > _UNMOVED)
            known = at >= 0 and source.remaining[at] > ahead
            if known and stands:  # a stretch is left before its joint begins to move
                known = source.features[at + ahead, j, MOVED] > _UNMOVED
            here = float(np.linalg.norm(source.features[at, j] - now)) if known else np.inf
            stood = at >= 0 and min(now[MOVED], source.features[at, j, MOVED]) > _LONG
            count = (STANDS if stood else STOPS) if stands else 1
            distance, places = source.nearest(j, now, stands, count)
            self._before[j], self._held_before[j] = self._at[j], self._held[j]
            if here <= distance + MARGIN:
                continue
            place = int(self._rng.choice(places)) if stands else int(places[0])
            if stood:
                change = source.smooth[at, j] - source.smooth[places, j]
                nearest = int(np.argmin(np.abs(self._held[j] + change)))
                place = int(places[nearest])
                if source.features[place, j, MOVED] > _LONG:
                    self._held[j] += change[nearest]
            self._at[j] = place

    def _played(self, qd: Array) -> Array:
        """The errors until the next comparison; a change of stretch is cross-faded."""
        steps = self._step * np.arange(len(qd) + 1)
        kept = np.cumprod(self._keep[(np.abs(qd) > SLOW).astype(int)], axis=0)
        new = self._read(self._at + steps[:-1, None]) + self._held * kept
        first = self._before < 0
        old = self._read(np.where(first, self._at, self._before) + steps[:-1, None])
        old += self._held_before * kept
        fade = (self._rows - self._due + np.arange(1, len(qd) + 1)[:, None]) / self._rows
        out: Array = np.where(self._before != self._at, fade * new + (1 - fade) * old, new)
        self._at += steps[-1]
        self._before[~first] += steps[-1]
        self._held *= kept[-1]
        self._held_before *= kept[-1]
        return out

    def _read(self, places: Array) -> Array:
        rows = np.minimum(places.astype(np.int64), len(self._source.log) - 1)
        values: Array = self._source.current[rows, np.arange(rows.shape[1])]
        return values
