"""The force of a contact at the tool, from torques of which friction hides a part."""

import numpy as np
import pytest

from tauguard.detectors import ArmModel, FrictionModel
from tauguard.detectors.diagnosis.contact_force import link_poses, point_jacobians
from tauguard.detectors.diagnosis.diagnosis import SURE, Diagnoser
from tauguard.detectors.diagnosis.tool_contact import tool_severity
from tests.detectors.diagnosis.test_severity import HOME, ROBOT, SURFACE, seen

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


def test_a_diagnoser_that_is_told_the_tool_names_the_last_link():
    assert set(Diagnoser.of(DIRECT, SURFACE, at_tool=True).surface.link) == {5}
    assert 0.5 < SURE < 1
