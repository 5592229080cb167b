"""The delay of answers: arrival times compared with the robot's own clock."""

from tauguard.detectors.alarms.monitor import COLLISION, FAULT, Answer

#: Longest time without a sample, and largest delay of a sample compared with the least delayed one;
#: beyond it is a fault [s].
BEHIND = 20e-3
#: The limit is at least this number of sample intervals.
INTERVALS = 2.5
#: Two clocks may drift apart at this rate: by its data sheet each crystal is off by at most 5e-5
#: (20 to 50 ppm with temperature and age). A delay that grows more slowly is not seen.
DRIFT = 1e-4


def most_behind(dt: float) -> float:
    """The silence or lateness that is a fault at this sample interval [s]."""
    return max(BEHIND, INTERVALS * dt)


class Lateness:
    """How late a sample is, compared with the least late sample so far.

    The difference of the two clocks is unknown, so its least value counts as no delay. This value
    may grow by ``DRIFT``, so that a drift of the clocks is not taken for lateness.
    """

    def __init__(self, dt: float) -> None:
        """Start before the first sample; ``dt``: the sample interval [s]."""
        self.most = most_behind(dt)  #: later than this is a fault [s]
        self._least, self._arrived, self._time = float("inf"), 0.0, float("-inf")

    def judge(self, answer: Answer, t: float, arrived: float) -> Answer:
        """Return the monitor's answer, or a fault if the sample came too late.

        Time stamps of samples that the monitor rejects are ignored, so one stale packet does not
        change the lateness of others. After a restart of the robot's clock the measurement restarts
        when the monitor has settled.

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
        """Lateness [s] of a sample with an accepted time stamp; see :meth:`judge`.

        If a time stamp decreases, the robot's clock was restarted and the measurement restarts too.
        """
        if t < self._time:
            self._least = float("inf")
        offset = arrived - t
        least = self._least + DRIFT * max(0.0, arrived - self._arrived)
        self._least, self._arrived, self._time = min(offset, least), arrived, t
        return offset - self._least


def late_answer(answer: Answer, late: float) -> Answer:
    """The answer to a late sample.

    Without a collision the state is not "free", because the robot has moved on.
    """
    reason = f"late: the samples are {1e3 * late:.0f} ms behind the robot"
    return answer._replace(state=COLLISION if answer.alarm else FAULT, reason=reason)
