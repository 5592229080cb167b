"""React, ClothReach and TwoArms: what happens in them is what their names say."""

import warnings
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from oracles.contact_forces import contact_torques
from tauguard.detectors import ArmModel, CollisionAlarm, RobotNumbers
from tauguard.envs.gym.second_arm import both_drives
from tauguard.models import BodyProxy, cura6, cura6_drive, pin_model
from tauguard.models.left_over import LeftOver

from ..models.arms import SEVEN, TETRAHEDRON


@pytest.fixture(scope="module")
def seven(tmp_path_factory):
    folder = tmp_path_factory.mktemp("seven")
    (folder / "seven.xml").write_text(SEVEN)
    (folder / "tool.obj").write_text(TETRAHEDRON)
    return str(folder / "seven.xml")


@pytest.mark.parametrize("control", ["torque", "joint_velocity", "cartesian"])
@pytest.mark.parametrize("name", ["Reach-v0", "React-v1"])
def test_seven_joints_from_a_file(name, control, seven):
    env = gym.make(f"tauguard/{name}", robot=seven, control=control, detector="observer")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
    assert env.action_space.shape == (6,) if control == "cartesian" else (7,)
    assert len(env.reset(seed=0)[1]["tau_ext"]) == 7


@pytest.fixture(scope="module")
def urdf(tmp_path_factory):
    """Seven joints in a row, axes in turn upright and level, as a URDF."""
    parts = ['<link name="base"/>']
    for k in range(1, 8):
        parent = "base" if k == 1 else f"link{k - 1}"
        axis = "0 0 1" if k % 2 else "0 1 0"
        parts.append(
            f'''<link name="link{k}"><inertial><origin xyz="0 0 0.1"/><mass value="{4 - 0.4 * k}"/>
            <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
            <collision><origin xyz="0 0 0.1"/><geometry><cylinder radius="0.05" length="0.16"/>
            </geometry></collision></link>
            <joint name="joint{k}" type="revolute"><parent link="{parent}"/><child link="link{k}"/>
            <origin xyz="0 0 0.2"/><axis xyz="{axis}"/>
            <limit lower="-2.8" upper="2.8" effort="100" velocity="2"/></joint>'''
        )
    path = tmp_path_factory.mktemp("urdf") / "seven.urdf"
    path.write_text(f'<robot name="seven">{"".join(parts)}</robot>')
    return str(path)


@pytest.mark.parametrize("name", ["Reach-v0", "React-v1"])
def test_seven_joints_from_a_urdf(name, urdf):
    env = gym.make(f"tauguard/{name}", robot=urdf)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
    assert env.action_space.shape == (7,)


class Slow:
    """A method of another's that never raises an alarm."""

    name, dt, settle = "slow", 1e-3, 0.4

    def __init__(self):
        self.arm = ArmModel(RobotNumbers.from_pin(pin_model(cura6.arm_xml())), cura6_drive().gain)

    def scores(self, trace):
        return np.zeros(len(trace.t))

    def stream(self):
        return self

    def step(self, q, qd, current, dt=None):
        return 0.0


def test_a_detector_of_another_arm_or_rate_is_refused():
    slow = Slow()
    slow.dt = 4e-3
    with pytest.raises(ValueError, match="a sample every 4 ms, but the scene's time step is 1 ms"):
        gym.make("tauguard/Reach-v0", detector=CollisionAlarm(slow, 0.5))
    with pytest.raises(ValueError, match=r"trained on another arm: the axis of .* mm from that"):
        gym.make("tauguard/Reach-v0", robot="cura6-long", detector=CollisionAlarm(Slow(), 0.5))
    with pytest.raises(ValueError, match="trained on 6 joints, the scene has 12"):
        gym.make("tauguard/TwoArms-v1", detector=CollisionAlarm(Slow(), 0.5))


@pytest.mark.parametrize("name", ["React", "ClothReach", "TwoArms"])
def test_a_version_that_ended_names_the_one_that_works(name):
    with pytest.raises(gym.error.DeprecatedEnv, match=f"Please use `tauguard/{name}-v1`"):
        gym.make(f"tauguard:tauguard/{name}-v0")


def test_react_ends_badly_for_who_hurries_and_pays_for_standing():
    returns = {}
    for name, speed in (("stand", 0.0), ("hurry", 1.0)):
        env = gym.make("tauguard/React-v1", control="cartesian")
        env.reset(seed=0)
        returns[name], over = 0.0, False
        while not over:
            _, reward, terminated, truncated, info = env.step([0, speed, 0, 0, 0, 0])
            returns[name] += reward
            over = terminated or truncated
        assert terminated == (name == "hurry")
        assert info["reason"] == ("a force limit is exceeded" if terminated else "")
    assert max(returns.values()) < 0


