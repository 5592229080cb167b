"""Windows of the scaled residual: the input of the learned methods.

The dissertation's window is rows 1-4 of the observer output, t_W = 80 ms long, sampled every
t_I = 8 ms: 11 samples each, 44 numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array
from tauguard.detectors import _kernel

#: The dissertation's window [s].
WINDOW, INTERVAL = 80e-3, 8e-3


@dataclass(frozen=True)
class WindowShape:
    """Which samples make a window, in whole samples."""

    lag: int  #: samples between two numbers of a window
    count: int = 11  #: numbers of a window per joint
    note: str = ""  #: what the sample rate could not carry; empty if nothing

    @classmethod
    def at(
        cls, dt: float, window: float = WINDOW, interval: float = INTERVAL, confirmation: float = 0
    ) -> WindowShape:
        """The window at sample interval ``dt`` [s].

        Args:
            dt: [s].
            window: t_W [s].
            interval: t_I [s].
            confirmation: t_c [s], for the note.
        """
        if not (dt > 0 and interval > 0 and window >= interval):
            raise ValueError(
                f"dt {dt}, t_I {interval}, t_W {window} s: expected 0 < dt, t_I <= t_W"
            )
        lag, count = max(1, round(interval / dt)), round(window / interval) + 1
        notes = []
        for name, asked, got in (
            ("t_I", interval, lag * dt),
            ("t_c", confirmation, max(1, round(confirmation / dt)) * dt),
        ):
            if asked and abs(got - asked) > 0.05 * asked:
                samples = round(got / dt)
                plural = "" if samples == 1 else "s"
                notes.append(f"{name} = {1e3 * asked:g} ms is {samples} sample{plural}")
        if notes:
            span = 1e3 * lag * dt * (count - 1)
            text = ", ".join(notes)
            notes = [f"at {1e3 * dt:g} ms a sample {text}; a window spans {span:g} ms"]
        return cls(lag, count, "".join(notes))

    def of(self, signal: Array, ends: ArrayLike) -> Array:
        """The windows that end at rows ``ends``, shape (N, m count): joint by joint, oldest first.

        Rows before the first count as the first.

        Args:
            signal: shape (T, m).
            ends: rows of the signal, shape (N,).
        """
        at = np.ascontiguousarray(ends, dtype=np.int64)
        out = np.empty((len(at), signal.shape[1] * self.count))
        _kernel.windows(signal, at, self.lag, self.count, out)
        return out

    def stream(self, columns: int) -> _kernel.Window:
        """The window that ends with the latest row of a signal of ``columns`` columns."""
        return _kernel.Window(columns, self.lag, self.count)


def median_distance(a: Array, b: Array, rng: np.random.Generator, pairs: int = 4000) -> float:
    """Median Euclidean distance between random rows of ``a`` and of ``b``."""
    one, two = rng.integers(len(a), size=pairs), rng.integers(len(b), size=pairs)
    return float(np.median(np.linalg.norm(a[one] - b[two], axis=1)))
