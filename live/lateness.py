"""How far answers are behind the robot: arrivals held against the robot's own clock."""

from __future__ import annotations

from tauguard.detectors.alarms.monitor import COLLISION, FAULT, Answer

#: No sample for so long, or samples this much behind the least late of them, are a fault [s].
BEHIND = 20e-3
#: Or so many sample intervals, where that is longer.
INTERVALS = 2.5
#: Two clocks may run apart by this share: each crystal is off by at most 5e-5 by its data sheet
#: (20 to 50 ppm with temperature and age). A delay that grows more slowly is not seen.
DRIFT = 1e-4


def most_behind(dt: float) -> float:
    """The silence or lateness that is a fault at this sample interval [s]."""
    return max(BEHIND, INTERVALS * dt)


class Lateness:
    """How late a sample comes, beside the sample that came least late.

    The two clocks' difference is not known; its least value so far stands for a sample that came at
    once. It may grow by ``DRIFT``, so clocks that run apart are not taken for lateness.
    """

    def __init__(self, dt: float) -> None:
        """Begin before the first sample; ``dt``: the sample interval [s]."""
        self.most = most_behind(dt)  #: later than this is a fault [s]
        self._least, self._arrived, self._time = float("inf"), 0.0, float("-inf")

    def judge(self, answer: Answer, t: float, arrived: float) -> Answer:
        """The monitor's answer, or a fault where its sample came too late.

        The time stamp of a sample that the monitor does not believe says nothing: one stale packet
        leaves the others as late as they were. A robot whose clock began anew is measured anew once
        the monitor has settled on it.

        Args:
            answer: the monitor's.
            t: the robot's time stamp [s].
            arrived: this machine's clock at the arrival [s].
        """
        if answer.reason:
            return answer
        late = self.step(t, arrived)
        return late_answer(answer, late) if late > self.most else answer

    def step(self, t: float, arrived: float) -> float:
        """Seconds that a sample with a believed time stamp is late; see :meth:`judge`.

        A time stamp that goes back is a clock that begins anew.
        """
        if t < self._time:
            self._least = float("inf")
        offset = arrived - t
        least = self._least + DRIFT * max(0.0, arrived - self._arrived)
        self._least, self._arrived, self._time = min(offset, least), arrived, t
        return offset - self._least


def late_answer(answer: Answer, late: float) -> Answer:
    """An answer that comes too late: no collision is not "free", as the robot is further on."""
    reason = f"late: the samples are {1e3 * late:.0f} ms behind the robot"
    return answer._replace(state=COLLISION if answer.alarm else FAULT, reason=reason)
