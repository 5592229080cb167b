"""The friction columns, and what calibration identifies."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.detectors import ArmModel, Estimator, FrictionModel, gravity_torque
from tauguard.detectors.calibration.calibrate import calibrate
from tauguard.detectors.estimation.estimator import Unknowns
from tauguard.models import Mismatch, cura6_drive
from tests.detectors.synthetic_arm import nominal


def column(model, q, index):
    return model.evaluate(q[:, None], np.zeros((len(q), 1)), np.zeros((len(q), 1)))[:, 0, index]


def test_a_bristle_is_the_exact_dahl_curve():
    model = FrictionModel(bristles=(1e-3,), stops=(), stribeck=(), slopes=(), play=0.0)
    q = np.concatenate([np.linspace(0, 5e-3, 50), np.linspace(5e-3, 3e-3, 7)])
    s = column(model, q, 2)
    np.testing.assert_allclose(s[:50], 1 - np.exp(-q[:50] / 1e-3), rtol=1e-12)
    np.testing.assert_allclose(s[-1], -1 + (1 + s[49]) * np.exp(-2.0), rtol=1e-12)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31), slow=st.integers(2, 6))
def test_presliding_is_bounded_and_does_not_depend_on_the_rate(seed, slow):
    model = FrictionModel(play=0.0)
    turns = np.cumsum(np.random.default_rng(seed).normal(size=30) * 2e-3)
    q = np.interp(np.arange(0, 29.5, 0.5), np.arange(30), turns)
    finer = np.interp(np.arange(0, 29.01, 0.5 / slow), np.arange(30), turns)
    for index in (2, 3, 4):
        coarse = column(model, q, index)
        assert (np.abs(coarse) <= 1 + 1e-12).all()
        fine = column(model, finer, index)
        np.testing.assert_allclose(fine[::slow], coarse[: len(fine[::slow])], atol=1e-9)


def test_jitter_within_the_play_keeps_the_friction_of_a_joint_at_rest():
    model = FrictionModel(stops=(), bristles=(1.5e-3,), play=5e-6)
    rest = 5e-3 + 4e-6 * np.sin(np.arange(5000))
    s = column(model, np.concatenate([np.linspace(0, 5e-3, 100), rest]), 2)
    assert s[-1] == pytest.approx(s[99], abs=0.01)


def test_published_numbers():
    model = FrictionModel.coulomb_viscous([10.0, 5.0], [2.0, 1.0], load=0.1)
    qd = np.full((300, 2), 0.5)
    q = np.cumsum(qd, axis=0) * 1e-3
    torque = model.torque(q, qd, np.full((300, 2), -20.0))
    np.testing.assert_allclose(torque[-1], [10 + 1 + 2, 5 + 0.5 + 2], rtol=1e-6)


def test_modelled_load_does_not_take_a_contact_for_friction():
    """A contact on a joint without gravity: the drive's torque hides some of it."""
    robot = nominal()  # gravity does nothing about its first, vertical axis
    t = np.arange(0, 6, 0.01)
    q = np.column_stack([0.5 * t, np.full_like(t, 0.3), np.full_like(t, -0.2)])
    qd = np.column_stack([np.full_like(t, 0.5), 0 * t, 0 * t])
    contact = np.where(t > 3, -4.0, 0.0)  # the drive gives 4 N m more
    seen = {}
    for modelled in (False, True):
        model = FrictionModel(bristles=(), stops=(1e-3,), stribeck=(), slopes=(), modelled=modelled)
        weights = np.zeros((3, model.columns))
        weights[:, 2], weights[:, 3] = (2.0, 0.5) if not modelled else (4.0, 0.5)
        model = dataclasses.replace(model, weights=weights)
        current = gravity_torque(robot, q)
        current[:, 0] += 4.0 - contact
        estimator = Estimator(ArmModel(robot, np.ones(3), model), 20.0, 0.01, Unknowns.none())
        seen[modelled] = estimator.run(t, q, qd, current).residual[[290, -1], 0]
    np.testing.assert_allclose(seen[True], [0, -4], atol=0.02)
    np.testing.assert_allclose(seen[False], [0, -2], atol=0.02)


def test_load_columns_are_those_that_grow_with_the_load():
    model = FrictionModel(loaded=(0.1, 0.3), saturation=True)
    q, qd = np.linspace(0, 1, 50)[:, None], np.full((50, 1), 0.4)
    tau = np.full((50, 1), 3.0)
    one, two = (model.evaluate(q, qd, tau, load)[..., :-1] for load in (tau, 2 * tau))
    grown = np.flatnonzero((np.abs(two - one) > 1e-9).any(axis=(0, 1)))
    np.testing.assert_array_equal(grown, np.arange(model.columns)[model.load_columns])
    np.testing.assert_array_equal(model.evaluate(q, qd, tau), model.evaluate(q, qd, tau, tau))


def test_calibration_finds_the_friction_and_the_payloads(training, robot, drive_gain):
    free = [trace for trace in training if not trace.truth.collisions]
    nominal = ArmModel(robot, drive_gain)
    found = calibrate(nominal, free)
    told = np.array([trace.truth.payload[-1] for trace in free])
    # the empty flange and link 6 share an offset: differences are what motion shows
    error = (found.payloads[:, 0] - told) - np.mean(found.payloads[:, 0] - told)
    assert np.abs(error).max() < 0.5
    arm = Mismatch(seed=11).perturb_drive(cura6_drive()).friction
    q = np.outer(np.linspace(0, 0.2, 400), np.ones(6))
    for speed in (0.2, 0.8):
        sliding = found.arm.friction.torque(q, np.full_like(q, speed), np.full_like(q, 20.0))
        truth = arm.coulomb * (1 + arm.load * 20) + arm.viscous * speed
        np.testing.assert_allclose(sliding[300:].mean(axis=0)[:3], truth[:3], rtol=0.25)
    for model, limit in ((nominal, None), (found.arm, 1.0)):
        left = [
            Estimator(model, unknowns=None if limit else Unknowns.none())
            .run(t.t, t.q, t.qd, t.current)
            .unexplained[3000:]
            for t in free
        ]
        rms = np.sqrt(np.mean(np.concatenate(left) ** 2, axis=0))
        if limit is None:
            before = rms
    assert (rms < 0.25 * before).all()
    assert (rms[:4] < 1.0).all()


def test_bad_models():
    with pytest.raises(ValueError, match=r"FrictionModel\.stops"):
        FrictionModel(stops=(0.0,))
    with pytest.raises(ValueError, match="at least one bristle or one stop"):
        FrictionModel(stops=(), bristles=())
    with pytest.raises(ValueError, match="identify them first"):
        FrictionModel().torque(np.zeros((5, 2)), np.zeros((5, 2)), np.zeros((5, 2)))
    with pytest.raises(ValueError, match="3 columns"):
        FrictionModel(weights=np.zeros((2, 3)))


def test_calibration_needs_motion(robot, drive_gain):
    with pytest.raises(ValueError, match="give 4 s of motion or more"):
        calibrate(ArmModel(robot, drive_gain), [])
