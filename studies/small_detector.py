"""A detector of the CURA6-like arm that trains in seconds: for studies that need one, not the best.

Its training is collision-free simulated motion, thinned to the rate at which it is asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tauguard.detectors import ArmModel, CollisionAlarm
    from tauguard.traces import Trace


def bare_arm() -> ArmModel:
    """What the arm's design says: masses and gains, nothing of friction or ripple."""
    from tauguard.detectors import ArmModel, RobotNumbers
    from tauguard.models import cura6, cura6_drive, pin_model

    return ArmModel(RobotNumbers.from_pin(pin_model(cura6.arm_xml())), np.array(cura6_drive().gain))


def thinned(trace: Trace, rate: float) -> Trace:
    """The samples that are left at ``rate`` [Hz], without truth."""
    from tauguard.traces import Trace

    rows = slice(None, None, round(1 / (trace.dt * rate)))
    signals = (trace.t[rows], trace.q[rows], trace.qd[rows], trace.current[rows])
    return Trace(trace.joint_names, *signals)


def trained(
    traces: Sequence[Trace], rate: float, per_hour: float, name: str = "moving-thresholds"
) -> CollisionAlarm:
    """A detector from collision-free motion.

    Args:
        traces: simulated.
        rate: samples a second that it is trained and asked at.
        per_hour: false alarms that it aims at.
        name: of a method.
    """
    from tauguard.detectors import make_detector, train

    own = [thinned(trace, rate) for trace in traces]
    return train(make_detector(name), own, bare_arm(), per_hour)
