"""The nominal arm: the model that a detector has before its training."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array
from tauguard.detectors.dynamics.friction import FrictionModel
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.estimation.observer import PLAIN_GAIN, observe
from tauguard.findings import ArgumentError
from tauguard.models import (
    Drive,
    Robot,
    SceneSpec,
    compiled,
    compose,
    cura6,
    cura6_drive,
    drive_of,
    pin_model,
)
from tauguard.traces import Trace

#: Speeds over which the friction columns for a robot file's ``frictionloss`` rise [rad/s]. MuJoCo's
#: constraint has no presliding; it slips at about 1e-3 rad/s times frictionloss [N m] divided by
#: inertia [kg m^2].
DRY = (0.003, 0.01)
#: Speed over which the Coulomb friction of :func:`residual` changes its sign [rad/s].
STANDSTILL = 0.05


def nominal_arm(traces: Sequence[Trace]) -> ArmModel:
    """The arm model before training, from the attachments of the first recording.

    Raises:
        ArgumentError: no nominal arm is attached.
    """
    if "arm.xml" not in traces[0].attachments:
        raise ArgumentError("no arm.xml attached: train on recordings that tauguard simulated")
    return _believed(*_attached(traces[0]))


def _attached(trace: Trace) -> tuple[str, Drive]:
    """MJCF and nominal drive of the arm of a trace."""
    attached = trace.attachments
    if "arm.xml" not in attached:
        raise ArgumentError("no arm.xml attached to the trace: name its robot, robot='ur5e'")
    name = trace.meta.get("arm", "cura6")
    if "drive.json" in attached:
        return attached["arm.xml"], drive_of(attached["drive.json"])
    if name in cura6.NAMES:
        return attached["arm.xml"], cura6_drive(name)
    raise ArgumentError(
        f"arm {name}: an earlier version of tauguard made these recordings without the numbers "
        "of the drive (drive.json); make them again"
    )


def nominal_design(name: str = "cura6") -> ArmModel:
    """The arm model before training of an arm given by its name.

    Raises:
        ArgumentError: no such arm.
    """
    scene = compose(SceneSpec(arm=name))
    return _believed(scene.arm_xml, scene.facts.drive)


def residual(trace: Trace, robot: str | Robot | None = None, gain: ArrayLike = PLAIN_GAIN) -> Array:
    """The momentum observer's estimate of the external torque along a trace [N m], shape (T, n).

    Args:
        trace: motion and currents of an arm.
        robot: a name, a file or a robot (default: the arm attached to the trace).
        gain: gain of the observer [1/s], a number or one per joint.

    Raises:
        ArgumentError: neither ``robot`` nor an attached arm, or a robot with other joints.
        FileNotFoundError: no such robot.
    """
    if robot is None:
        xml, drive = _attached(trace)
    else:
        scene = compose(SceneSpec(arm=robot), visuals=False)
        xml, drive = scene.arm_xml, scene.facts.nominal
    if len(drive.gain) != trace.q.shape[1]:
        raise ArgumentError(
            f"robot: {len(drive.gain)} joints, the trace has {trace.q.shape[1]}: "
            f"{', '.join(trace.joint_names)}"
        )
    torques = trace.meta.get("effort") == "torque"
    tau = trace.current if torques else drive.gain * trace.current
    if drive.friction is not None:
        level = drive.friction.coulomb * np.tanh(trace.qd / STANDSTILL)
        tau = tau - level - drive.friction.viscous * trace.qd
    numbers = RobotNumbers.from_pin(pin_model(compiled(xml)))
    return observe(numbers, trace.t, trace.q, trace.qd, tau, gain)


def _believed(xml: str, drive: Drive) -> ArmModel:
    # The ripple's frequencies follow from the gear; its amplitudes and phases are identified.
    cycles = np.outer(drive.gear, drive.ripple.cycles) if drive.ripple else np.empty((0, 0))
    model = compiled(xml)
    robot = RobotNumbers.from_pin(pin_model(model))
    columns = FrictionModel(cycles=cycles)
    if model.dof_frictionloss.any():
        columns = replace(columns, slopes=(*DRY, *columns.slopes))
    weights = np.zeros((robot.joints, columns.columns))
    return ArmModel(robot, drive.gain, replace(columns, weights=weights))
