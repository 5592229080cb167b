"""The nominal arm: what a detector believes before its training."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tauguard.detectors.dynamics.friction import FrictionModel
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.models import (
    Drive,
    SceneSpec,
    compiled,
    compose,
    cura6,
    cura6_drive,
    drive_of,
    pin_model,
)
from tauguard.traces import Trace

#: Slopes of a robot file's ``frictionloss`` [rad/s]: MuJoCo's constraint has no presliding, and
#: slips from some 1e-3 rad/s times that loss over the inertia [N m, kg m^2].
DRY = (0.003, 0.01)


def nominal_arm(traces: Sequence[Trace]) -> ArmModel:
    """What is believed of the recordings' arm before training.

    It comes from what is attached to them, never from a robot's file.

    Raises:
        ValueError: no nominal arm is attached to the recordings.
    """
    attached = traces[0].attachments
    if "arm.xml" not in attached:
        raise ValueError("no arm.xml attached: train on recordings that tauguard simulated")
    name = traces[0].meta.get("arm", "cura6")
    if "drive.json" in attached:
        drive = drive_of(attached["drive.json"])
    elif name in cura6.NAMES:
        drive = cura6_drive(name)
    else:
        raise ValueError(
            f"arm {name}: an earlier tauguard made these recordings, which did not keep the "
            "numbers of its drive (drive.json) with them; make them again"
        )
    return _believed(attached["arm.xml"], drive)


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
    model = compiled(xml)
    robot = RobotNumbers.from_pin(pin_model(model))
    columns = FrictionModel(cycles=cycles)
    if model.dof_frictionloss.any():
        columns = replace(columns, slopes=(*DRY, *columns.slopes))
    weights = np.zeros((robot.joints, columns.columns))
    return ArmModel(robot, drive.gain, replace(columns, weights=weights))
