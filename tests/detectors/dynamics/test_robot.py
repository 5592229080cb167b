"""Rigid-body terms against Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.detectors import RobotNumbers, gravity_torque, inverse_dynamics, mass_matrix
from tauguard.detectors.dynamics.robot import momentum_regressor, momentum_terms
from tauguard.models import cura6, pin_model


def random_tree(seed, joints=6, kinds=None):
    """A Pinocchio model: a random tree, rotated base, tilted gravity."""
    rng = np.random.default_rng(seed)
    pin.seed(seed)
    model = pin.Model()
    kinds = kinds or [
        lambda: pin.JointModelRX(),
        lambda: pin.JointModelRZ(),
        lambda: pin.JointModelPY(),
        lambda: pin.JointModelRevoluteUnaligned(*_unit(rng)),
        lambda: pin.JointModelPrismaticUnaligned(*_unit(rng)),
        lambda: pin.JointModelRUBY(),
    ]
    for i in range(joints):
        joint = kinds[rng.integers(len(kinds))]()
        # Pinocchio wants branches one after the other: a parent is the last joint or above it
        parent = i
        while parent and rng.random() < 0.3:
            parent = model.parents[parent]
        index = model.addJoint(parent, joint, pin.SE3.Random(), f"j{i}")
        model.appendBodyToJoint(index, pin.Inertia.Random(), pin.SE3.Random())
    model.armature = rng.uniform(0, 1, joints)
    model.gravity.linear = rng.normal(size=3) * 6
    return model


def _unit(rng):
    a = rng.normal(size=3)
    return a / np.linalg.norm(a)


def configuration(model, angles):
    """Pinocchio's q for plain joint positions (continuous joints take cosine and sine)."""
    q = []
    for joint, angle in zip(list(model.joints)[1:], angles, strict=True):
        q += [np.cos(angle), np.sin(angle)] if joint.nq == 2 else [angle]
    return np.array(q)


def pinocchio_terms(model, q, qd, qdd):
    data = model.createData()
    at = configuration(model, q)
    m = np.triu(pin.crba(model, data, at))
    m = m + np.triu(m, 1).T
    c = pin.computeCoriolisMatrix(model, data, at, qd)
    g = pin.computeGeneralizedGravity(model, data, at)
    return m, m @ qd, c.T @ qd - g, g, pin.rnea(model, data, at, qd, qdd)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**31 - 1), joints=st.integers(1, 9))
def test_terms_equal_pinocchio_on_random_trees(seed, joints):
    model = random_tree(seed, joints)
    robot = RobotNumbers.from_pin(model)
    rng = np.random.default_rng(seed)
    q, qd, qdd = rng.normal(size=(3, 5, joints)) * 2
    p, beta = momentum_terms(robot, q, qd)
    found = zip(
        mass_matrix(robot, q),
        p,
        beta,
        gravity_torque(robot, q),
        inverse_dynamics(robot, q, qd, qdd),
        strict=True,
    )
    for k, ours in enumerate(found):
        truth = pinocchio_terms(model, q[k], qd[k], qdd[k])
        scale = 1 + max(map(_peak, truth))  # terms cancel: the largest one sets the rounding
        for mine, theirs in zip(ours, truth, strict=True):
            np.testing.assert_allclose(mine, theirs, rtol=0, atol=5e-14 * scale)


def _peak(x):
    return np.abs(x).max()


@pytest.mark.parametrize("tilted", [False, True])
def test_terms_of_the_arm_are_those_of_pinocchio(tilted):
    model = pin_model(cura6.arm_xml())
    if tilted:
        base = pin.SE3(pin.utils.rotate("x", 0.3), np.ones(3))
        model.jointPlacements[1] = base * model.jointPlacements[1]
        model.gravity.linear = np.array([3.0, -2.0, -8.0])
    robot = RobotNumbers.from_pin(model)
    rng = np.random.default_rng(1)
    q, qd, qdd = rng.normal(size=(3, 1000, 6))
    p, beta = momentum_terms(robot, q, qd)
    tau = inverse_dynamics(robot, q, qd, qdd)
    worst = 0.0
    for k in range(1000):
        _, tp, tb, _, tt = pinocchio_terms(model, q[k], qd[k], qdd[k])
        worst = max(worst, _peak(p[k] - tp), _peak(beta[k] - tb), _peak(tau[k] - tt))
    assert worst < 5e-13  # of torques above 100 N m


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**31 - 1))
def test_momentum_is_linear_in_the_inertial_numbers(seed):
    robot = RobotNumbers.from_pin(random_tree(seed))
    rng = np.random.default_rng(seed)
    q, qd = rng.normal(size=(2, 20, 6))
    p, beta = momentum_terms(robot, q, qd)
    big_p, big_b = momentum_regressor(robot, q, qd)
    x = robot.inertial.ravel()
    np.testing.assert_allclose(big_p @ x + robot.armature * qd, p, atol=1e-11)
    np.testing.assert_allclose(big_b @ x, beta, atol=1e-11)
    one_p, one_b = momentum_regressor(robot, q, qd, link=4, count=4)
    np.testing.assert_array_equal(one_p, big_p[:, :, 40:44])
    np.testing.assert_array_equal(one_b, big_b[:, :, 40:44])


def test_same_bits_for_any_number_of_threads():
    robot = RobotNumbers.from_pin(random_tree(3))
    q, qd = np.random.default_rng(0).normal(size=(2, 3000, 6))
    one, many = (np.stack(momentum_terms(robot, q, qd, threads=k)) for k in (1, 4))
    assert one.tobytes() == many.tobytes()


def test_other_joints_are_refused_by_name():
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "floating")
    with pytest.raises(ValueError, match=r"joint floating: .* 6 degrees of freedom"):
        RobotNumbers.from_pin(model)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"q": np.zeros((5, 4))}, r"q: shape \(5, 4\), expected \(samples, 6\)"),
        ({"qd": np.zeros((4, 6))}, "numbers of samples differ: q 5, qd 4"),
        ({"q": np.where(np.arange(30).reshape(5, 6) == 13, np.nan, 0)}, "q: not finite in row 2"),
        ({"q": [["a"] * 6] * 5}, "q: not an array of numbers"),
    ],
)
def test_bad_arrays(change, message):
    robot = RobotNumbers.from_pin(random_tree(3))
    arguments = {"q": np.zeros((5, 6)), "qd": np.zeros((5, 6))} | change
    with pytest.raises(ValueError, match=message):
        momentum_terms(robot, **arguments)


def test_bad_numbers_name_the_field():
    robot = RobotNumbers.from_pin(random_tree(3))
    with pytest.raises(ValueError, match=r"RobotNumbers\.inertial: shape \(5, 10\)"):
        robot.with_inertial(np.zeros((5, 10)))
    with pytest.raises(ValueError, match=r"RobotNumbers\.inertial: every number must be finite"):
        robot.with_inertial(np.full((6, 10), np.inf))
