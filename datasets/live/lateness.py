"""How far answers are behind the robot: arrivals held against the robot's own clock."""

from __future__ import annotations

#: No sample for so long, or samples this much behind the least late of them, are a fault [s].
BEHIND = 20e-3
#: Or so many sample intervals, where that is longer.
INTERVALS = 2.5
#: Two clocks may run apart by this share.
DRIFT = 5e-4


def most_behind(dt: float) -> float:
    """The silence or lateness that is a fault at this sample interval [s]."""
    return max(BEHIND, INTERVALS * dt)


class Lateness:
    """How late a sample comes, beside the sample that came least late.

    The two clocks' difference is not known; its least value so far stands for a sample that came at
    once. It may grow by ``DRIFT``, so clocks that run apart are not taken for lateness.
    """

    def __init__(self) -> None:
        """Begin before the first sample."""
        self._least, self._arrived, self._time = float("inf"), 0.0, float("-inf")

    def step(self, t: float, arrived: float) -> float:
        """Seconds that this sample is late; 0 where its time stamp says nothing.

        Args:
            t: the robot's time stamp [s].
            arrived: this machine's clock at the arrival [s].
        """
        if not abs(t) < float("inf"):
            return 0.0
        if t < self._time:  # a clock that begins anew
            self._least = float("inf")
        offset = arrived - t
        least = self._least + DRIFT * max(0.0, arrived - self._arrived)
        self._least, self._arrived, self._time = min(offset, least), arrived, t
        return offset - self._least
