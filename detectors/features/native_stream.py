"""A stream of scores whose every step is one native call."""

from __future__ import annotations

from tauguard.arrays import Array
from tauguard.detectors import _observer


class NativeStream:
    """The scores of one recording as its samples come in.

    Attributes:
        native: what gives them.
    """

    def __init__(self, native: _observer.Scores, dt: float) -> None:
        """Take the native stream and the interval of steps that do not say theirs [s]."""
        self.native, self._dt = native, dt

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> float:
        """The score of this sample.

        Args:
            q: [rad], float64, shape (n,).
            qd: [rad/s], shape (n,).
            current: [A], shape (n,).
            dt: time since the last sample [s] (default: the constructor's).

        Raises:
            ValueError: wrong shapes or numbers that are not finite; the state is as before.
        """
        try:
            return self.native.step(q, qd, current, self._dt if dt is None else dt)
        except TypeError:
            raise ValueError(
                f"q, qd, current: expected float64 arrays of shape ({self.native.joints},)"
            ) from None
