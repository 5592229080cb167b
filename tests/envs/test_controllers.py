"""Controllers in MuJoCo, whose dynamics they do not share."""

import mujoco
import numpy as np
import pytest

from oracles.tool_error import tool_error
from tauguard.envs import random_motion
from tauguard.envs.controllers import Admittance, ComputedTorque, GravityPD, OperationalSpace
from tauguard.envs.episodes.simulate import workspace
from tauguard.models import SceneSpec, compose, pin_model
from tests.models.arms import random_arm

DT = 1e-3
SCENE = compose(SceneSpec(labels=False))
ARM = pin_model(SCENE.arm_xml)


def simulate(law, steps, q=None):
    """Runs ``law(k, q, qd) -> tau`` and gives q and qd of every step and the end's data."""
    model, data = SCENE.model, mujoco.MjData(SCENE.model)
    data.qpos[:] = SCENE.home if q is None else q
    path = np.empty((steps, 2, model.nv))
    for k in range(steps):
        path[k] = data.qpos, data.qvel
        data.qfrc_applied[:] = law(k, data.qpos.copy(), data.qvel.copy())
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    return path, data


def test_pd_with_gravity_compensation_reaches_its_pose():
    target = SCENE.home + np.array([0.3, -0.2, 0.2, 0.4, -0.3, 0.5])
    control = GravityPD(ARM, kp=300.0, kd=60.0)
    path, _ = simulate(lambda k, q, qd: control.torque(q, qd, target), 6000)
    np.testing.assert_allclose(path[-1, 0], target, atol=1e-3)


def test_computed_torque_follows_a_fast_path():
    motion = random_motion(np.random.default_rng(3), workspace(SCENE), 3.0, 60.0, DT)
    control = ComputedTorque(ARM, bandwidth=40.0)
    path, _ = simulate(
        lambda k, q, qd: control.torque(q, qd, motion.q[k], motion.qd[k], motion.qdd[k]),
        len(motion.q),
        motion.q[0],
    )
    assert np.abs(motion.qd).max() > 0.5
    assert np.abs(path[:, 0] - motion.q).max() < 2e-3


def test_operational_space_takes_the_tool_along_a_straight_line():
    control = OperationalSpace(ARM, rest=SCENE.home)
    goal = control.pose(SCENE.home)
    goal[:3, 3] += [-0.1, 0.12, -0.08]
    path, data = simulate(lambda k, q, qd: control.torque(q, qd, goal), 4000)
    site = data.site("flange")
    np.testing.assert_allclose(site.xpos, goal[:3, 3], atol=1e-3)
    np.testing.assert_allclose(site.xmat.reshape(3, 3), goal[:3, :3], atol=2e-3)
    tool = np.array([control.pose(q)[:3, 3] for q in path[::50, 0]])
    start, along = tool[0], (goal[:3, 3] - tool[0]) / np.linalg.norm(goal[:3, 3] - tool[0])
    off = (tool - start) - np.outer((tool - start) @ along, along)
    assert np.linalg.norm(off, axis=1).max() < 5e-3  # unit masses in every direction


def test_admittance_rests_where_spring_and_push_agree():
    control = Admittance(np.zeros(2), DT, mass=[1, 2], damping=20, stiffness=[50, 100])
    for _ in range(6000):
        q, qd = control.step(np.array([5.0, -20.0]))
    np.testing.assert_allclose(q, [0.1, -0.2], atol=1e-6)
    np.testing.assert_allclose(qd, 0, atol=1e-6)


def test_admittance_follows_the_damped_mass_on_paper():
    """Without a spring, v(t) = (tau/D) (1 - exp(-D t / M))."""
    control = Admittance(np.zeros(1), 1e-4, mass=2.0, damping=10.0, dead_band=3.0)
    for _ in range(5000):
        _, qd = control.step(np.array([8.0]))
    assert qd[0] == pytest.approx(0.5 * (1 - np.exp(-10 * 0.5 / 2)), rel=1e-3)
    still = Admittance(np.zeros(1), 1e-4, dead_band=3.0)
    assert still.step(np.array([-2.9]))[1] == 0


def test_frames_of_the_model_are_mujocos_sites():
    model, data = SCENE.model, mujoco.MjData(SCENE.model)
    control = OperationalSpace(ARM)
    data.qpos[:] = [0.3, -0.4, 0.5, 0.6, -0.7, 0.8]
    mujoco.mj_forward(model, data)
    pose = control.pose(data.qpos.copy())
    np.testing.assert_allclose(pose[:3, 3], data.site("flange").xpos, atol=1e-12)
    np.testing.assert_allclose(pose[:3, :3], data.site("flange").xmat.reshape(3, 3), atol=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: GravityPD(ARM, kp=[1.0, 2.0]), r"kp: shape \(2,\); expected a number or \(6,\)"),
        (lambda: GravityPD(ARM, kd=-1.0), "0 or more"),
        (lambda: ComputedTorque(ARM, 0.0), "above 0"),
        (lambda: OperationalSpace(ARM, "hand"), "the model has universe"),
        (lambda: Admittance(np.zeros(2), 0.0), "above 0"),
    ],
)
def test_bad_gains_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize("seed", [33, 36])  # six and seven joints
def test_operational_space_has_no_static_error_on_arms_never_seen(seed, tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(random_arm(seed))
    assert tool_error(str(path), True, 0.0, 3.0) < 0.1
    assert tool_error(str(path), False, 1500.0, 5.0) < 2.0
