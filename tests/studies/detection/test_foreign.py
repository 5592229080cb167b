"""The detection study on other arms: what is asked of each is a share of its torque limits."""

import matplotlib.figure
import numpy as np
import pytest

from studies.detection import foreign, study
from studies.detection.pool import struck_pool
from studies.detection.threshold_laws import ArmOutcome
from tauguard.models import cura6_drive, load_arm
from tests.models.arms import random_arm


@pytest.fixture
def arm(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(random_arm(3))
    return path


def test_collisions_and_payloads_go_with_the_torque_limits(arm, tmp_path):
    under = foreign.conditions(str(arm), tmp_path)
    facts = load_arm(under.robot).facts
    share = facts.drive.torque_limit[:4].max() / cura6_drive().torque_limit.max()
    assert under.share == pytest.approx(min(1, share))
    assert facts.drive.ripple is not None
    (struck,) = struck_pool(1, 30.0, (5,), 1, [(16.0, 32.0)], conditions=under)
    (hit,) = [c for c, k in zip(struck.trace.truth.collisions, struck.kept, strict=True) if k]
    assert 16 * under.share <= hit.peak_tau < 32 * under.share
    assert np.linalg.norm(hit.force) >= 20 * under.share
    assert struck.trace.meta["arm"] == under.robot


def test_the_packages_arms_and_descriptions_are_taken_as_they_are(arm, tmp_path):
    assert foreign.conditions("cura6", tmp_path).robot == "cura6"
    own = tmp_path / "own.toml"
    own.write_text('file = "arm.xml"\n')
    assert foreign.conditions(str(own), tmp_path).robot == str(own)
    with pytest.raises(FileNotFoundError, match="no such file or name"):
        foreign.conditions("nobody", tmp_path)
    with pytest.raises(ValueError, match="one of them"):
        study.measure(True, 0, detector="cusum", robot="cura6")
    with pytest.raises(ValueError, match="two arms are called 'arm'; expected different"):
        study.measure(True, 0, robot=f"{arm}, other/arm.urdf")


def test_a_row_judges_the_harder_collisions_by_the_arms_share():
    under = foreign.Conditions(share=0.25)
    outcome = ArmOutcome(2, 0.5, (0.0, 9.0), ((5.0, 0.01), (3.9, None), (0.5, 0.02)))
    row = foreign._row("arms/one.urdf", under, "srq-svr", outcome)
    assert (row["robot"], row["sensitivity"]["n"], row["sensitivity"]["value"]) == ("one", 1, 1)
    assert row["all"]["n"] == 2
    assert row["alarms_per_hour"]["value"] == 4
    study.draw([row], matplotlib.figure.Figure())
    assert study.table([row]) == [row]
