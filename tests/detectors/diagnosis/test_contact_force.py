from functools import cache

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.detectors.diagnosis.contact_force import (
    contact_belief,
    isolate,
    last_joint,
    link_poses,
    moments,
    point_jacobians,
)
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.models import cura6, link_surface, pin_model

XML = cura6.arm_xml()
ROBOT = RobotNumbers.from_pin(pin_model(XML))
MODEL = mujoco.MjModel.from_xml_string(XML)
HOME = np.array(cura6.HOME)

SLIDER = """<mujoco><worldbody><body pos="0 0 1"><joint type="slide" axis="1 0 0"/>
 <geom size="0.1"/><body pos="0 0 0.3" euler="0 50 0"><joint axis="0 1 0" pos="0 0 0.1"/>
 <geom size="0.1" pos="0 0 0.4"/></body></body></worldbody></mujoco>"""


@cache
def surface():
    return link_surface(XML, points=120)


def jacobian(model, q, joint, point):
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    found = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, found, None, point, int(model.jnt_bodyid[joint]))
    return found


def pushed(rng, link, size):
    """A push on a sampled point of ``link`` (0-based) and its exact torques."""
    q = HOME + rng.normal(scale=0.5, size=6)
    poses = link_poses(ROBOT, q)
    row = int(rng.choice(np.flatnonzero(surface().link == link)))
    point = poses.origin[link] + poses.rotation[link] @ surface().point[row]
    inward = -poses.rotation[link] @ surface().normal[row]
    aside = np.cross(inward, rng.normal(size=3))
    force = size * (inward + 0.2 * aside / np.linalg.norm(aside))
    return q, point, force, jacobian(MODEL, q, link, point).T @ force


@pytest.mark.parametrize("xml", [XML, SLIDER])
def test_jacobians_are_those_of_mujoco(xml):
    rng = np.random.default_rng(1)
    model = mujoco.MjModel.from_xml_string(xml)
    robot = RobotNumbers.from_pin(pin_model(xml))
    for _ in range(5):
        q = rng.normal(size=robot.joints)
        poses = link_poses(robot, q)
        for link in range(robot.joints):
            point = rng.normal(size=3)
            own = point_jacobians(robot, poses, np.array([link]), point[None])[0]
            np.testing.assert_allclose(own, jacobian(model, q, link, point), atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(3, 5), st.floats(20.0, 200.0))
def test_the_force_at_the_right_point_is_recovered(seed, link, size):
    q, point, force, tau = pushed(np.random.default_rng(seed), link, size)
    belief = contact_belief(ROBOT, surface(), q, tau, np.full(6, 1e-3))
    assert belief.probability.sum() == pytest.approx(1.0)
    assert belief.links(6).sum() == pytest.approx(1.0)
    right = np.linalg.norm(belief.point - point, axis=1) < 1e-9
    given_point = belief.force[right & (belief.link == link)][0]
    given_torque = jacobian(MODEL, q, link, point).T @ given_point
    np.testing.assert_allclose(given_torque, tau, atol=0.01)
    # Where the torques fix the force (six joints, away from singular poses), it is that force.
    moved = np.linalg.svd(jacobian(MODEL, q, link, point))[1]
    if moved[2] > 0.05:
        np.testing.assert_allclose(given_point, force, atol=0.1 * size)


def test_contacts_of_all_links_are_found_where_torques_tell_them_apart():
    rng = np.random.default_rng(2)
    noise = np.array([0.5, 0.5, 0.5, 0.15, 0.15, 0.15])
    right, angles, away, rule = [], [], [], []
    for k in range(50):
        link = 1 + k % 5
        q, point, force, tau = pushed(rng, link, 100.0)
        residual = tau + noise * rng.normal(size=6)
        belief = contact_belief(ROBOT, surface(), q, residual, noise)
        found = int(belief.links(6).argmax())
        guess, place = belief.on(found)
        right.append(found == link)
        rule.append(last_joint(residual, noise) == link + 1)
        angles.append(
            np.degrees(np.arccos(guess @ force / np.linalg.norm(guess) / 100 / 1.04**0.5))
        )
        away.append(np.linalg.norm(place - point))
    assert np.mean(right) >= 0.75
    assert np.mean(right) > np.mean(rule)
    assert np.median(angles) < 10
    assert np.median(away) < 0.05


def test_several_moments_say_more_than_one():
    rng = np.random.default_rng(3)
    noise = np.array([1.0, 1.0, 1.0, 0.3, 0.3, 0.3])
    once, often = [], []
    for k in range(20):
        link = 1 + k % 5
        q, _, _, tau = pushed(rng, link, 60.0)
        residual = tau + noise * rng.normal(size=(4, 6))
        several = isolate(ROBOT, surface(), np.tile(q, (4, 1)), residual, np.tile(noise, (4, 1)))
        once.append(contact_belief(ROBOT, surface(), q, residual[0], noise).links(6)[link])
        often.append(several.links(6)[link])
    assert np.mean(often) > np.mean(once)


def test_pushes_are_expected_and_pulls_are_not():
    poses = link_poses(ROBOT, HOME)
    row = int(np.flatnonzero(surface().link == 5)[0])
    point = poses.origin[5] + poses.rotation[5] @ surface().point[row]
    pull = 50.0 * poses.rotation[5] @ surface().normal[row]
    tau = jacobian(MODEL, HOME, 5, point).T @ pull
    belief = contact_belief(ROBOT, surface(), HOME, tau, np.full(6, 0.1))
    outward = np.einsum("kij,kj->ki", poses.rotation[surface().link], surface().normal)
    normal_part = np.einsum("ki,ki->k", belief.force, outward)
    assert (normal_part <= 1e-9).all()
    assert belief.probability[row] < 1e-6


def test_a_residual_that_says_nothing_leaves_every_link_as_likely_as_before():
    belief = contact_belief(ROBOT, surface(), HOME, np.ones(6), np.full(6, 1e9))
    np.testing.assert_allclose(belief.links(6), np.full(6, 1 / 6), atol=1e-6)


def test_the_usual_rule():
    noise = np.ones(6)
    assert last_joint(np.array([9.0, 5, 0, -7, 1, 3]), noise) == 4
    assert last_joint(np.array([900.0, 5, 0, -7, 1, 3]), noise) == 1
    assert last_joint(np.ones(6), noise) == 0


def test_moments_end_with_the_strongest_and_leave_out_the_weak():
    level = np.array([0.0, 1, 5, 9, 10, 8, 3, 1])
    rows = moments(level)
    assert rows[-1] == 4
    assert set(rows.tolist()) <= {2, 3, 4, 5}
    assert moments(np.zeros(3))[-1] == 0


def test_bad_input_is_named():
    noise = np.ones(6)
    with pytest.raises(ValueError, match=r"q: shape \(5,\)"):
        contact_belief(ROBOT, surface(), np.zeros(5), np.zeros(6), noise)
    with pytest.raises(ValueError, match="noise above 0"):
        contact_belief(ROBOT, surface(), HOME, np.zeros(6), np.zeros(6))
    with pytest.raises(ValueError, match="finite"):
        contact_belief(ROBOT, surface(), HOME, np.full(6, np.nan), noise)
    with pytest.raises(ValueError, match="moments"):
        isolate(ROBOT, surface(), np.zeros((0, 6)), np.zeros((0, 6)), np.zeros((0, 6)))
    two = RobotNumbers.from_pin(pin_model(SLIDER))
    with pytest.raises(ValueError, match="surface has link 6, the robot 2 joints"):
        contact_belief(two, surface(), np.zeros(2), np.zeros(2), np.ones(2))
