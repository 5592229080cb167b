"""The force of a contact at the tool, from torques of which friction hides a part."""

from dataclasses import replace

import numpy as np
import pytest

from tauguard.detectors import ArmModel, FrictionModel
from tauguard.detectors.diagnosis.contact_force import link_poses, point_jacobians
from tauguard.detectors.diagnosis.diagnosis import SURE, Diagnoser
from tauguard.detectors.diagnosis.severity import CONTACT_FRACTION
from tauguard.detectors.diagnosis.tool_contact import tool_severity
from tests.detectors.diagnosis.test_severity import HOME, ROBOT, seen, surface

FRICTION = np.array([8.0, 6.0, 5.0, 2.0, 2.0, 2.0])
GEARED = ArmModel(ROBOT, np.ones(6), FrictionModel.coulomb_viscous(FRICTION, np.zeros(6)))
DIRECT = ArmModel(ROBOT, np.ones(6))


def pushed(force):
    """What a force [N] at the origin of the last link does at the joints [N m]."""
    poses = link_poses(ROBOT, HOME)
    place = point_jacobians(ROBOT, poses, np.array([5]), poses.origin[-1:])[0]
    return place.T @ force


@pytest.mark.parametrize("force", [(40.0, 0.0, 0.0), (0.0, -25.0, 10.0), (30.0, 30.0, -60.0)])
def test_without_friction_the_force_is_found(force):
    found, vector = tool_severity(DIRECT, seen(pushed(np.array(force)), 0.2, 0.005))
    size = np.linalg.norm(force)
    assert found.peak.value == pytest.approx(size, rel=0.12)
    assert found.peak.low < size < found.peak.high < 2 * found.peak.low
    np.testing.assert_allclose(vector, force, atol=0.1 * size)
    assert found.impulse.value == pytest.approx(size * 0.2 * 2 / np.pi, rel=0.15)


def test_intervals_hold_what_friction_hides():
    rng, held, wide = np.random.default_rng(4), 0, []
    for _ in range(60):
        force = rng.normal(size=3)
        force *= rng.uniform(15, 120) / np.linalg.norm(force)
        torque = pushed(force)
        hidden = rng.uniform(0, 1, 6) * FRICTION
        shown = np.sign(torque) * np.maximum(np.abs(torque) - hidden, 0)
        peak = tool_severity(GEARED, seen(shown, 0.3, 0.005))[0].peak
        held += peak.low <= np.linalg.norm(force) <= peak.high
        wide.append(peak.high / peak.low)
    assert held >= 45
    assert np.median(wide) < 6


def test_a_tool_of_unknown_length_is_allowed_for():
    rng, held, wide = np.random.default_rng(6), 0, []
    poses = link_poses(ROBOT, HOME)
    tip = surface().only([6])
    side = np.sign((tip.point @ ROBOT.axis[-1]).mean())
    end = np.max(side * (tip.point @ ROBOT.axis[-1]))
    for _ in range(40):
        place = poses.origin[-1] + side * (end + rng.uniform(0, 0.2)) * poses.axis[-1]
        jacobian = point_jacobians(ROBOT, poses, np.array([5]), place[None])[0]
        force = rng.normal(size=3)
        force *= rng.uniform(15, 120) / np.linalg.norm(force)
        peak = tool_severity(DIRECT, seen(jacobian.T @ force, 0.3, 0.005), tip)[0].peak
        held += peak.low <= np.linalg.norm(force) <= peak.high
        wide.append(peak.high / peak.low)
    assert held >= 35
    assert np.median(wide) < 2.5


def test_friction_of_a_joint_that_the_servo_drives_back_is_no_force():
    force = np.array([0.0, -60.0, 20.0])
    torque = pushed(force)
    window = seen(torque + np.sign(torque) * FRICTION, 0.3, 0.005)
    # Against the push, by three times the displacement over which friction turns around.
    moved = -3e-4 * np.sign(torque) * np.linspace(0, 1, len(window.t))[:, None]
    found = tool_severity(GEARED, window)[0].peak
    back = tool_severity(GEARED, replace(window, q=window.q + moved))[0].peak
    size = np.linalg.norm(force)
    assert abs(back.value / size - 1) < 0.6 * abs(found.value / size - 1)
    assert back.low < size < back.high


def test_a_residual_below_its_first_value_leaves_an_impulse_within_what_the_peak_allows():
    window = seen(np.zeros(6), 0.2, 0.005)
    t = window.t
    bump = np.sin(np.pi * np.clip((t - 0.15) / 0.02, 0, 1))
    size = np.where(t < 0, 20.0, 10.0) + 35 * bump
    torque = np.outer(size, pushed(np.array([1.0, 0.0, 0.0])))
    found = tool_severity(DIRECT, replace(window, residual=torque))[0]
    whole = found.peak.value * found.torque.seconds
    assert CONTACT_FRACTION * whole <= 1.001 * found.impulse.value <= whole
    assert 0.1 < found.impulse.value < 5.0  # that of the force is 3.9 N s


def test_a_diagnoser_that_is_told_the_tool_names_the_last_link():
    assert set(Diagnoser.of(DIRECT, surface(), at_tool=True).surface.link) == {5}
    assert 0.5 < SURE < 1
