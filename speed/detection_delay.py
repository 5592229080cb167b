"""When a detector notices a contact: the contact's torque is added to the program's currents."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors import CollisionAlarm
from tauguard.findings import ArgumentError, MismatchError
from tauguard.traces import Trace


@dataclass(frozen=True)
class DelayModel:
    """Delays of one detector along one recorded program.

    Each contact is judged by the detector itself on a stretch of the recording. The contact's joint
    torque -J^T n F(t) is taken up by the drives, so that J^T n F(t) over their gain is added to the
    recorded currents. Positions and velocities stay as recorded. An alarm that the recording raises
    without the contact does not count.
    """

    alarm: CollisionAlarm
    trace: Trace  #: the program, with currents, joints in the detector's order
    before: float = 1.5  #: time of the stretch before the contact [s]
    same_alarm: float = 0.1
    """Alarms with and without the contact that start within this time are the same one [s]."""

    def __post_init__(self) -> None:
        """Check that recording and detector belong together: ``MismatchError``."""
        joints = self.alarm.detector.arm.robot.joint_names
        if self.trace.joint_names != joints:
            raise MismatchError(
                f"the detector's joints are {', '.join(joints)}, the program's "
                f"{', '.join(self.trace.joint_names)}"
            )
        if not np.abs(self.trace.current).max() > 0:
            raise ArgumentError(
                "`detector=` needs the program's motor currents; give a log that has them, or "
                "the delay as `delay=`"
            )

    def delay(self, touch: float, lever: Array, times: Array, force: Array) -> float:
        """Time from the first touch to the alarm [s]; infinite if there is none.

        Args:
            touch: time of the first touch [s].
            lever: joint torque of 1 N at the contact, J^T n [m], shape (n,).
            times: times after the touch [s], shape (T,).
            force: contact force at these times [N], shape (T,).
        """
        trace, end = self.trace, touch + float(times[-1])
        first, last = np.searchsorted(trace.t, [touch - self.before, end])
        if last - first < 4:
            return float("inf")
        rows = slice(int(first), int(last))
        since = trace.t[rows] - touch
        pushed = np.interp(since, times, force, left=0.0)[:, None] * lever
        current = trace.current[rows] + pushed / self.alarm.detector.arm.drive_gain
        stretch = Trace(
            trace.joint_names,
            trace.t[rows],
            trace.q[rows],
            trace.qd[rows],
            current,
            meta=trace.meta,
        )
        up = self.alarm.sustained(stretch) > self.alarm.threshold
        rises = stretch.t[np.flatnonzero(up & ~np.concatenate([[False], up[:-1]]))]
        for start in rises[rises >= touch]:
            if not (np.abs(self._alone - start) < self.same_alarm).any():
                return float(start) - touch
        return float("inf")

    @cached_property
    def _alone(self) -> Array:
        """Starts of the alarms that the program raises without a contact [s]."""
        return np.array([alarm.start for alarm in self.alarm.detect(self.trace).alarms])
