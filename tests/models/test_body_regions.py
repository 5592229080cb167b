"""The table of body regions: what it states, what it leaves open, and the two-mass formula."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tauguard.models import BODY_REGIONS, BodyProxy, body_region


def test_what_was_not_confirmed_is_marked():
    sure = {name for name, r in BODY_REGIONS.items() if "quasi_static_force" not in r.unconfirmed}
    assert sure == {"back", "chest", "abdomen", "pelvis", "upper_arm", "lower_arm", "hand"}
    stiff = {name for name, r in BODY_REGIONS.items() if "stiffness" not in r.unconfirmed}
    assert stiff == {"skull", "face", "neck", "back", "chest", "abdomen"}
    assert all("mass" in region.unconfirmed for region in BODY_REGIONS.values())


def test_blows_are_not_allowed_to_skull_and_face():
    assert body_region("chest").transient_force == 280
    for name in ("skull", "face"):
        assert body_region(name).transient_force == 0
        assert body_region(name).speed_limit(10) == 0


def test_speed_limit_by_hand():
    """Chest, 40 kg against a robot of 10 kg: mu = 8 kg, v = 280 / sqrt(8 x 25,000)."""
    assert body_region("chest").speed_limit(10) == pytest.approx(280 / math.sqrt(200_000))
    assert body_region("hand").speed_limit(math.inf) == pytest.approx(280 / math.sqrt(0.6 * 75_000))


@given(st.sampled_from(sorted(BODY_REGIONS)), st.floats(0.1, 500))
def test_at_the_speed_limit_the_peak_is_the_limit(name, mass):
    region = body_region(name)
    assert region.peak_force(region.speed_limit(mass), mass) == pytest.approx(
        region.transient_force
    )


def test_bad_regions_are_named():
    with pytest.raises(ValueError, match="'elbow': expected one of skull, face, neck"):
        body_region("elbow")
    with pytest.raises(ValueError, match="'elbow': expected one of"):
        BodyProxy("elbow", (0, 0, 1))
    with pytest.raises(ValueError, match="robot_mass 0 kg: expected above 0"):
        body_region("hand").speed_limit(0)
    with pytest.raises(ValueError, match="direction: zero"):
        BodyProxy("hand", (0, 0, 1), direction=(0, 0, 0))
    with pytest.raises(ValueError, match="position"):
        BodyProxy("hand", (0, 1))