def test_the_cloth_is_pushed_and_pushes_back():
    env = gym.make("tauguard/ClothReach-v1", control="cartesian", checkers=("rigid",)).unwrapped
    env.reset(seed=0)
    data = env.batch.datas[0]
    hanging = data.flexvert_xpos.copy()
    forces = []
    for step in range(110):
        info = env.step(np.array([0, 0, -1.0, 0, 0, 0] if step < 40 else [1.0, 0, 0, 0, 0, 0]))[4]
        forces.append(info["force"])
        assert info["contacts"].shape == (1,)
    assert max(forces[:30]) == 0
    assert max(forces) > 0.5
    assert data.flexvert_xpos[:, 0].max() > hanging[:, 0].max() + 0.1
    assert info["reason"] == ""


def test_unknown_checkers_are_named():
    with pytest.raises(ValueError, match="rigid"):
        gym.make("tauguard/Reach-v0", checkers=("psychic",))


def test_a_checker_sees_the_blow_that_the_sensors_feel():
    proxy = BodyProxy("hand", position=(0.0, 0.6, 0.45), direction=(0.0, -1.0, 0.0))
    env = gym.make("tauguard/Reach-v0", obstacles=(proxy,), checkers=("rigid",)).unwrapped
    env.reset(seed=0)
    model, data = env.compiled.scene.model, env.batch.datas[0]
    joint = model.joint("hand")
    data.qpos[joint.qposadr[0]], data.qvel[joint.dofadr[0]] = 0.2, 0.5
    touched, seen = [], []
    for _ in range(80):
        info = env.step(np.zeros(6))[4]
        touched.append(info["force"] > 0)
        seen.append(info["contacts"][0] > 0)
    assert any(touched)
    assert not any(t and not s for t, s in zip(touched, seen, strict=True))
    assert sum(seen) <= sum(touched) + 2


def test_two_arms_push_one_another_with_equal_and_opposite_forces():
    env = gym.make("tauguard/TwoArms-v1", control="cartesian", control_rate=1000).unwrapped
    env.reset(seed=0)
    model, data = env.compiled.scene.model, env.batch.datas[0]
    action = np.zeros(12)
    action[[0, 1, 6]] = 1, -0.3, -1
    checked = 0
    for _ in range(1500):
        info = env.step(action)[4]
        if info["force"] == 0:
            continue
        expected = contact_torques(model, data)[env.compiled.scene.dof_adr]
        scale = np.abs(expected).max()
        assert info["tau_ext"] == pytest.approx(expected, abs=5e-3 * scale + 1e-9)
        if np.abs(info["tau_ext"][:6]).max() > 1 and np.abs(info["tau_ext"][6:]).max() > 1:
            checked += 1
        if checked > 20:
            break
        both = {int(model.body_rootid[model.geom_bodyid[g]]) for g in data.contact.geom.ravel()}
        if data.ncon and len(both) == 2 and 0 not in both:  # nothing but the arms
            period = 1 / env.compiled.settings.control_rate
            assert 0 < info["cost"] <= info["force"] * period * (1 + 1e-9)
    assert checked > 20
    assert info["cost_sum"] > 0


def test_two_arms_use_the_same_arm_twice():
    env = gym.make("tauguard/TwoArms-v1").unwrapped
    model = env.compiled.scene.model
    for name in env.compiled.scene.joint_names[:6]:
        other = model.joint("arm2_" + name)
        assert model.joint(name).armature == other.armature
        assert model.body(model.jnt_bodyid[model.joint(name).id]).mass == pytest.approx(
            model.body(model.jnt_bodyid[other.id]).mass
        )
    observation, _ = env.reset(seed=0)
    assert observation.shape == (48,)
    assert np.abs(observation[36:39] - observation[39:42]).max() > 0.1


def test_the_drives_of_two_arms_double_what_each_joint_has():
    drive, log = cura6_drive(), np.repeat([0, 1], 200)
    errors = np.random.default_rng(7).normal(size=(2, 400, 6))
    left_over = LeftOver(100.0, log, *errors)
    friction = replace(drive.friction, slope=np.ones((6, 2)), slope_velocity=np.array([0.1, 1.0]))
    sensors = replace(drive.sensors, left_over=left_over)
    both = both_drives(replace(drive, friction=friction, sensors=sensors))
    np.testing.assert_array_equal(both.gain, np.tile(drive.gain, 2))
    assert both.friction.slope.shape == (12, 2)
    assert both.friction.slope_velocity.tolist() == [0.1, 1.0]
    np.testing.assert_array_equal(both.sensors.left_over.qd[:, 6:], left_over.qd)
    assert both.ripple.cycles.shape == drive.ripple.cycles.shape
