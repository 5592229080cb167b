"""The nominal arm: what a detector believes before its training."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tauguard.detectors.dynamics.friction import FrictionModel
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.models import Drive, SceneSpec, compose, load_arm, pin_model
from tauguard.traces import Trace


def nominal_arm(traces: Sequence[Trace]) -> ArmModel:
    """What is believed of the recordings' arm before training.

    Raises:
        ValueError: no nominal arm is attached to the recordings.
    """
    arm = traces[0].attachments.get("arm.xml")
    if arm is None:
        raise ValueError("no arm.xml attached: train on recordings that tauguard simulated")
    meta = traces[0].meta
    name = meta.get("arm_source", meta.get("arm", "cura6"))
    return _believed(arm, load_arm(name).facts.drive)


def nominal_design(name: str = "cura6") -> ArmModel:
    """The same of an arm by its name.

    Raises:
        ValueError: no such arm.
    """
    scene = compose(SceneSpec(arm=name))
    return _believed(scene.arm_xml, scene.facts.drive)


def _believed(xml: str, drive: Drive) -> ArmModel:
    # The ripple's frequencies follow from the gear; its heights and phases are identified.
    cycles = np.outer(drive.gear, drive.ripple.cycles) if drive.ripple else np.empty((0, 0))
    robot = RobotNumbers.from_pin(pin_model(xml))
    columns = FrictionModel(cycles=cycles)
    weights = np.zeros((robot.joints, columns.columns))
    return ArmModel(robot, drive.gain, replace(columns, weights=weights))
