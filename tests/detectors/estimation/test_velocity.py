"""Fused velocities against signals whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from tauguard.detectors import ArmModel, Estimator, RobotNumbers
from tauguard.detectors.estimation.estimator import Unknowns
from tauguard.detectors.estimation.velocity import SensorNoise
from tauguard.traces import Trace

DT = 1e-3
NOISE = SensorNoise(np.array([6e-7]), np.array([5e-4]))


def fused(q, qd, gains, dt=DT):
    """The textbook filter in Python: predict by dt, correct by both innovations."""
    g = np.reshape(gains, (3, 2))
    x = np.array([q[0], qd[0], 0.0])
    move = np.array([[1, dt, dt * dt / 2], [0, 1, dt], [0, 0, 1.0]])
    out = [qd[0]]
    for k in range(1, len(q)):
        x = move @ x
        x = x + g @ np.array([q[k] - x[0], qd[k] - x[1]])
        out.append(x[1])
    return np.array(out)


def test_fusion_halves_the_noise_and_keeps_up_with_an_acceleration():
    rng = np.random.default_rng(0)
    t = np.arange(4000) * DT
    truth = 0.8 * np.sin(3 * t)
    q = -0.8 / 3 * np.cos(3 * t) + rng.normal(size=t.size) * 6e-7
    qd = truth + rng.normal(size=t.size) * 5e-4
    error = (fused(q, qd, NOISE.fusion_gains(DT)) - truth)[200:]
    assert error.std() < 0.6 * 5e-4
    assert abs(error.mean()) < 2e-5
    ramp = fused(0.5 * 4.0 * t**2, 4.0 * t, NOISE.fusion_gains(DT))
    np.testing.assert_allclose(ramp[300:], 4.0 * t[300:], atol=1e-6)


def test_the_filter_is_stable_at_any_rate():
    for dt in (2e-4, 1e-3, 4e-3, 4e-2):
        gains = np.reshape(NOISE.fusion_gains(dt), (3, 2))
        move = np.array([[1, dt, dt * dt / 2], [0, 1, dt], [0, 0, 1.0]])
        step = (np.eye(3) - gains @ np.eye(2, 3)) @ move
        assert np.abs(np.linalg.eigvals(step)).max() < 1


def test_noise_is_measured_in_smooth_motion():
    rng = np.random.default_rng(1)
    t = np.arange(6000) * DT
    q = np.outer(np.sin(2 * t), [1.0, 0.5]) + rng.normal(size=(t.size, 2)) * [1e-6, 2e-6]
    qd = np.outer(2 * np.cos(2 * t), [1.0, 0.5]) + rng.normal(size=(t.size, 2)) * [5e-4, 1e-3]
    qd[1000:1010] += 3.0  # a blow counts little
    trace = Trace(("a", "b"), t, q, qd, np.zeros_like(q))
    found = SensorNoise.measured([trace])
    np.testing.assert_allclose(found.position, [1e-6, 2e-6], rtol=0.1)
    np.testing.assert_allclose(found.velocity, [5e-4, 1e-3], rtol=0.1)


@pytest.fixture(scope="module")
def pendulum():
    import pinocchio

    model = pinocchio.Model()
    joint = model.addJoint(0, pinocchio.JointModelRZ(), pinocchio.SE3.Identity(), "j")
    body = pinocchio.Inertia(3.0, np.array([0.2, 0, 0]), np.eye(3) * 0.1)
    model.appendBodyToJoint(joint, body, pinocchio.SE3.Identity())
    return RobotNumbers.from_pin(model)


def test_the_estimator_uses_it_online_as_in_batch(pendulum):
    rng = np.random.default_rng(2)
    t = np.arange(1500) * DT
    q = (np.sin(2 * t) + rng.normal(size=t.size) * 6e-7)[:, None]
    qd = (2 * np.cos(2 * t) + rng.normal(size=t.size) * 5e-4)[:, None]
    current = (-4 * np.sin(2 * t) * 0.22)[:, None]
    plain = Estimator(ArmModel(pendulum, np.ones(1)), 200.0, DT)
    fusing = Estimator(ArmModel(pendulum, np.ones(1), sensors=NOISE), 200.0, DT)
    batch = fusing.run(t, q, qd, current)
    noisy = plain.run(t, q, qd, current)
    out, rows = np.zeros((6, 1)), []
    fusing.reset()
    for k in range(len(t)):
        fusing.step(q[k], qd[k], current[k], out, DT if k == 0 else t[k] - t[k - 1])
        rows.append(out[1].copy())
    np.testing.assert_array_equal(np.array(rows), batch.unexplained)
    rough = [np.diff(e.residual[300:, 0]).std() for e in (batch, noisy)]
    assert rough[0] < 0.6 * rough[1]


@pytest.mark.parametrize("dt", [1 / 23.8, 1e-2, 4e-3])
def test_a_slow_log_of_instants_has_no_lag_of_its_torques(pendulum, dt):
    t = np.arange(200) * dt
    q, qd, torque = np.sin(2 * t), 2 * np.cos(2 * t), -4 * np.sin(2 * t) * 0.22
    signals = (t, *(x[:, None] for x in (q, qd, torque)))
    exact, held = (
        Estimator(ArmModel(pendulum, np.ones(1)), 200.0, dt, Unknowns.none(), sampled=sampled)
        .run(*signals)
        .residual
        for sampled in (True, False)
    )
    # Of the trapezoid's rule, dt^2 / 12 |d^2 torque / dt^2|; the residual is a mean of such errors.
    assert np.abs(exact).max() <= dt**2 / 12 * 16 * 0.22 * 1.001
    # Half an interval of lag times |d torque / dt|, reached four fifths of it.
    assert np.abs(held).max() > 0.8 * dt / 2 * 8 * 0.22


def test_what_cannot_be_noise_is_refused(pendulum):
    with pytest.raises(ValueError, match="position"):
        SensorNoise(np.zeros(1), np.ones(1))
    with pytest.raises(ValueError, match="velocity"):
        SensorNoise(np.ones(1), np.array([np.nan]))
    with pytest.raises(ValueError, match="sensors: noise of 2 joints"):
        ArmModel(pendulum, np.ones(1), sensors=SensorNoise(np.ones(2), np.ones(2)))
