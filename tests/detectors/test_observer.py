"""The observer: its terms against Pinocchio, batch against online, and a true tau_ext."""

import numpy as np
import pinocchio as pin
import pytest

from tauguard.detectors import (
    MomentumObserver,
    RobotNumbers,
    inverse_dynamics,
    momentum_terms,
    observe,
)
from tauguard.models import cura6, pin_model

CHAIN = """<mujoco><option gravity="1 -3 -9"/><worldbody>
<body pos="0.1 0 0.2" euler="0.3 0.2 0"><joint type="slide" axis="1 1 0" armature="0.1"/>
  <geom size="0.1" mass="2"/>
  <body pos="0 0.1 0.3" euler="0 0.4 0.1"><joint axis="0 1 1" pos="0.05 0.02 -0.1"/>
    <geom size="0.1 0.2 0.1" type="box" mass="1.5" pos="0.1 0 0.1"/>
    <body pos="0.2 0 0"><joint axis="1 0 0"/><geom size="0.05" mass="0.7" pos="0 0.1 0"/></body>
    <body pos="-0.2 0 0"><joint axis="0 0 1"/><geom size="0.05" mass="0.4" pos="0.1 0 0"/></body>
  </body></body></worldbody></mujoco>"""


@pytest.fixture(params=["cura6", "tree of hinges and slides"])
def model(request):
    return pin_model(cura6.arm_xml() if request.param == "cura6" else CHAIN)


def test_terms_against_pinocchio(model):
    robot, data = RobotNumbers.from_pin(model), model.createData()
    q, v, a = np.random.default_rng(1).uniform(-2, 2, (3, 300, model.nv))
    p, beta = momentum_terms(robot, q, v, threads=2)
    tau = inverse_dynamics(robot, q, v, a)
    for k in range(len(q)):
        pin.crba(model, data, q[k])
        mass = np.triu(data.M) + np.triu(data.M, 1).T
        coriolis = pin.computeCoriolisMatrix(model, data, q[k], v[k]).copy()
        gravity = pin.computeGeneralizedGravity(model, data, q[k])
        np.testing.assert_allclose(p[k], mass @ v[k], atol=1e-12)
        np.testing.assert_allclose(beta[k], coriolis.T @ v[k] - gravity, atol=1e-12)
        np.testing.assert_allclose(tau[k], pin.rnea(model, data, q[k], v[k], a[k]), atol=1e-12)


def test_threads_change_nothing():
    robot = RobotNumbers.from_pin(pin_model(cura6.arm_xml()))
    q, v = np.random.default_rng(1).uniform(-2, 2, (2, 5000, 6))
    one = momentum_terms(robot, q, v)
    for threads in (2, 5):
        np.testing.assert_array_equal(one, momentum_terms(robot, q, v, threads))


def test_batch_equals_online():
    robot = RobotNumbers.from_pin(pin_model(cura6.arm_xml()))
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.009, 0.012, 500))
    q, v, tau = rng.normal(size=(3, 500, 6))
    batch = observe(robot, t, q, v, tau, gain=20.0)
    online = MomentumObserver(robot, gain=20.0)
    steps = [
        online.step(t[k] - t[k - 1] if k else 1.0, q[k], v[k], tau[k]).copy() for k in range(500)
    ]
    np.testing.assert_array_equal(batch, steps)
    online.reset()
    np.testing.assert_array_equal(online.step(1.0, q[0], v[0], tau[0]), 0)


def falling(model: pin.Model, tau: np.ndarray, pushed: np.ndarray, dt: float, steps: int):
    """Exact motion under a held torque and push: Runge-Kutta with ten sub-steps a sample."""
    data = model.createData()
    q, v = np.array(cura6.HOME), np.zeros(model.nv)
    rows = [(q, v)]
    h = dt / 10

    def slope(q, v):
        return v, pin.aba(model, data, q, v, tau + pushed)

    for _ in range(steps):
        for _ in range(10):
            k1 = slope(q, v)
            k2 = slope(q + h / 2 * k1[0], v + h / 2 * k1[1])
            k3 = slope(q + h / 2 * k2[0], v + h / 2 * k2[1])
            k4 = slope(q + h * k3[0], v + h * k3[1])
            q = q + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
            v = v + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
        rows.append((q, v))
    return (np.array(column) for column in zip(*rows, strict=True))


@pytest.mark.parametrize("gain_dt", [0.01, 0.1, 1.0, 3.0])
def test_settles_on_the_true_external_torque(gain_dt, record_property):
    """Within 0.5 % of a 20 N m step for gain x dt from 0.01 to 3."""
    model = pin_model(cura6.arm_xml())
    robot, data = RobotNumbers.from_pin(model), model.createData()
    dt, steps = 1e-3, max(60, int(8 / gain_dt))
    hold = pin.computeGeneralizedGravity(model, data, np.array(cura6.HOME)).copy()
    pushed = np.array([20.0, -20, 10, 5, 3, 2])
    q, v = falling(model, hold, pushed, dt, steps)
    t = np.arange(steps + 1) * dt
    residual = observe(robot, t, q, v, np.tile(hold, (steps + 1, 1)), gain=gain_dt / dt)
    error = np.abs(residual[-1] - pushed).max()
    record_property("error", error)
    assert error < 0.005 * 20


def test_bad_input_is_named():
    robot = RobotNumbers.from_pin(pin_model(cura6.arm_xml()))
    good = np.zeros((5, 6))
    with pytest.raises(ValueError, match=r"q: shape \(5, 4\), expected \(T, 6\)"):
        observe(robot, np.arange(5.0), good[:, :4], good, good)
    bad = good.copy()
    bad[3, 2] = np.nan
    with pytest.raises(ValueError, match="tau: not finite in row 3"):
        observe(robot, np.arange(5.0), good, good, bad)
    with pytest.raises(ValueError, match="increasing"):
        observe(robot, np.zeros(5), good, good, good)
    with pytest.raises(ValueError, match="above 0"):
        MomentumObserver(robot, gain=-1)
