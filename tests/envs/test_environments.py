"""The environments keep Gymnasium's contract, and what they report is what happened."""

import ctypes.util
import os
import subprocess
import sys
import warnings
from pathlib import Path

import gymnasium as gym
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import tauguard
from oracles.contact_forces import contact_torques
from tauguard.environments import ENVIRONMENTS
from tauguard.envs.gym.reach import ReachEnv
from tauguard.envs.gym.settings import CONTROLS
from tauguard.models import BodyProxy

REACH = "tauguard:tauguard/Reach-v0"


def quiet_check(env):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)


@pytest.mark.parametrize("control", CONTROLS)
@pytest.mark.parametrize("name", sorted(ENVIRONMENTS))
def test_check_env_has_nothing_to_say(name, control):
    quiet_check(gym.make(name, control=control))


@pytest.mark.parametrize(
    "keywords",
    [
        {"detector": "observer"},
        {"noise": True},
        {"detector": "observer", "checkers": ("mujoco", "cloth", "rigid")},
        {"payload_g": 3000, "mismatch": 3, "ideal_drive": False},
        {"obstacles": (), "labels": False, "ideal_drive": True},
        {"control_rate": 50, "timestep": 2e-3},
    ],
)
def test_check_env_with_keywords(keywords):
    quiet_check(gym.make(REACH, **keywords))


def test_registration_leaves_the_heavy_libraries_unloaded():
    code = (
        "import sys, tauguard, gymnasium; assert 'tauguard/Reach-v0' in gymnasium.registry; "
        "print([m for m in ('mujoco', 'pinocchio', 'sklearn', 'glfw') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"
    assert tauguard.__version__


def test_info_has_the_same_keys_types_and_shapes_at_every_step():
    env = gym.make(REACH, detector="observer", contact_area=1.0)
    _, info = env.reset(seed=3)
    shape = {key: (type(value), np.shape(value)) for key, value in info.items()}
    env.action_space.seed(0)
    for _ in range(50):
        info = env.step(env.action_space.sample())[4]
        assert {key: (type(value), np.shape(value)) for key, value in info.items()} == shape


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"contrl": "torque"}, "did you mean control"),
        ({"robot": ("ur5e", "panda")}, "expected a name, a file or a Robot, also for two arms"),
        ({"zzz": 1}, "payload_g"),
        ({"control": "fly"}, "joint_velocity"),
        ({"control_rate": 333}, "whole number"),
        ({"control_rate": np.nan}, "above 0"),
        ({"timestep": -1}, "above 0"),
        ({"payload_g": -1}, "0 to 1,000,000 grams"),
        ({"obstacles": ("tail",)}, "lower_arm"),
        ({"detector": "crystal ball"}, "observer"),
        ({"detector": 3}, "CollisionAlarm"),
        ({"integrator": "magic"}, "implicitfast"),
        ({"max_speed": 0}, "above 0"),
        ({"mismatch": "large"}, "a seed"),
        ({"checkers": "magic"}, "rigid"),
        ({"table": True}, "table True: expected a tauguard.models.Table or None"),
        ({"cloth": "silk"}, "cloth 'silk': expected a tauguard.models.Cloth or None"),
        ({"checkers": None}, "checkers None: expected one, or a tuple of them"),
        ({"objects": 3}, "objects 3: expected one, or a tuple of them"),
        ({"control_rate": "fast"}, "control_rate 'fast': expected a number"),
        ({"max_speed": {}}, "max_speed {}: expected a number or None"),
        ({"payload_g": 1e9}, "expected 0 to 1,000,000 grams"),
    ],
)
def test_keywords_that_cannot_be_say_what_would_work(keywords, words):
    with pytest.raises(ValueError, match=words):
        gym.make(REACH, **keywords)


def test_react_needs_somebody_to_strike():
    with pytest.raises(ValueError, match="chest"):
        gym.make("tauguard/React-v1", obstacles=())


def test_a_robot_that_is_not_there():
    with pytest.raises(FileNotFoundError, match="cura6"):
        gym.make(REACH, robot="nowhere.xml")


