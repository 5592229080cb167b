"""What a calibration learned of friction is what the simulator then loses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.detectors import ArmModel, FrictionModel
from tauguard.detectors.calibration.arm_file import save_arm
from tauguard.detectors.calibration.identification import REAL_FRICTION
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.models import Robot, RobotDrive, load_arm
from tauguard.models.arm_drive import friction_rows
from tests.detectors.synthetic_arm import GAIN, XML, true_model

WIDTHS = {name: getattr(REAL_FRICTION, name) for name in
          ("bristles", "stops", "stribeck", "slopes", "loaded")}  # fmt: skip


def sliding(model, speed):
    """Friction of an identified model after a metre of motion, the mean of both directions."""
    q = speed * np.arange(0, 1 / speed, 0.002 / speed)[:, None]
    ends = [model.torque(s * q, 0 * q + s * speed, 0 * q, 0 * q)[-1] for s in (1, -1)]
    return 0.5 * (ends[0] - ends[1])


def simulated(rows, speed):
    slip = np.exp(-((speed / rows["stribeck_velocity"]) ** 2))
    rises = np.array(rows["slope"]) @ np.tanh(speed / np.array(rows["slope_velocity"]))
    coulomb, static, viscous = (np.array(rows[k]) for k in ("coulomb", "static", "viscous"))
    return coulomb + (static - coulomb) * slip + rises + viscous * speed


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(0, 3), min_size=12, max_size=12))
def test_sliding_friction_of_levels_that_rise_is_that_of_the_calibration(parts):
    weights = np.zeros((1, REAL_FRICTION.columns))
    weights[0, 1:6], weights[0, 8:13] = parts[:5], parts[5:10]
    weights[0, 2] += 0.5
    rows = friction_rows(WIDTHS | {"weights": weights.tolist()})
    model = FrictionModel(**WIDTHS, modelled=True, weights=weights)
    for speed in (0.02, 0.2, 1.0):
        level = sliding(model, speed)
        np.testing.assert_allclose(simulated(rows, speed), level, rtol=0.1)


@pytest.fixture
def file(tmp_path):
    text = XML.replace("<joint ", '<joint damping="3" frictionloss="1" ')
    (tmp_path / "arm.xml").write_text(text)
    friction = FrictionModel.coulomb_viscous(np.array([5.0, 4.0, 2.0]), np.array([3.0, 2.0, 1.0]))
    arm = ArmModel(RobotNumbers.from_pin(true_model()), GAIN, friction, np.full(3, 0.1))
    save_arm(arm, tmp_path / "arm.xml", tmp_path / "known.xml")
    return tmp_path / "known.xml"


def test_a_calibrated_file_brings_its_friction_in_place_of_the_files_own(file):
    facts = load_arm(str(file)).facts
    got = facts.nominal.friction
    np.testing.assert_allclose(got.viscous, [3, 2, 1], rtol=0.05)
    assert not facts.damping.any()
    assert not facts.friction_loss.any()
    assert "gains, rotors, friction" in facts.sources["drive"]
    assert "no losses" not in facts.sources["drive"]
    plain = load_arm(str(file.with_name("arm.xml"))).facts
    assert (plain.damping == 3).all()


def test_friction_that_is_stated_is_kept(file):
    stated = Robot(str(file), drive=RobotDrive(coulomb=7.0))
    facts = load_arm(stated).facts
    assert (facts.drive.friction.coulomb == 7).all()
    assert (facts.damping == 3).all()
    np.testing.assert_allclose(facts.drive.gain, GAIN)
    with_gain = Robot(str(file), drive=RobotDrive(gain=3.0))
    assert load_arm(with_gain).facts.drive.friction is None


def test_no_friction_at_rest_keeps_a_bristle_that_holds():
    weights = np.zeros((2, REAL_FRICTION.columns))
    weights[0, 10] = 2.0  # all of it comes with speed
    rows = friction_rows(WIDTHS | {"weights": weights.tolist()})
    assert min(rows["presliding"]) > 0
    assert min(rows["coulomb"]) > 0
