"""Free, collision or fault: a detector on samples that cannot always be believed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.detector import same_rate
from tauguard.detectors.faults.inputs import SPAN, FaultCheck, UsualInput
from tauguard.detectors.faults.torques import TorqueCheck
from tauguard.detectors.thresholds.alarm import AlarmStream, CollisionAlarm

FREE, COLLISION, FAULT = "free", "collision", "fault"
#: So many samples in a row that are missing or faulty are interpolated, or as many as last SPAN;
#: after more the detector begins anew.
BRIDGED = 2
#: After a bridged fault nothing is judged until its samples have left the detector's window [s].
WINDOW = 0.1


@dataclass(frozen=True, slots=True)
class Answer:
    """What is thought of the robot at one sample."""

    state: str  #: "free", "collision" or "fault"
    alarm: bool  #: a collision's alarm is up; during a fault: it was up when the fault began
    score: float  #: of the detector, the last one known
    reason: str  #: what is wrong with the input; empty without a fault


class Monitor:
    """A detector that says so when it cannot see.

    A sample with a fault never reaches the detector. While faults last, and afterwards until the
    detector has settled again, the state is ``fault``. A collision whose alarm was up before the
    fault stays a collision. An alarm that came within 20 ms of the fault is the fault's own.

    Torques that cannot be this arm's are a fault as well; as a hard contact looks the same for half
    a second, the detector goes on, and an alarm that is up stays a collision with that reason.
    """

    def __init__(self, alarm: CollisionAlarm, usual: UsualInput) -> None:
        """Begin before the first sample."""
        self._alarm, self._usual, self._check = alarm, usual, FaultCheck(usual)
        self._dt, self._settle = usual.dt, alarm.settle
        self._stream: AlarmStream = alarm.stream()
        self._torques = TorqueCheck(alarm.detector.arm, usual.dt, usual.ratios)
        self._last: tuple[Array, Array, Array] | None = None
        self._time = -np.inf
        self._ready = -np.inf  # from when on the detector is believed
        self._raised = np.inf  # when the alarm went up
        self._bad = 0  # faulty samples in a row
        self._reason = ""
        self._answer = Answer(FREE, False, 0.0, "")

    @property
    def settled(self) -> bool:
        """Whether the detector can raise an alarm yet."""
        return self._time >= self._ready

    def step(self, t: float, q: Array, qd: Array, current: Array) -> Answer:
        """What to think at this sample.

        Args:
            t: its time stamp [s].
            q: [rad], float64, shape (n,).
            qd: [rad/s], shape (n,).
            current: [A], shape (n,).

        Raises:
            ValueError: another number of joints.
        """
        reason = self._check.step(t, q, qd, current)
        self._answer = self._fault(t, reason) if reason else self._sound(t, q, qd, current)
        return self._answer

    def _fault(self, t: float, reason: str) -> Answer:
        """A sample that is not believed."""
        self._bad += 1
        self._reason = reason
        before = self._answer
        held = before.alarm and self._time - self._raised > SPAN
        return Answer(COLLISION if held else FAULT, held, before.score, reason)

    def _sound(self, t: float, q: Array, qd: Array, current: Array) -> Answer:
        """A sample that is believed, perhaps the first after a fault."""
        sample = (q.copy(), qd.copy(), current.copy())
        missing = self._bridge(t, sample)
        passed, self._last, self._time = t - self._time, sample, t
        usual = missing == 0 and same_rate(passed, self._dt)
        interval = passed if usual else None
        up = self._stream.step(q, qd, current, interval)
        score, torques = self._stream.score, self._torques.step(q, qd, current, interval)
        if t < self._ready and self._reason:
            held = self._answer.alarm
            return Answer(
                COLLISION if held else FAULT, held, score, f"settling again after {self._reason}"
            )
        self._reason = ""
        self._raised = min(self._raised, t) if up else np.inf
        return Answer(COLLISION if up else FAULT if torques else FREE, up, score, torques)

    def _bridge(self, t: float, sample: tuple[Array, Array, Array]) -> int:
        """Interpolate the samples that are missing before this one, or begin anew; their number."""
        if self._last is None:
            self._ready, self._bad = t + self._settle, 0
            return 0
        missing = max(0, round((t - self._time) / self._dt) - 1)  # a packet sent twice misses none
        if t < self._time or missing > max(BRIDGED, SPAN / self._dt):
            self._stream = self._alarm.stream()
            self._torques = TorqueCheck(self._alarm.detector.arm, self._dt, self._usual.ratios)
            self._ready = t + self._settle
        else:
            for k in range(1, missing + 1):
                share = k / (missing + 1)
                q, qd, current = (
                    a + share * (b - a) for a, b in zip(self._last, sample, strict=True)
                )
                self._stream.step(q, qd, current)
                self._torques.step(q, qd, current)
            if self._bad:
                self._ready = max(self._ready, t + WINDOW)
        self._bad = 0
        return missing
