"""The momentum observer: settled value, equality online and in batch, bad input."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.detectors import MomentumObserver, RobotNumbers, observe
from tauguard.models import cura6, pin_model


def arm():
    return pin_model(cura6.arm_xml())


def simulate(model, tau_of, tau_ext, dt, steps, fine=20, seed=0):
    """States at multiples of dt under held torques and a step of tau_ext, by fine RK4 steps."""
    data = model.createData()
    rng = np.random.default_rng(seed)
    q, qd = rng.uniform(-0.5, 0.5, model.nv), rng.uniform(-0.5, 0.5, model.nv)
    h = dt / fine
    rows = []

    def rate(q, qd, tau):
        return qd, pin.aba(model, data, q, qd, tau + tau_ext)

    for k in range(steps):
        tau = tau_of(k * dt, q, qd)
        rows.append((q, qd, tau))
        for _ in range(fine):
            k1 = rate(q, qd, tau)
            k2 = rate(q + h / 2 * k1[0], qd + h / 2 * k1[1], tau)
            k3 = rate(q + h / 2 * k2[0], qd + h / 2 * k2[1], tau)
            k4 = rate(q + h * k3[0], qd + h * k3[1], tau)
            q = q + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
            qd = qd + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    return (np.array(column) for column in zip(*rows, strict=True))


@pytest.mark.parametrize("gain_dt", [0.01, 0.1, 1.0, 1.9, 3.0])
def test_settled_residual_is_tau_ext(gain_dt):
    model, dt = arm(), 1e-3
    step = np.array([20.0, -15, 10, 5, -3, 2])
    data = model.createData()
    home = np.zeros(6)

    def control(t, q, qd):
        return 40 * (home - q) - 25 * qd + pin.rnea(model, data, q, 0 * q, 0 * q)

    settle = int(np.ceil(8 / gain_dt))
    q, qd, tau = simulate(model, control, step, dt, settle + 40, fine=4)
    residual = observe(RobotNumbers.from_pin(model), dt, q, qd, tau, gain_dt / dt)
    assert np.abs(qd).max() > 0.2  # it moves
    assert (np.abs(residual[settle:] - step) <= 0.005 * np.abs(step)).all()
    # before it settles it follows the first-order answer
    k = max(1, round(0.7 / gain_dt))
    np.testing.assert_allclose(residual[k], step * -np.expm1(-gain_dt * k), rtol=0.02)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**31 - 1), jitter=st.floats(0, 0.9), gain=st.floats(1, 3000))
def test_online_equals_batch_bitwise_with_jitter(seed, jitter, gain):
    robot = RobotNumbers.from_pin(arm())
    rng = np.random.default_rng(seed)
    q, qd, tau = rng.normal(size=(3, 60, 6))
    t = np.cumsum(1e-3 * (1 + jitter * rng.uniform(-1, 1, 60)))
    batch = observe(robot, t, q, qd, tau, gain)
    online = MomentumObserver(robot, gain)
    steps = [online.step(q[0], qd[0], tau[0])]
    steps += [online.step(q[k], qd[k], tau[k], t[k] - t[k - 1]) for k in range(1, 60)]
    assert np.array(steps).tobytes() == batch.tobytes()


def test_gains_may_differ_by_joint_and_reset_starts_again():
    robot = RobotNumbers.from_pin(arm())
    rng = np.random.default_rng(0)
    q, qd, tau = rng.normal(size=(3, 30, 6))
    gains = np.array([10.0, 20, 50, 100, 200, 400])
    batch = observe(robot, 2e-3, q, qd, tau, gains)
    for j, gain in enumerate(gains):
        np.testing.assert_array_equal(batch[:, j], observe(robot, 2e-3, q, qd, tau, gain)[:, j])
    online = MomentumObserver(robot, gains, dt=2e-3)
    for _ in range(2):
        online.reset(q[0], qd[0], tau[0])
        out = np.array([online.step(q[k], qd[k], tau[k]) for k in range(1, 30)])
        np.testing.assert_array_equal(out, batch[1:])


def test_standing_still_with_gravity_held_stays_at_zero():
    model = arm()
    robot = RobotNumbers.from_pin(model)
    q = np.array([0.3, -0.4, 0.5, 0.1, 0.2, 0.3])
    tau = pin.computeGeneralizedGravity(model, model.createData(), q)
    online = MomentumObserver(robot, 500.0)
    online.reset(q, 0 * q)
    for _ in range(10):
        np.testing.assert_allclose(online.step(q, 0 * q, tau), 0, atol=1e-12)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda o, z: o.step(z[:5], z, z), "one entry per joint"),
        (lambda o, z: o.step(z[None], z, z), r"float64 arrays of shape \(6,\)"),
        (lambda o, z: o.step(z + np.nan, z, z), "q: every entry must be finite"),
        (lambda o, z: o.step(z, z, z, -1.0), "dt: must be above 0"),
    ],
)
def test_bad_samples_leave_the_state_alone(call, message):
    robot = RobotNumbers.from_pin(arm())
    q, qd, tau = np.random.default_rng(0).normal(size=(3, 5, 6))
    good, bad = (MomentumObserver(robot) for _ in range(2))
    for k in range(5):
        expected = good.step(q[k], qd[k], tau[k])
        assert bad.step(q[k], qd[k], tau[k]).tobytes() == expected.tobytes()
        with pytest.raises(ValueError, match=message):
            call(bad, np.zeros(6))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gain": 0.0}, "gain: .* above 0"),
        ({"gain": [1.0, 2.0]}, r"gain: shape \(2,\), expected one number or \(6,\)"),
        ({"t": -1e-3}, "t: interval -0.001"),
        ({"t": [0, 1, 2, 2, 3]}, "t: not increasing at row 3"),
        ({"t": [0, 1, 2, np.nan, 4]}, "t: not increasing at row 3"),
        ({"tau": np.zeros((4, 6))}, "numbers of samples differ"),
    ],
)
def test_bad_input(change, message):
    z = np.zeros((5, 6))
    arguments = {"t": 1e-3, "q": z, "qd": z, "tau": z, "gain": 10.0} | change
    with pytest.raises(ValueError, match=message):
        observe(RobotNumbers.from_pin(arm()), **arguments)
