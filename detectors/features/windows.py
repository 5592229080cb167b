"""Windows of the scaled residual: what a detector looks at.

The dissertation's window is rows 1-4 of the observer output, t_W = 80 ms long, sampled every
t_I = 8 ms: 11 samples each, 44 numbers. Scaling decides whether the SVR works: raw N m residuals
have a median distance near 100, which makes the matrix of a kernel as long as the dissertation's
sigma = 3 almost diagonal. So each joint's residual is divided by its envelope (what free motion
leaves of it at this speed and acceleration), compressed by asinh (a hard blow must not leave the
region that training has seen) and multiplied by one factor that brings the median distance between
windows of collisions and of free motion to ``distance``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls

from tauguard.detectors import _kernel

Array = NDArray[np.float64]

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


@dataclass(frozen=True, eq=False)
class Envelope:
    """What free motion leaves of the residual: per joint a + b |qd_j| + c sum |qd| + d sum |qdd|.

    The sums run over all joints; the acceleration is the estimator's.
    """

    weights: Array  #: shape (n, 4), not negative [N m per unit]

    @classmethod
    def fit(cls, left: Array, qd: Array, acceleration: Array) -> Envelope:
        """Non-negative least squares of ``|left|``, scaled to its standard deviation.

        Args:
            left: residual of free motion [N m], shape (T, n).
            qd: [rad/s], shape (T, n).
            acceleration: [rad/s^2], shape (T, n).
        """
        columns = cls._columns(qd, acceleration)
        weights = np.zeros((left.shape[1], 4))
        for j in range(left.shape[1]):
            weights[j] = nnls(columns[:, j], np.abs(left[:, j]))[0]
            weights[j, 0] = max(weights[j, 0], 1e-3 * float(np.abs(left[:, j]).mean()), 1e-9)
        return cls(weights * np.sqrt(np.pi / 2))

    @classmethod
    def constant(cls, scale: ArrayLike) -> Envelope:
        """The same at every speed, shape (n,) [N m]."""
        level = np.asarray(scale, dtype=np.float64)
        return cls(np.column_stack([level, np.zeros((len(level), 3))]))

    def at_least(self, scale: ArrayLike) -> Envelope:
        """At rest no less than ``scale``, shape (n,) [N m]; what motion adds is as before."""
        weights = self.weights.copy()
        weights[:, 0] = np.maximum(weights[:, 0], scale)
        return Envelope(weights)

    @staticmethod
    def _columns(qd: Array, acceleration: Array) -> Array:
        speed, total = np.abs(qd), np.abs(acceleration).sum(axis=-1, keepdims=True)
        return np.stack(
            [
                np.ones_like(qd),
                speed,
                np.broadcast_to(speed.sum(axis=-1, keepdims=True), qd.shape),
                np.broadcast_to(total, qd.shape),
            ],
            axis=-1,
        )

    def scale(self, qd: Array, acceleration: Array) -> Array:
        """The envelope [N m] at every sample, shape (..., n)."""
        w = self.weights
        speed = np.abs(qd)
        total = speed.sum(axis=-1, keepdims=True)
        shaken = np.abs(acceleration).sum(axis=-1, keepdims=True)
        value: Array = w[:, 0] + w[:, 1] * speed + w[:, 2] * total + w[:, 3] * shaken
        return value


@dataclass(frozen=True, eq=False)
class Features:
    """From residuals to windows."""

    joints: tuple[int, ...]  #: 0-based, those whose residuals feed the windows
    shape: WindowShape
    envelope: Envelope | None  #: None: raw N m
    factor: float = 1.0
    units: float = 5.0  #: envelopes that count one before the compression
    compress: bool = True
    notes: tuple[str, ...] = field(default=())

    def signal(self, left: Array, qd: Array, acceleration: Array) -> Array:
        """The scaled residual of the chosen joints, shape (..., len(joints))."""
        chosen = list(self.joints)
        if self.envelope is None:
            return np.ascontiguousarray(left[..., chosen] * self.factor)
        ratio = (left / (self.units * self.envelope.scale(qd, acceleration)))[..., chosen]
        return np.ascontiguousarray(self.factor * (np.arcsinh(ratio) if self.compress else ratio))

    @property
    def size(self) -> int:
        """Numbers of a window."""
        return len(self.joints) * self.shape.count

    def sliding(self, kernel: _kernel.KernelSum) -> _kernel.Sliding:
        """:meth:`signal`, window and ``kernel`` sample by sample, without allocation."""
        weights = self.envelope.weights if self.envelope else np.empty((0, 4))
        joints, shape = np.array(self.joints, dtype=np.int64), self.shape
        return _kernel.Sliding(
            kernel,
            joints,
            np.ascontiguousarray(weights),
            self.units,
            self.factor,
            self.compress,
            shape.lag,
            shape.count,
        )

    def windows(self, signal: Array, ends: ArrayLike) -> Array:
        """The windows that end at rows ``ends``, shape (N, size): joint by joint, oldest first.

        Rows before the first count as the first.
        """
        at = np.ascontiguousarray(ends, dtype=np.int64)
        out = np.empty((len(at), self.size))
        _kernel.windows(signal, at, self.shape.lag, self.shape.count, out)
        return out


def median_distance(a: Array, b: Array, rng: np.random.Generator, pairs: int = 4000) -> float:
    """Median Euclidean distance between random rows of ``a`` and of ``b``."""
    one, two = rng.integers(len(a), size=pairs), rng.integers(len(b), size=pairs)
    return float(np.median(np.linalg.norm(a[one] - b[two], axis=1)))
