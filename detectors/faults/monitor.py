"""Free, collision or fault: a detector on samples that cannot always be believed."""

from __future__ import annotations

from typing import NamedTuple

from tauguard.arrays import Array
from tauguard.detectors import _observer
from tauguard.detectors.faults.inputs import FAULTS, SPAN, FaultCheck, UsualInput, input_fault
from tauguard.detectors.faults.torques import TorqueCheck, torque_fault
from tauguard.detectors.thresholds.alarm import CollisionAlarm

FREE, COLLISION, FAULT = "free", "collision", "fault"
#: By the number that the native monitor answers.
STATES = (FREE, COLLISION, FAULT)
#: So many samples in a row that are missing or faulty are interpolated, or as many as last SPAN;
#: after more the detector begins anew.
BRIDGED = 2
#: After a bridged fault nothing is judged until its samples have left the detector's window [s].
WINDOW = 0.1


class Answer(NamedTuple):
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

    From a sample to its answer it is one native call that allocates nothing but the answer, unless
    the detector's own stream is Python's.
    """

    def __init__(self, alarm: CollisionAlarm, usual: UsualInput) -> None:
        """Begin before the first sample."""
        torques = TorqueCheck(alarm.detector.arm, usual.dt, usual.ratios)
        self._usual = usual
        self._native = _observer.Monitor(
            FaultCheck(usual).native,
            alarm.stream().native,
            torques.observer.native,
            torques.native,
            usual.dt,
            alarm.settle,
            SPAN,
            WINDOW,
            float(BRIDGED),
        )

    @property
    def settled(self) -> bool:
        """Whether the detector can raise an alarm yet."""
        return self._native.settled

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
        state, up, score, number, joint, value, settling = self._native.step(t, q, qd, current)
        reason = self._reason(number, joint, value, settling) if number else ""
        return Answer(STATES[state], up, score, reason)

    def _reason(self, number: int, joint: int, value: float, settling: bool) -> str:
        """What the native monitor says, in words."""
        if number not in FAULTS:
            return torque_fault(self._usual.joint_names, number, joint, value)
        fault = input_fault(self._usual, number, joint, value)
        return f"settling again after {fault}" if settling else fault
