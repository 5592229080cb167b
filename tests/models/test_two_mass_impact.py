"""Impacts beside the two-mass model: within 2 % at the default settings, and settings matter."""

import pytest

from oracles import two_mass_impact as impacts
from tauguard.models import BODY_REGIONS, impact_velocity, reflected_mass


def test_an_arm_without_drives_follows_its_reflected_mass():
    hit = impacts.aimed("chest", 5)
    at = (hit.scene, hit.q, hit.body, hit.point, hit.normal)
    qd = impact_velocity(*at, impacts.SPEED)
    limp = impacts.limp_impact(hit, qd).force
    predicted = BODY_REGIONS["chest"].peak_force(impacts.SPEED, reflected_mass(*at))
    assert limp == pytest.approx(predicted, rel=0.02)
    assert impacts.driven_peak(hit, qd) > 1.05 * limp  # what the drives add


def test_the_error_on_the_rail_falls_with_the_time_step():
    def error(step, contact):
        found = impacts.rail_impact("hand", step, "implicitfast", contact)
        return abs(found.force / impacts.predicted_force("hand") - 1)

    errors = [error(step, "direct") for step in (2.5e-4, 5e-4, 1e-3, 2e-3)]
    assert errors == sorted(errors)
    assert errors[2] < 0.02
    assert error(1e-3, "MuJoCo's default") > 0.2  # no body region is that hard