@pytest.mark.parametrize(
    ("action", "words"),
    [
        (np.zeros(5), r"\(5,\), expected \(6,\).*joint1"),
        (np.zeros((1, 6)), "expected"),
        (np.array([0, 0, np.nan, 0, 0, 0]), "not finite at entry 2"),
        (np.array([0, 0, 0, 0, 0, np.inf]), "not finite at entry 5"),
    ],
)
def test_bad_actions(action, words):
    env = gym.make(REACH).unwrapped
    env.reset(seed=0)
    before = env.batch.metrics.copy()
    with pytest.raises(ValueError, match=words):
        env.step(action)
    assert np.array_equal(before, env.batch.metrics)


def test_step_before_reset():
    with pytest.raises(gym.error.ResetNeeded):
        gym.make(REACH).unwrapped.step(np.zeros(6))


def test_a_diverged_simulation_ends_truncated_without_nan():
    env = gym.make(REACH, obstacles=()).unwrapped
    env.reset(seed=0)
    good, *_ = env.step(np.zeros(6))
    env.batch.datas[0].qvel[2] = 1e6
    for _ in range(3):
        observation, reward, terminated, truncated, info = env.step(np.ones(6))
        assert truncated
        assert not terminated
        assert "diverged" in info["reason"]
        assert np.isfinite(reward)
        assert np.array_equal(observation, good)
        assert env.observation_space.contains(observation)
    assert np.isfinite(env.reset(seed=1)[0]).all()
    assert not env.step(np.zeros(6))[3]


def stepped(mode, action, steps, **keywords):
    env = gym.make(REACH, control=mode, obstacles=(), ideal_drive=True, **keywords).unwrapped
    env.reset(seed=5)
    first = env.batch.observation[0].copy()
    for _ in range(steps):
        env.step(np.asarray(action, dtype=float))
    return env, first, env.batch.observation[0].copy()


def test_zero_velocity_stands_still_and_full_velocity_moves_at_full_speed():
    _, first, last = stepped("joint_velocity", np.zeros(6), 100)
    assert np.abs(last[:6] - first[:6]).max() < 1e-3
    env, _, last = stepped("joint_velocity", [0.5, 0, 0, 0, 0, 0], 60)
    assert last[6] == pytest.approx(0.5 * env.compiled.max_speed[0], rel=0.01)


def test_zero_torque_floats_and_zero_current_falls():
    _, first, last = stepped("torque", np.zeros(6), 50)
    assert np.abs(last[:6] - first[:6]).max() < 0.01
    _, first, last = stepped("current", np.zeros(6), 50)
    assert np.abs(last[:6] - first[:6]).max() > 0.05


def test_position_mode_arrives_where_the_table_says():
    action = np.array([0.2, 0.1, -0.1, 0.2, -0.2, 0.3])
    env, _, last = stepped("joint_position", action, 300)
    low, high = np.array([(e.low, e.high) for e in env.batch.actions]).T
    assert last[:6] == pytest.approx(low + (action + 1) / 2 * (high - low), abs=0.01)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_cartesian_mode_moves_the_tool_along_the_axis(axis):
    action = np.zeros(6)
    action[axis] = 0.4
    _, first, last = stepped("cartesian", action, 50)
    moved = last[18:21] - first[18:21]
    asked = 0.4 * 0.5 * 0.01 * 50
    # The reference of the servo runs ahead of the arm by its lag: 2 / bandwidth = 67 ms of speed.
    assert moved[axis] == pytest.approx(asked - 0.2 * 0.067, abs=0.15 * asked)
    assert np.abs(np.delete(moved, axis)).max() < 0.1 * asked


def test_observation_agrees_with_mujoco():
    env = gym.make(REACH, obstacles=("hand", "lower_arm", "chest")).unwrapped
    env.reset(seed=2)
    rng = np.random.default_rng(0)
    for _ in range(30):
        observation = env.step(rng.uniform(-1, 1, 6))[0]
    model = env.compiled.scene.model
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = env.batch.datas[0].qpos, env.batch.datas[0].qvel
    mujoco.mj_forward(model, data)
    named = dict(zip([e.name for e in env.batch.observations], observation, strict=True))
    assert [named[f"position of joint{i}"] for i in range(1, 7)] == pytest.approx(data.qpos[:6])
    assert [named[f"position of tool 1, {a}"] for a in "xyz"] == pytest.approx(
        data.site("flange").xpos
    )
    for region in ("hand", "lower_arm", "chest"):
        assert [named[f"position of the {region}, {a}"] for a in "xyz"] == pytest.approx(
            data.body(region).xpos
        )
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(
            model, data, mujoco.mjtObj.mjOBJ_BODY, data.body(region).id, velocity, 0
        )
        assert [named[f"velocity of the {region}, {a}"] for a in "xyz"] == pytest.approx(
            velocity[3:]
        )


