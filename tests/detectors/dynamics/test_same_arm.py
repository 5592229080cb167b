"""Axes at q = 0 against Pinocchio, and what counts as another arm."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

from tauguard.detectors import RobotNumbers
from tauguard.detectors.dynamics.same_arm import arm_difference, joint_axes
from tauguard.models import cura6, pin_model
from tests.detectors.dynamics.test_robot import random_tree
from tests.detectors.synthetic_arm import XML


@pytest.mark.parametrize("seed", range(5))
def test_axes_are_pinocchios(seed):
    model = random_tree(seed)
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    places, axes = joint_axes(RobotNumbers.from_pin(model))
    for k in range(model.njoints - 1):
        np.testing.assert_allclose(places[k], data.oMi[k + 1].translation, atol=1e-12)
        linear, angular = np.split(data.J[:, k], 2)  # about the base's origin
        slides = np.linalg.norm(angular) < 0.5
        np.testing.assert_allclose(axes[k], linear if slides else angular, atol=1e-12)


def numbers(xml):
    return RobotNumbers.from_pin(pin_model(xml))


def test_another_frame_or_mass_is_no_other_arm():
    arm = numbers(XML)
    turn = pin.rpy.rpyToMatrix(0.3, -0.2, 0.5)
    rotation, axis = arm.rotation.copy(), arm.axis.copy()
    translation = arm.translation.copy()
    rotation[1], axis[1] = rotation[1] @ turn, turn.T @ axis[1]
    rotation[2], translation[2] = turn.T @ rotation[2], turn.T @ translation[2]
    other = dataclasses.replace(
        arm,
        joint_names=("x", "y", "z"),
        rotation=rotation,
        axis=axis,
        translation=translation,
        inertial=2 * arm.inertial,
    )
    assert arm_difference(other, arm) == ""


def placed(model, pose):
    """The arm on a base that is moved and turned."""
    for joint in range(1, model.njoints):
        if model.parents[joint] == 0:
            model.jointPlacements[joint] = pose * model.jointPlacements[joint]
    return RobotNumbers.from_pin(model)


@pytest.mark.parametrize("xml", [XML, cura6.arm_xml()], ids=["three joints", "cura6"])
def test_the_base_may_stand_elsewhere_and_turned_about_the_vertical_but_not_tilted(xml):
    shift = np.array([0.3, -2.0, 1.0])
    yaw = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 2.0), shift)
    assert arm_difference(placed(pin_model(xml), yaw), numbers(xml)) == ""
    tilt = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.0, 0.0), shift)
    assert "5.73 deg from" in arm_difference(placed(pin_model(xml), tilt), numbers(xml))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('body pos=".4 0 0"', 'body pos=".5 0 0"', "the axis of c is 100 mm from"),
        ('name="b" axis="0 1 0"', 'name="b" axis="1 0 0"', "the axis of b is 90 deg from"),
        ('name="b" axis="0 1 0"', 'name="b" axis="0 -1 0"', "the axis of b is 180 deg from"),
        ('name="c" axis="0 1 0"', 'name="c" type="slide" axis="0 1 0"', "c is a joint of another"),
    ],
)
def test_another_arm_is_named_by_its_joint(old, new, says):
    assert arm_difference(numbers(XML.replace(old, new)), numbers(XML)).startswith(says)


def test_another_number_of_joints():
    says = arm_difference(numbers(XML), numbers(cura6.arm_xml()))
    assert says == "3 joints, the detector's arm has 6"
