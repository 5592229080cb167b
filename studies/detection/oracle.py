"""The floor of delays: an oracle that is given the true external torque.

A collision's torque takes its time to rise, softly clamped ones most of all. The oracle alarms t_c
after the truth has passed a level: a detector that needs as much torque cannot do so before it, and
what is left above its delay is the detector's own. One that needs less torque can be sooner.
"""

from __future__ import annotations

import numpy as np

from studies.detection.thresholds import Operated
from tauguard.arrays import Array
from tauguard.detectors import ArmModel, CollisionAlarm, ScoreStream
from tauguard.traces import Trace

ORACLE = "oracle"
#: Levels of the true torque, the largest of joints 1-4 [N m].
LEVELS = (2.0, 4.0)


class Oracle:
    """A detector whose score is the largest |tau_ext| of joints 1-4 itself [N m]."""

    name, settle, dt = ORACLE, 0.0, 1e-3

    @property
    def arm(self) -> ArmModel:
        """It has none."""
        raise ValueError("the oracle knows the torque, not the arm")

    def scores(self, trace: Trace) -> Array:
        """The true torque, shape (T,); ``ValueError`` without truth."""
        if trace.truth is None:
            raise ValueError("the oracle needs a trace with truth")
        torque: Array = np.abs(trace.truth.tau_ext[:, :4]).max(axis=1)
        return torque

    def stream(self) -> ScoreStream:
        """No sample carries the truth: ``ValueError``."""
        raise ValueError("the oracle needs a trace with truth")


def oracle() -> Operated:
    """The oracle with a point for each of :data:`LEVELS`."""
    known = Oracle()
    return Operated(known, {at_level(level): CollisionAlarm(known, level) for level in LEVELS})


def at_level(level: float) -> str:
    """The name of the oracle's point at a level [N m]."""
    return f"{level:g} N m"