@pytest.fixture(scope="module")
def struck():
    """A hand that flies into the standing arm, one physics step an action, until it has left."""
    proxy = BodyProxy("hand", position=(0.0, 0.6, 0.45), direction=(0.0, -1.0, 0.0))
    env = gym.make(REACH, obstacles=(proxy,), control_rate=1000, contact_area=2.0).unwrapped
    env.reset(seed=0)
    model, data = env.compiled.scene.model, env.batch.datas[0]
    joint = model.joint("hand")
    data.qpos[joint.qposadr[0]], data.qvel[joint.dofadr[0]] = 0.0, 0.5
    infos, forces = [], []
    for _ in range(1500):
        env.step(np.zeros(6))
        infos.append(env._info(env._metrics(), {}, False, ""))
        forces.append(contact_torques(model, data)[env.compiled.scene.dof_adr])
    return env, infos, np.array(forces)


def test_external_torque_is_the_engines(struck):
    _, infos, forces = struck
    tau = np.array([info["tau_ext"] for info in infos])
    assert np.abs(tau).max() > 1
    # mj_kinematics after the step moves the frames by one step; the wrench is the step's own.
    assert tau == pytest.approx(forces, abs=2e-3 * np.abs(tau).max())


def test_a_blow_is_judged_against_the_hands_limits(struck):
    env, infos, _ = struck
    force = np.array([info["force"] for info in infos])
    peak = int(force.argmax())
    limit = env.regions[0].transient
    assert limit == 280
    assert infos[peak]["limit_ratio"] == pytest.approx(force[peak] / limit)
    assert infos[peak]["pressure"] == pytest.approx(force[peak] / 2.0)
    assert infos[peak]["region"] == 1
    assert 1 <= infos[peak]["link"] <= 6
    assert env.regions[0].unconfirmed == ("stiffness", "mass")


def test_onset_is_the_first_step_with_force(struck):
    _, infos, _ = struck
    force = np.array([info["force"] for info in infos])
    first = int(np.flatnonzero(force > 0)[0])
    assert next(i for i, info in enumerate(infos) if info["onset"]) == first
    assert infos[first]["onset_time"] == pytest.approx(first * 1e-3)
    assert infos[first - 1]["onset_time"] == -1
    touches = np.flatnonzero(force > 0)
    onsets = 1 + np.count_nonzero(np.diff(touches) >= 500)
    assert sum(info["onset"] for info in infos) == onsets


def test_a_clamped_region_counts_against_its_quasi_static_limit():
    proxy = BodyProxy("hand", position=(0.0, 0.0, 0.0), clamped=True, radius=0.05)
    env = gym.make(REACH, obstacles=(proxy,), ideal_drive=True).unwrapped
    env.reset(seed=0)
    data = env.batch.datas[0]
    tool = env.batch.observation[0, 18:21]
    data.mocap_pos[0] = tool - np.array([0.0, 0.0, 0.12])
    ratios, forces = [], []
    for _ in range(80):
        jac = np.zeros((3, env.compiled.scene.model.nv))
        mujoco.mj_jacBody(
            env.compiled.scene.model, data, jac, None, int(env.compiled.scene.link_bodies[-1])
        )
        down = np.linalg.pinv(jac[:, :6]) @ [0, 0, -0.1]
        env.batch.plants[0].override(1, down)
        info = env.step(np.zeros(6))[4]
        ratios.append(info["limit_ratio"])
        forces.append(info["force"])
    assert max(forces) > 20
    worst = int(np.argmax(ratios))
    assert ratios[worst] == pytest.approx(forces[worst] / env.regions[0].quasi_static, rel=1e-6)


