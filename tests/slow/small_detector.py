"""A detector of the CURA6-like arm that trains in seconds, for tests that need any detector."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tauguard.detectors import ArmModel, CollisionAlarm
    from tauguard.traces import Trace


def bare_arm() -> ArmModel:
    """The arm model of the design: masses and gains, without friction or ripple."""
    from tauguard.detectors import ArmModel, RobotNumbers
    from tauguard.models import cura6, cura6_drive, pin_model

    return ArmModel(RobotNumbers.from_pin(pin_model(cura6.arm_xml())), np.array(cura6_drive().gain))


def trained(traces: Sequence[Trace], rate: float, per_hour: float, name: str) -> CollisionAlarm:
    """Train the method ``name`` on collision-free motion at ``rate`` [Hz]."""
    from tauguard.detectors import make_detector
    from tauguard.detectors.alarms.training import train
    from tauguard.traces import Trace

    thinned = []
    for trace in traces:
        rows = slice(None, None, round(1 / (trace.dt * rate)))
        signals = (trace.t[rows], trace.q[rows], trace.qd[rows], trace.current[rows])
        thinned.append(Trace(trace.joint_names, *signals))
    return train(make_detector(name), thinned, bare_arm(), per_hour)
