"""The delay of answers: arrival times compared with the robot's own clock."""

from tauguard.detectors.alarms.monitor import COLLISION, FAULT, Answer

#: Limit of time without a sample, and of a sample's delay relative to the least delayed one [s].
BEHIND = 20e-3
#: The limit is at least this number of sample intervals.
INTERVALS = 2.5
#: Largest relative drift of two clocks, twice that of a crystal: 20 to 50 ppm by data sheets, with
#: temperature and age. A delay that grows more slowly is not detected.
DRIFT = 1e-4


def most_behind(dt: float) -> float:
    """Largest silence and delay that are no fault at the sample interval ``dt`` [s]."""
    return max(BEHIND, INTERVALS * dt)


class Lateness:
    """Delay of each sample relative to the least delayed sample so far.

    The offset between the robot's clock and this machine's is unknown. So the least difference of
    arrival and time stamp so far counts as no delay. It grows by ``DRIFT``, so that a drift of the
    clocks does not count as delay.
    """

    def __init__(self, dt: float) -> None:
        """Start before the first sample; ``dt``: the sample interval [s]."""
        self.most = most_behind(dt)  #: later than this is a fault [s]
        self._least, self._arrived, self._time = float("inf"), 0.0, float("-inf")

    def judge(self, answer: Answer, t: float, arrived: float) -> Answer:
        """Return the monitor's answer, or a fault if the sample came too late.

        Time stamps of samples that the monitor rejects are ignored, so one stale packet does not
        change the lateness of others. After a restart of the robot's clock the measurement restarts
        as soon as the monitor accepts samples.

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

    The state is a collision or a fault, never "free", because the robot has moved on.
    """
    reason = f"late: the samples are {1e3 * late:.0f} ms behind the robot"
    return answer._replace(state=COLLISION if answer.alarm else FAULT, reason=reason)
