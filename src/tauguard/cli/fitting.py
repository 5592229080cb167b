"""Training the detector on simulated recordings of the arm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tauguard.detectors import CollisionDetector
    from tauguard.traces import Trace


def trained(traces: Sequence[Trace], false_alarms_per_hour: float) -> CollisionDetector:
    """A detector that knows the nominal arm, fitted to ``traces``.

    Raises:
        ValueError: no nominal arm is attached to the recordings, or they cannot be trained on.
    """
    import numpy as np

    from tauguard.detectors import CollisionDetector, DetectorSettings, FrictionModel, RobotNumbers
    from tauguard.models import cura6_drive, pin_model

    arm = traces[0].attachments.get("arm.xml")
    if arm is None:
        raise ValueError("no arm.xml attached: train on recordings that tauguard simulated")
    settings = DetectorSettings(
        windows=1500, mined=200, false_alarms_per_hour=false_alarms_per_hour
    )
    robot = RobotNumbers.from_pin(pin_model(arm))
    drive = cura6_drive()
    # The ripple's frequencies follow from the gear; its heights and phases are identified.
    cycles = np.outer(drive.gear, drive.ripple.cycles) if drive.ripple else np.empty((0, 0))
    friction = FrictionModel(cycles=cycles)
    return CollisionDetector(settings).fit(traces, robot, drive.gain, friction=friction)
