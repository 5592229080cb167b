"""Torques that cannot be those of the arm's motion, on motion computed by Pinocchio."""

import numpy as np
import pinocchio
import pytest

from tauguard.detectors import ArmModel, RobotNumbers
from tauguard.detectors.faults.inputs import TorqueCheck, torque_ratios
from tauguard.models import cura6, pin_model
from tauguard.traces.trace import Trace

DT = 2e-3


@pytest.fixture(scope="module")
def arm():
    robot = RobotNumbers.from_pin(pin_model(cura6.arm_xml()))
    return ArmModel(robot, np.full(6, 2.0), noise=np.full(6, 0.3))


def motion(seed, seconds=8.0):
    """A smooth motion and the currents that it takes, by inverse dynamics."""
    model = pin_model(cura6.arm_xml())
    data = model.createData()
    rng = np.random.default_rng(seed)
    t = np.arange(0, seconds, DT)
    w, phase, size = rng.uniform(0.5, 1.5, 6), rng.uniform(0, 6, 6), rng.uniform(0.3, 0.7, 6)
    q = size * np.sin(w * t[:, None] + phase)
    qd = size * w * np.cos(w * t[:, None] + phase)
    qdd = -(w**2) * q
    q = q + rng.uniform(-1, 1, 6)
    rows = zip(q, qd, qdd, strict=True)
    tau = np.array([pinocchio.rnea(model, data, *row) for row in rows])
    return Trace(tuple(f"joint{i}" for i in range(1, 7)), t, q, qd, tau / 2.0)


def said(arm, trace, current):
    check = TorqueCheck(arm, DT)
    return [check.step(q, qd, i) for q, qd, i in zip(trace.q, trace.qd, current, strict=True)]


@pytest.mark.parametrize("seed", range(6))
def test_the_right_torques_are_no_fault(arm, seed):
    trace = motion(seed)
    assert set(said(arm, trace, trace.current)) == {""}
    assert np.abs(torque_ratios([trace], arm) - 1).max() < 0.35


@pytest.mark.parametrize("seed", range(6))
def test_another_sign_is_named_within_a_second(arm, seed):
    trace = motion(seed)
    current = trace.current.copy()
    current[2000:] *= -1
    found = said(arm, trace, current)
    first = next(k for k, text in enumerate(found) if text)
    assert 2000 <= first <= 2500
    assert found[first].startswith("torque: ")


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("gain", [0.3, 2.0])
def test_another_gain_is_named_within_eight_seconds(arm, seed, gain):
    trace = motion(seed)
    found = said(arm, trace, gain * trace.current)
    first = next(k for k, text in enumerate(found) if text)
    assert 4.0 <= first * DT <= 8.0
    assert "of the torque that the model needs: another load, gain or arm, a sat" in found[first]
    assert found[first].endswith(", or a push of a second or more")


@pytest.mark.parametrize("seed", range(6))
def test_a_push_of_half_a_second_is_no_fault(arm, seed):
    # 40 N m at joint 2 against gravity or with it.
    trace = motion(seed)
    current = trace.current.copy()
    current[2000:2250, 1] += 20.0 * (-1) ** seed
    assert set(said(arm, trace, current)) == {""}
