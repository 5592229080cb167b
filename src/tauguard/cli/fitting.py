"""Training the detector on simulated recordings of the arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tauguard.detectors import ArmModel, CollisionAlarm
    from tauguard.traces import Trace


def trained(
    traces: Sequence[Trace], false_alarms_per_hour: float, name: str = "srq-svr"
) -> CollisionAlarm:
    """A method of the registry that knows the nominal arm, fitted to ``traces``.

    Raises:
        ValueError: no such method, no nominal arm is attached to the recordings, or they cannot be
            trained on.
    """
    from tauguard.detectors import make_detector, train

    return train(make_detector(name), traces, nominal(traces), false_alarms_per_hour)


def nominal(traces: Sequence[Trace]) -> ArmModel:
    """What is believed of the recordings' arm before training.

    Raises:
        ValueError: no nominal arm is attached to the recordings.
    """
    import numpy as np

    from tauguard.detectors import ArmModel, FrictionModel, RobotNumbers
    from tauguard.models import load_arm, pin_model

    arm = traces[0].attachments.get("arm.xml")
    if arm is None:
        raise ValueError("no arm.xml attached: train on recordings that tauguard simulated")
    drive = load_arm(traces[0].meta.get("arm", "cura6")).facts.drive
    # The ripple's frequencies follow from the gear; its heights and phases are identified.
    cycles = np.outer(drive.gear, drive.ripple.cycles) if drive.ripple else np.empty((0, 0))
    robot = RobotNumbers.from_pin(pin_model(arm))
    columns = FrictionModel(cycles=cycles)
    weights = np.zeros((robot.joints, columns.columns))
    return ArmModel(robot, drive.gain, replace(columns, weights=weights))