def test_reaching_a_target_pays_and_brings_the_next():
    env = gym.make(REACH, control="cartesian", obstacles=()).unwrapped
    env.reset(seed=4)
    total, successes = 0.0, 0
    for _ in range(400):
        way = env.batch.observation[0, 21:24]
        action = np.concatenate([np.clip(way / 0.02, -1, 1), np.zeros(3)])
        target = env.batch.target.copy()
        _, reward, _, _, info = env.step(action)
        total += reward
        if info["success"]:
            successes += 1
            assert not np.array_equal(target, env.batch.target)
            assert np.linalg.norm(env.batch.target - target) >= 0.1
    assert total > successes >= 1


def test_the_observer_raises_an_alarm_after_a_blow():
    proxy = BodyProxy("chest", position=(0.21, 0.7, 0.9), direction=(0.0, -1.0, 0.0))
    env = gym.make(REACH, obstacles=(proxy,), detector="observer").unwrapped
    env.reset(seed=1)
    model, data = env.compiled.scene.model, env.batch.datas[0]
    data.qpos[model.joint("chest").qposadr[0]], data.qvel[model.joint("chest").dofadr[0]] = 0.1, 1.0
    alarm_at = onset_at = None
    for step in range(150):
        info = env.step(np.zeros(6))[4]
        if info["onset"] and onset_at is None:
            onset_at = step
        if info["alarm"] and alarm_at is None:
            alarm_at = step
            assert np.abs(info["residual"]).max() > 5
    assert onset_at is not None
    assert alarm_at is not None
    assert 0 <= alarm_at - onset_at <= 10


def test_human_mode_without_a_display_says_what_would_work(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    env = gym.make(REACH, render_mode="human")
    if sys.platform == "linux":
        with pytest.raises(RuntimeError, match="'rgb_array' or"):
            env.reset(seed=0)
    with pytest.raises(ValueError, match=r"rgb_array.*human"):
        ReachEnv(render_mode="ascii")


@pytest.mark.skipif(ctypes.util.find_library("EGL") is None, reason="no EGL library")
def test_pictures_show_the_arm_and_the_target():
    code = """
import gymnasium, numpy, tauguard, warnings
from gymnasium.utils.env_checker import check_env
from tauguard.environments import ENVIRONMENTS
warnings.simplefilter("error")
warnings.filterwarnings("ignore", message=".*out of date")  # earlier versions stay usable
for name in ENVIRONMENTS:
    env = gymnasium.make(name, render_mode="rgb_array")
    env.reset(seed=0)
    assert env.render().shape == (480, 640, 3)
env = gymnasium.make("tauguard/Reach-v0", render_mode="rgb_array").unwrapped
env.metadata = env.metadata | {"render_modes": ["rgb_array"]}  # a window needs a display
check_env(env)
env = gymnasium.make("tauguard/Reach-v0", render_mode="rgb_array")
env.reset(seed=0)
a = env.render()
assert a.shape == (480, 640, 3) and a.dtype == numpy.uint8
env.unwrapped.batch.target[:] += 0.3
b = env.render()
green = [(p[..., 1].astype(int) > p[..., 0].astype(int) + 60).sum() for p in (a, b)]
moved = (a != b).any(axis=2).sum()
print(green, moved, len(numpy.unique(a.reshape(-1, 3), axis=0)))
assert min(green) > 50 and 100 < moved < 20000
assert len(numpy.unique(a.reshape(-1, 3), axis=0)) > 100
"""
    windows = ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY")  # tauguard chooses without them
    environment = {name: value for name, value in os.environ.items() if name not in windows}
    out = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment
    )
    if out.returncode and "no picture" in out.stderr:
        pytest.skip("the EGL library cannot draw here")
    assert out.returncode == 0, out.stderr


@pytest.mark.parametrize("kind", [str, Path])
def test_a_model_file_that_cannot_be_read_is_named(kind, tmp_path):
    path = tmp_path / "model.tauguard"
    path.write_text('{"format": "tauguard free-motion detector 1"}')
    with pytest.raises(ValueError, match=r"detector .*model\.tauguard: of the earlier format"):
        gym.make(REACH, detector=kind(path))
    with pytest.raises(ValueError, match=r"no\.tauguard.*no such model file; expected observer, "):
        gym.make(REACH, detector=kind(tmp_path / "no.tauguard"))


def test_an_object_that_cannot_detect_is_named_by_its_type():
    with pytest.raises(ValueError, match=r"detector: a dict; expected observer, .*CollisionAlarm"):
        gym.make(REACH, detector={"threshold": np.zeros(1000)})
